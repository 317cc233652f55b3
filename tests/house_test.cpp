// The house itself: one-way includes, small files, kernels that know no file and no thread, a fixed top level.
#include <catch2/catch.hpp>

#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;
const fs::path kRoot = TESSERA_SOURCE_DIR;

struct Source {
  fs::path path;
  std::vector<std::string> lines;
};

std::vector<Source> sources(const std::string& folder) {
  std::vector<Source> out;
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / folder)) {
    const auto ext = entry.path().extension();
    if (ext != ".h" && ext != ".cpp") continue;
    Source s;
    s.path = entry.path();
    std::ifstream in(s.path);
    for (std::string line; std::getline(in, line);) s.lines.push_back(line);
    out.push_back(std::move(s));
  }
  return out;
}

}  // namespace

TEST_CASE("house: includes go tools -> stream -> kernels -> solvers, octree", "[unit]") {
  const std::map<std::string, std::set<std::string>> allowed = {
      {"octree", {"octree"}},
      {"solvers", {"solvers", "octree"}},
      {"kernels", {"kernels", "solvers", "octree"}},
      {"stream", {"stream", "kernels", "solvers", "octree"}},
      {"tools",
       {"tools", "stream", "kernels", "solvers", "octree", "tests"}},  // tests: sample makers of benches
  };
  std::size_t seen = 0;
  for (const auto& [folder, targets] : allowed)
    for (const Source& s : sources(folder))
      for (const std::string& line : s.lines) {
        if (line.rfind("#include \"", 0) != 0) continue;
        const std::string target = line.substr(10, line.find('/') - 10);
        INFO(s.path << ": " << line);
        CHECK(targets.count(target) == 1);
        if (target == "tests") CHECK(s.path.parent_path().filename() == "microbench");
        ++seen;
      }
  CHECK(seen > 200);
}

TEST_CASE("house: kernels open no file, start no thread, print nothing", "[unit]") {
  const std::vector<std::string> banned = {"<fstream>", "<thread>", "<mutex>",  "<atomic>", "<iostream>",
                                           "<cstdio>",  "<future>", "<spdlog/", "<tbb/",    "<filesystem>"};
  for (const std::string folder : {"octree", "kernels"})
    for (const Source& s : sources(folder))
      for (const std::string& line : s.lines) {
        if (line.rfind("#include <", 0) != 0) continue;
        for (const std::string& b : banned) {
          INFO(s.path << ": " << line);
          CHECK(line.find(b) == std::string::npos);
        }
      }
}

TEST_CASE("house: no file over 600 lines, every header says what it is", "[unit]") {
  for (const std::string folder : {"octree", "solvers", "kernels", "stream", "tools", "tests"})
    for (const Source& s : sources(folder)) {
      INFO(s.path);
      CHECK(s.lines.size() <= 600);
      if (s.path.extension() == ".h") {
        REQUIRE(s.lines.size() > 2);
        CHECK(s.lines[0].rfind("/// \\file " + s.path.filename().string(), 0) == 0);
      }
    }
}

TEST_CASE("house: the top level is what the design says", "[unit]") {
  const std::set<std::string> allowed = {"CMakeLists.txt",
                                         "CMakePresets.json",
                                         "LICENSE",
                                         "README.md",
                                         ".ci",
                                         ".clang-format",
                                         ".clang-tidy",
                                         ".git",
                                         ".gitignore",
                                         "kernels",
                                         "octree",
                                         "solvers",
                                         "stream",
                                         "tests",
                                         "tools",
                                         "build",
                                         "demo",
                                         ".cache"};
  for (const auto& entry : fs::directory_iterator(kRoot)) {
    INFO(entry.path());
    CHECK(allowed.count(entry.path().filename().string()) == 1);
  }
}
