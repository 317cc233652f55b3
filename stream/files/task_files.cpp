#include "stream/files/task_files.h"

#include <algorithm>
#include <cstdio>

namespace tessera {

std::string task_file_stem(std::size_t task) {
  char text[24];
  std::snprintf(text, sizeof text, "%06zu", task);
  return text;
}

std::vector<std::filesystem::path> list_task_files(const std::filesystem::path& folder,
                                                   const std::string& extension) {
  std::vector<std::filesystem::path> files;
  if (!std::filesystem::exists(folder)) return files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == extension) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace tessera
