// Gates about single files: size, header, what stands in them, and that a build reads them.
#include <algorithm>
#include <array>

#include "tests/house/house.h"

namespace tessera::house {

namespace {

constexpr std::size_t kMaxLines = 600, kMaxStageLines = 350, kMaxContractLines = 40;

bool is_stage(const std::string& path) {
  return under(path, "stream/stages") || stem_of(path).ends_with("_stage");
}

std::string location(const Source& s, std::size_t line) {
  return s.path + ":" + std::to_string(line + 1);
}

void limit(Findings& out, const Source& s, const std::string& what, std::size_t count, std::size_t maximum) {
  if (count > maximum)
    out.push_back(s.path + ": " + std::to_string(count) + " " + what + ", at most " +
                  std::to_string(maximum));
}

/// Declared elsewhere: main, a fuzz target, the global operators that a program replaces, what runs before it, a Python module.
bool is_program(const Source& s) {
  return std::any_of(s.lines.begin(), s.lines.end(), [](const std::string& line) {
    return line.starts_with("int main(") || line.starts_with("void* operator new(") ||
           line.find(".preinit_array") != std::string::npos || line.starts_with("PYBIND11_MODULE(") ||
           line.find("int LLVMFuzzerTestOneInput(") != std::string::npos;
  });
}

}  // namespace

Findings check_sizes(const Sources& sources) {
  Findings out;
  for (const Source& s : sources) {
    if (!s.is_header() && !s.is_cpp()) continue;
    limit(out, s, "lines", s.lines.size(), kMaxLines);
    if (is_stage(s.path) && !under(s.path, "tests"))
      limit(out, s, "lines of a stage", s.lines.size(), kMaxStageLines);
    if (!s.is_header()) continue;
    const auto contract = std::count_if(s.lines.begin(), s.lines.end(), [](const std::string& line) {
      return line.find_first_not_of(' ') == line.find("///") && line.find("///") != std::string::npos;
    });
    limit(out, s, "lines of contract", static_cast<std::size_t>(contract), kMaxContractLines);
    const std::string name = s.path.substr(folder_of(s.path).size() + 1);
    if (s.lines.size() < 3 || s.lines[0] != "/// \\file " + name)
      out.push_back(s.path + ": does not begin with /// \\file " + name);
  }
  return out;
}

Findings check_headers(const Sources& sources, const std::map<std::string, std::string>& parts) {
  std::map<std::string, const Source*> by_path;
  for (const Source& s : sources) by_path[s.path] = &s;
  Findings out;
  for (const Source& s : sources) {
    if (!s.is_cpp() || under(s.path, "tests") || by_path.count(stem_of(s.path) + ".h") == 1) continue;
    if (is_program(s) || parts.count(s.path) == 1) continue;
    out.push_back(s.path + ": no header of its stem, and no part of another (tests/house/tables.cpp)");
  }
  for (const auto& [path, header] : parts) {
    const auto at = by_path.find(path);
    if (at == by_path.end() || by_path.count(header) == 0) {
      out.push_back(path + ": listed as a part of " + header + ", but not both are there");
      continue;
    }
    const auto& lines = at->second->lines;
    if (std::none_of(lines.begin(), lines.end(), [&](const std::string& l) { return included(l) == header; }))
      out.push_back(path + ": listed as a part of " + header + ", which it does not include");
  }
  return out;
}

Findings check_kernel_words(const Sources& sources, const std::map<std::string, std::string>& allowed) {
  static const std::array kWords = {
      "<fstream>",  "<iostream>", "<cstdio>",    "<fcntl.h>", "<unistd.h>",   "<filesystem>",
      "<sys/",      "<thread>",   "<mutex>",     "<atomic>",  "<future>",     "<omp.h>",
      "<tbb/",      "<oneapi/",   "<spdlog/",    "<dlfcn.h>", "std::thread",  "std::jthread",
      "std::async", "pthread_",   "#pragma omp", "tbb::",     "fopen(",       "::open(",
      "ifstream",   "ofstream",   "dlopen(",     "mmap(",     "std::system(", "std::cout",
      "std::cerr",  "printf(",    "\"--",
  };
  std::set<std::string> used;
  Findings out;
  for (const Source& s : sources) {
    if (!under(s.path, "kernels") && !under(s.path, "octree") && !under(s.path, "solvers")) continue;
    if (!s.is_header() && !s.is_cpp()) continue;
    for (std::size_t i = 0; i < s.lines.size(); ++i) {
      const std::string code = code_of(s.lines[i]);
      for (const std::string word : kWords) {
        const std::size_t at = code.find(word);
        if (at == std::string::npos) continue;
        if (word == "printf(" && at > 0 && code[at - 1] == 'n') continue;  // snprintf writes to memory
        if (allowed.count(s.path + " " + word) == 1) {
          used.insert(s.path + " " + word);
        } else {
          out.push_back(location(s, i) + ": " + word + " has no place in " + folder_of(s.path));
        }
      }
    }
  }
  for (const auto& [key, reason] : allowed)
    if (used.count(key) == 0)
      out.push_back(key + ": allowed (" + reason + ") but not found: strike the exception");
  return out;
}

Findings check_heavy_headers(const Sources& sources, const std::set<std::string>& allowed) {
  static const std::array kHeavy = {
      "<CLI/",    "<nlohmann/json.hpp>", "<fmt/",   "<spdlog/spdlog.h>", "<openvdb/", "<tbb/",
      "<oneapi/", "<Eigen/Dense>",       "<regex>", "<iostream>",        "<OpenMesh/"};
  Findings out;
  for (const Source& s : sources) {
    if (!s.is_header() || under(s.path, "tests")) continue;
    for (std::size_t i = 0; i < s.lines.size(); ++i)
      for (const std::string heavy : kHeavy)
        if (s.lines[i].starts_with("#include " + heavy) && allowed.count(s.path + " " + heavy) == 0)
          out.push_back(location(s, i) + ": every reader pays for " + heavy + "...: include it in the .cpp");
  }
  return out;
}

Findings check_listed(const Sources& sources) {
  std::set<std::string> listed;  // path of every word that ends in .cpp, from the root
  for (const Source& s : sources) {
    if (s.is_header() || s.is_cpp()) continue;
    for (const std::string& line : s.lines) {
      for (std::size_t begin = 0; begin < line.size();) {
        const std::size_t first = line.find_first_not_of(" ()\"", begin);
        if (first == std::string::npos) break;
        const std::size_t end = std::min(line.find_first_of(" ()\"", first), line.size());
        std::string word = line.substr(first, end - first);
        begin = end;
        if (!word.ends_with(".cpp")) continue;
        if (word.starts_with("*")) {  // a glob names all that ends so below its folder
          for (const Source& f : sources)
            if (f.path.ends_with(word.substr(1)) && f.path.starts_with(folder_of(s.path) + "/"))
              listed.insert(f.path);
          continue;
        }
        listed.insert(folder_of(s.path) + "/" + word);
      }
    }
  }
  Findings out;
  for (const Source& s : sources)
    if (s.is_cpp() && listed.count(s.path) == 0) out.push_back(s.path + ": stands in no CMakeLists.txt");
  return out;
}

Findings check_reader_tests(const Sources& sources, const std::set<std::string>& linked,
                            const std::set<std::string>& apart) {
  const auto in_rooms = [](const std::string& path, const std::vector<std::string>& rooms) {
    return std::any_of(rooms.begin(), rooms.end(),
                       [&](const std::string& room) { return under(path, room); });
  };
  Findings out;
  for (const Source& s : sources) {
    if (!s.path.ends_with("_test.cpp") || apart.count(stem_of(s.path)) != 0 ||
        !in_rooms(folder_of(s.path), {"tests/stream/files", "tests/stream/formats", "tests/stream/import",
                                      "tests/stream/points"}))
      continue;
    for (const std::string& line : s.lines) {
      const std::string header = included(line);
      if (header.starts_with("stream/") && linked.count(stem_of(header)) == 0 &&
          !in_rooms(folder_of(header), {"stream/check", "stream/files", "stream/formats", "stream/import",
                                        "stream/meshes", "stream/points", "stream/runtime"}))
        out.push_back(s.path + ": " + header + " is not linked with the tests of readers");
    }
  }
  return out;
}

}  // namespace tessera::house
