// Gates about the tests: who tests what, and under which label ctest finds it.
#include <algorithm>
#include <iterator>
#include <regex>
#include <sstream>

#include "tests/house/house.h"

namespace tessera::house {

namespace {

const std::set<std::string> kLabels = {"unit", "property", "pipeline", "memory", "fault", "slurm"};

bool wants_test(const Source& s) {
  if (!s.is_header() && !s.is_cpp()) return false;
  return under(s.path, "kernels") || under(s.path, "octree") || under(s.path, "solvers") ||
         under(s.path, "stream/stages") || (under(s.path, "stream") && stem_of(s.path).ends_with("_stage"));
}

std::string joined(const Source& s) {
  std::string all;
  for (const std::string& line : s.lines) all += line + "\n";
  return all;
}

/// Path of a test file -> labels of the program that holds it.
std::map<std::string, std::set<std::string>> program_labels(const Sources& sources) {
  std::map<std::string, std::set<std::string>> out;
  static const std::regex program(R"(tessera_test\((\w+)\s+LABELS\s+([\w\s]*?)\s+SOURCES\s+([^)]*)\))");
  for (const Source& s : sources) {
    if (s.path != "tests/CMakeLists.txt") continue;
    const std::string text = joined(s);
    for (std::sregex_iterator it(text.begin(), text.end(), program), end; it != end; ++it) {
      std::istringstream labels((*it)[2]), files((*it)[3]);
      std::set<std::string> all;
      for (std::string label; labels >> label;) all.insert(label);
      for (std::string file; files >> file;) out["tests/" + file] = all;
    }
  }
  return out;
}

}  // namespace

Findings check_tests(const Sources& sources, const std::map<std::string, std::string>& covered) {
  std::set<std::string> paths, stems;
  for (const Source& s : sources) paths.insert(s.path);
  Findings out;
  for (const Source& s : sources) {
    if (!wants_test(s) || !stems.insert(stem_of(s.path)).second) continue;
    const std::string own = "tests/" + stem_of(s.path) + "_test.cpp";
    const auto other = covered.find(stem_of(s.path));
    if (paths.count(own) == 0 && other == covered.end())
      out.push_back(s.path + ": no " + own + ", and no other test is named for it (tests/house/tables.cpp)");
    if (paths.count(own) == 1 && other != covered.end())
      out.push_back(s.path + ": has a test of its own now: strike it from the table");
  }
  for (const auto& [stem, test] : covered) {
    if (stems.count(stem) == 0) out.push_back(stem + ": stands in the table of tests, but is gone");
    if (paths.count(test) == 0) out.push_back(stem + ": its test " + test + " is gone");
  }
  return out;
}

Findings check_labels(const Sources& sources) {
  const auto programs = program_labels(sources);
  static const std::regex test_case(
      R"re((?:TEST_CASE|TEST_CASE_METHOD|TEMPLATE_TEST_CASE)\s*\(\s*((?:"(?:[^"\\]|\\.)*"\s*)+)(?:,\s*"([^"]*)")?)re");
  static const std::regex tag(R"re(\[([^\]]*)\])re");
  Findings out;
  for (const Source& s : sources) {
    if (!s.is_cpp() || !s.path.ends_with("_test.cpp") || !under(s.path, "tests")) continue;
    const auto program = programs.find(s.path);
    if (program == programs.end()) {
      out.push_back(s.path + ": is in no tessera_test() of tests/CMakeLists.txt");
      continue;
    }
    std::string text;
    for (const std::string& line : s.lines) text += code_of(line) + "\n";
    for (std::sregex_iterator it(text.begin(), text.end(), test_case), end; it != end; ++it) {
      std::string name = (*it)[1];
      while (!name.empty() && name.back() <= ' ') name.pop_back();
      if (name.find(';') != std::string::npos)
        out.push_back(s.path + ": " + name + ": CMake cuts names at ';', and ctest would run nothing");
      const std::string tags = (*it)[2];
      int count = 0;
      for (std::sregex_iterator t(tags.begin(), tags.end(), tag), none; t != none; ++t) {
        const std::string label = (*t)[1];
        if (kLabels.count(label) == 1) ++count;
        const bool hidden = label == ".large" || label == ".shared";
        const std::string requested = hidden ? label.substr(1) : label;
        if (!hidden && kLabels.count(requested) == 0) {
          out.push_back(s.path + ": " + name + " has the unknown label [" + label + "]");
        } else if (program->second.count(requested) == 0) {
          out.push_back(s.path + ": " + name + ": ctest never looks for [" + requested + "] in its program");
        }
      }
      if (count != 1)
        out.push_back(s.path + ": " + name + " has " + std::to_string(count) + " labels instead of one");
      const auto next = std::next(it);
      const std::string body = next == end ? it->suffix().str() : next->prefix().str();
      if (body.find("kSharedData") != std::string::npos && tags.find("[.shared]") == std::string::npos)
        out.push_back(s.path + ": " + name + " reads ../shared/data, and is not [.shared]");
    }
  }
  return out;
}

}  // namespace tessera::house
