/// \file input_warnings.h
/// What the files of a job get wrong and what was decided about it, as the job tells it.
#pragma once
#include <string>
#include <vector>

#include "stream/points/point_inputs.h"

namespace tessera {

/// Warnings of all files (PointFileInfo::warnings), a sentence each with the file's name; of many files the first ones.
std::vector<std::string> input_warnings(const PointInputs& inputs);

}  // namespace tessera
