/// \file section_axis.h
/// The axis of sections, from GeoJSON.
#pragma once
#include <filesystem>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Corners of the first LineString in the file, or of the first line of a MultiLineString, in its coordinates.
/// \throws InputError naming the file where there is none, one of no length, or what is no GeoJSON
std::vector<Double2> read_axis(const std::filesystem::path& path);

}  // namespace tessera
