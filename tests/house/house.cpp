#include "tests/house/house.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace tessera::house {

namespace fs = std::filesystem;

Sources read_house(const std::string& root) {
  Sources out;
  for (const char* floor : {"octree", "solvers", "kernels", "stream", "tools", "tests"})
    for (fs::recursive_directory_iterator at(fs::path(root) / floor), end; at != end; ++at) {
      const fs::path& path = at->path();
      if (path.filename() == "node_modules")
        at.disable_recursion_pending();  // what npm fetched is nobody's house
      if (path.extension() != ".h" && path.extension() != ".cpp" && path.filename() != "CMakeLists.txt")
        continue;
      Source s{fs::relative(path, root).generic_string(), {}};
      std::ifstream in(path);
      for (std::string line; std::getline(in, line);) s.lines.push_back(line);
      out.push_back(std::move(s));
    }
  std::sort(out.begin(), out.end(), [](const Source& a, const Source& b) { return a.path < b.path; });
  return out;
}

std::string folder_of(const std::string& path) {
  const auto slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

std::string stem_of(const std::string& path) {
  return path.substr(0, path.rfind('.'));
}

std::string code_of(const std::string& line) {
  bool quoted = false;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    if (line[i] == '\\') {
      ++i;
    } else if (line[i] == '"') {
      quoted = !quoted;
    } else if (!quoted && line[i] == '/' && line[i + 1] == '/') {
      return line.substr(0, i);
    }
  }
  return line;
}

std::string included(const std::string& line) {
  constexpr const char kStart[] = "#include \"";
  if (!line.starts_with(kStart)) return "";
  const std::size_t begin = sizeof(kStart) - 1;
  return line.substr(begin, line.find('"', begin) - begin);
}

bool under(const std::string& path, const std::string& folder) {
  return path.starts_with(folder) && (path.size() == folder.size() || path[folder.size()] == '/');
}

}  // namespace tessera::house
