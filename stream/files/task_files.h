/// \file task_files.h
/// Names of the files that tasks leave in the work directory: a number with leading zeros, so that sorting by name
/// is task order.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace tessera {

std::string task_file_stem(std::size_t task);

/// Committed files of a folder with this extension, in task order. A missing folder has none.
std::vector<std::filesystem::path> list_task_files(const std::filesystem::path& folder,
                                                   const std::string& extension);

}  // namespace tessera
