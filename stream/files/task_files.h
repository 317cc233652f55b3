/// \file task_files.h
/// Names of the files that tasks leave in the work directory: a number with leading zeros, so that sorting by name
/// is task order.
#pragma once
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

namespace tessera {

inline std::string task_file_stem(std::size_t task) {
  char text[24];
  std::snprintf(text, sizeof text, "%06zu", task);
  return text;
}

/// Committed files of a folder with this extension, in task order. A missing folder has none.
inline std::vector<std::filesystem::path> list_task_files(const std::filesystem::path& folder,
                                                          const std::string& extension) {
  std::vector<std::filesystem::path> files;
  if (!std::filesystem::exists(folder)) return files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == extension) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace tessera
