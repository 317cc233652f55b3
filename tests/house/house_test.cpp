// The house itself, and every gate against a tiny house that breaks its rule.
#include <catch2/catch.hpp>

#include <filesystem>

#include "tests/house/house.h"

namespace tessera::house {
namespace {

const Sources& house() {
  static const Sources sources = read_house(TESSERA_SOURCE_DIR);
  return sources;
}

void check_clean(const Findings& findings) {
  for (const std::string& f : findings) FAIL_CHECK(f);
  CHECK(findings.empty());
}

/// One finding that says `what`.
void check_only(const Findings& findings, const std::string& what) {
  CAPTURE(findings);
  REQUIRE(findings.size() == 1);
  CHECK(findings[0].find(what) != std::string::npos);
}

Source header(const std::string& path, std::vector<std::string> lines = {}) {
  const std::string name = path.substr(folder_of(path).size() + 1);
  lines.insert(lines.begin(), {"/// \\file " + name, "/// What it is.", "#pragma once"});
  return {path, lines};
}

Source source(const std::string& path, std::vector<std::string> lines = {}) {
  return {path, std::move(lines)};
}

Source many_lines(Source s, std::size_t count, const std::string& line) {
  s.lines.resize(count, line);
  return s;
}

}  // namespace

TEST_CASE("house: rooms and floors include downwards, without a cycle", "[unit]") {
  CHECK(house().size() > 300);
  check_clean(check_arrows(house()));
  check_clean(check_folder_sizes(house()));
}

TEST_CASE("house: no file is too long, every header says what it is", "[unit]") {
  check_clean(check_sizes(house()));
  check_clean(check_heavy_headers(house(), allowed_heavy_headers()));
}

TEST_CASE("house: every source has its header and stands in a build", "[unit]") {
  check_clean(check_headers(house(), parts_of_headers()));
  check_clean(check_listed(house()));
  check_clean(check_reader_tests(house(), linked_with_readers(), apart_from_readers()));
}

TEST_CASE("house: kernels open no file, start no thread, print nothing, know no option", "[unit]") {
  check_clean(check_kernel_words(house(), allowed_words()));
}

TEST_CASE("house: the portable build has every intrinsic that a source names", "[unit]") {
  check_clean(check_instructions(house()));
}

TEST_CASE("house: every kernel and every stage has a test, every test has a label", "[unit]") {
  check_clean(check_tests(house(), covering_tests()));
  check_clean(check_labels(house()));
}

TEST_CASE("house: the top level is what the design says", "[unit]") {
  const std::set<std::string> allowed = {"CHANGELOG.md",
                                         "CMakeLists.txt",
                                         "CMakePresets.json",
                                         "CONTRIBUTING.md",
                                         "LICENSE",
                                         "README.md",
                                         "pyproject.toml",
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
  for (const auto& entry : std::filesystem::directory_iterator(TESSERA_SOURCE_DIR)) {
    INFO(entry.path());
    CHECK(allowed.count(entry.path().filename().string()) == 1);
  }
}

TEST_CASE("gate of arrows: upwards, sideways, unknown rooms and cycles are found", "[unit]") {
  check_clean(check_arrows({header("kernels/field/band.h", {"#include \"kernels/mesh/patch.h\""})}));
  check_only(check_arrows({header("kernels/mesh/patch.h", {"#include \"stream/files/output_file.h\""})}),
             "kernels/mesh may not use stream/files/output_file.h");
  check_only(check_arrows({header("kernels/mesh/patch.h", {"#include \"kernels/field/band.h\""})}),
             "kernels/mesh may not use kernels/field/band.h");
  check_only(check_arrows({header("octree/lattice.h", {"#include \"solvers/laplacian.h\""})}),
             "octree may not use");
  check_only(check_arrows({header("stream/files/output_file.h", {"#include \"stream/runtime/job.h\""})}),
             "stream/files may not use");
  check_only(check_arrows({header("stream/points/plan.h", {"#include \"tests/helpers/random.h\""})}),
             "stream/points may not use tests/helpers/random.h");
  check_only(check_arrows({header("kernels/attic/old.h")}), "no room of this name");
  check_only(check_arrows({header("stream/points/plan.h", {"#include \"stream/meshes/weld.h\""}),
                           header("stream/meshes/weld.h", {"#include \"stream/points/plan.h\""})}),
             "cycle of folders");
  check_only(check_arrows({header("stream/stages/a/a.h", {"#include \"stream/stages/b/b.h\""}),
                           header("stream/stages/b/b.h", {"#include \"stream/stages/c/c.h\""}),
                           header("stream/stages/c/c.h", {"#include \"stream/stages/a/a.h\""})}),
             "cycle of folders stream/stages/a -> stream/stages/b -> stream/stages/c -> stream/stages/a");
}

TEST_CASE("gate of folders: the twenty-sixth stem is found, a header and its source are one", "[unit]") {
  Sources full;
  for (char c = 'a'; c < 'z'; ++c) {
    full.push_back(header(std::string("kernels/mesh/") + c + ".h"));
    full.push_back(source(std::string("kernels/mesh/") + c + ".cpp"));
  }
  check_clean(check_folder_sizes(full));
  full.push_back(header("kernels/mesh/z.h"));
  check_only(check_folder_sizes(full), "kernels/mesh: 26 stems");
}

TEST_CASE("gate of sizes: long files, stages, contracts and nameless headers are found", "[unit]") {
  check_clean(check_sizes({many_lines(source("kernels/mesh/patch.cpp"), 600, "int x;"),
                           many_lines(source("stream/import/tiles_stage.cpp"), 350, "int x;"),
                           many_lines(header("octree/points.h"), 40, "  /// word")}));
  check_only(check_sizes({many_lines(source("kernels/mesh/patch.cpp"), 601, "int x;")}),
             "601 lines, at most 600");
  check_only(check_sizes({many_lines(source("stream/import/tiles_stage.cpp"), 351, "int x;")}),
             "351 lines of a stage");
  check_only(check_sizes({many_lines(source("stream/stages/smooth/tiles.cpp"), 351, "int x;")}),
             "of a stage");
  check_only(check_sizes({many_lines(header("octree/points.h"), 42, "/// word")}), "41 lines of contract");
  check_only(check_sizes({source("octree/points.h", {"#pragma once", "", ""})}), "/// \\file points.h");
}

TEST_CASE("gate of headers: sources without one, and stale lines of the table, are found", "[unit]") {
  const Source decimator = header("kernels/decimate/decimator.h");
  const Source sweep =
      source("kernels/decimate/decimator_sweep.cpp", {"#include \"kernels/decimate/decimator.h\""});
  const std::map<std::string, std::string> part = {{sweep.path, decimator.path}};
  check_clean(check_headers({decimator, source("kernels/decimate/decimator.cpp"), sweep}, part));
  check_clean(check_headers({source("tools/tessera.cpp", {"int main(int, char**) { return 0; }"})}, {}));
  check_only(check_headers({decimator, sweep}, {}), "no header of its stem");
  check_only(check_headers({decimator}, part), "not both are there");
  check_only(check_headers({decimator, source(sweep.path)}, part), "does not include");
}

TEST_CASE("gate of tests: kernels and stages without one, and stale lines of the table, are found",
          "[unit]") {
  const Source patch = header("kernels/mesh/patch.h"), test = source("tests/kernels/mesh/patch_test.cpp");
  const std::string other = "tests/stream/meshes/patch_store_test.cpp";
  check_clean(check_tests({patch, test}, {}));
  check_clean(check_tests({patch, source(other)}, {{"kernels/mesh/patch", other}}));
  check_clean(check_tests({header("stream/files/output_file.h"), header("tools/frame/cli.h")}, {}));
  check_only(check_tests({patch}, {}), "no tests/kernels/mesh/patch_test.cpp");
  check_only(check_tests({header("stream/import/import_tiles_stage.h")}, {}), "no tests/stream/import");
  check_only(check_tests({patch}, {{"kernels/mesh/patch", other}}), "is gone");
  check_only(check_tests({source(other)}, {{"kernels/mesh/patch", other}}), "is gone");
  check_only(check_tests({patch, test, source(other)}, {{"kernels/mesh/patch", other}}), "strike it");
}

TEST_CASE("gate of kernels: files, threads, output and options are found, comments are not", "[unit]") {
  check_clean(
      check_kernel_words({source("kernels/mesh/patch.cpp",
                                 {"// std::thread, \"--up\"", "bool open(int);", "std::snprintf(b, 9, f);"}),
                          source("stream/files/read_file.cpp", {"#include <fstream>", "std::thread t;"})},
                         {}));
  for (const std::string line :
       {"#include <fstream>", "#include <thread>", "#include <dlfcn.h>", "  std::thread worker(run);",
        "#pragma omp for", "auto later = std::async(run);", "void* gl = dlopen(name, 1);",
        "int fd = ::open(path, 0);", "FILE* f = std::fopen(path, m);",
        "throw UsageError(\"--lambda must be positive\");", "std::cerr << x;", "std::printf(text);"}) {
    CAPTURE(line);
    for (const std::string path : {"kernels/mesh/patch.cpp", "octree/points.h", "solvers/laplacian.cpp"})
      check_only(check_kernel_words({source(path, {line})}, {}), "has no place in");
  }
  const std::map<std::string, std::string> allowed = {{"kernels/picture/gl.cpp dlopen(", "loads OpenGL"}};
  check_clean(check_kernel_words({source("kernels/picture/gl.cpp", {"dlopen(name, 1);"})}, allowed));
  check_only(check_kernel_words({source("kernels/picture/gl.cpp")}, allowed), "strike the exception");
}

TEST_CASE("gate of instructions: what neither SSE2 has nor the emulation names is found", "[unit]") {
  // Each without the underscore that it begins with, so that this file names none.
  const auto uses = [](const std::string& name) {
    return source("kernels/mesh/patch.cpp", {"// any _" + name, "x = to_mm_(y) + _" + name + "(x, y);"});
  };
  const Source emulation =
      header("octree/avx2_emulation.h", {std::string("#define _") + "mm256_add_pd(a, b) (__m256d)((a) + (b))",
                                         std::string("    case _") + "CMP_GE_OQ:"});
  for (const std::string name : {"mm256_add_pd", "CMP_GE_OQ", "mm_add_pd", "mm_prefetch", "mm_srli_si128"}) {
    CAPTURE(name);
    check_clean(check_instructions({emulation, uses(name)}));
  }
  for (const std::string name :
       {"mm256_add_pd", "CMP_GE_OQ", "mm256_and_si256", "mm_hadd_pd", "mm_shuffle_epi8", "mm_packus_epi32",
        "mm_popcnt_u64", "mm_fmadd_sd", "mm_add", "pdep_u64", "tzcnt_u32", "CMP_ORD_Q", "cvtss_sh",
        "_builtin_ia32_paddd256", "mm512_add_pd"}) {
    CAPTURE(name);
    check_only(check_instructions({uses(name)}), "patch.cpp:2: _" + name + " is not in SSE2");
  }
}

TEST_CASE("gate of heavy headers: JSON, CLI11 and OpenVDB in a header are found", "[unit]") {
  const std::string path = "stream/runtime/report.h";
  check_clean(check_heavy_headers({header(path, {"#include <nlohmann/json_fwd.hpp>"}),
                                   source("stream/runtime/report.cpp", {"#include <nlohmann/json.hpp>"})},
                                  {}));
  check_clean(
      check_heavy_headers({header(path, {"#include <nlohmann/json.hpp>"})}, {path + " <nlohmann/json.hpp>"}));
  for (const std::string heavy :
       {"<nlohmann/json.hpp>", "<CLI/CLI.hpp>", "<openvdb/openvdb.h>", "<fmt/format.h>"})
    check_only(check_heavy_headers({header(path, {"#include " + heavy})}, {}), "every reader pays");
}

TEST_CASE("gate of builds: a source in no CMakeLists.txt is found", "[unit]") {
  const Source patch = source("kernels/mesh/patch.cpp");
  check_clean(
      check_listed({patch, source("kernels/CMakeLists.txt", {"add_library(k", "  mesh/patch.cpp", ")"})}));
  check_only(
      check_listed({patch, source("kernels/CMakeLists.txt", {"add_library(k", "  mesh/other.cpp", ")"})}),
      "stands in no CMakeLists.txt");
  check_clean(check_listed({patch, source("kernels/CMakeLists.txt", {"file(GLOB_RECURSE k *.cpp)"})}));
  check_only(check_listed({patch, source("stream/CMakeLists.txt", {"file(GLOB_RECURSE s *.cpp)"})}),
             "stands in no CMakeLists.txt");
}

TEST_CASE("gate of readers: tests that need what is not linked with them are found", "[unit]") {
  const auto test = [](const std::string& path) {
    return Sources{source(path, {"#include \"stream/points/cells.h\"", "#include \"stream/stages/a.h\""})};
  };
  check_only(check_reader_tests(test("tests/stream/points/a_test.cpp"), {}, {}), "stream/stages/a.h");
  check_clean(check_reader_tests(test("tests/stream/points/a_test.cpp"), {"stream/stages/a"}, {}));
  check_clean(check_reader_tests(test("tests/stream/points/a_test.cpp"), {}, {"tests/stream/points/a_test"}));
  check_clean(check_reader_tests(test("tests/stream/stages/a_test.cpp"), {}, {}));
}

TEST_CASE("gate of labels: none, two, unknown ones and those that ctest never asks for are found", "[unit]") {
  const Source cmake =
      source("tests/CMakeLists.txt",
             {"tessera_test(a_test LABELS unit property large shared SOURCES", "  a_test.cpp", ")"});
  const auto with = [&](const std::string& tags, const std::string& name = "a: does") {
    const std::string macro = "TEST_CASE";  // in two, so that no reader of this file takes it for a test
    return check_labels(
        {cmake, source("tests/a_test.cpp", {macro + "(\"" + name + "\",", "    \"" + tags + "\") {"})});
  };
  check_clean(with("[unit]"));
  check_clean(with("[property][.large]"));
  check_clean(with("[unit][.shared]"));
  check_only(with("[unit]", "a: does this; and that"), "CMake cuts names");
  check_only(with(""), "0 labels instead of one");
  check_only(with("[unit][property]"), "2 labels instead of one");
  check_only(with("[fault]"), "ctest never looks for [fault]");
  check_only(with("[unit][slow]"), "unknown label [slow]");
  check_only(check_labels(
                 {source("tests/CMakeLists.txt", {"tessera_test(b_test LABELS unit SOURCES b_test.cpp)"}),
                  source("tests/b_test.cpp", {std::string("TEST_") + "CASE(\"b\", \"[unit][.large]\") {"})}),
             "ctest never looks for [large]");
  check_only(check_labels({source("tests/b_test.cpp")}), "is in no tessera_test()");
}

TEST_CASE("gate of labels: a test that reads real data says so", "[unit]") {
  const std::string macro = "TEST_CASE";
  const auto with = [&](const std::string& first, const std::string& second) {
    return check_labels(
        {source("tests/CMakeLists.txt",
                {"tessera_test(a_test LABELS unit shared SOURCES", "  a_test.cpp", ")"}),
         source("tests/a_test.cpp",
                {macro + "(\"a\", \"" + first + "\") {", std::string("  read(kShared") + "Data / name);", "}",
                 macro + "(\"b\", \"" + second + "\") {", "  read(made);", "}"})});
  };
  check_clean(with("[unit][.shared]", "[unit]"));
  check_only(with("[unit]", "[unit][.shared]"), "\"a\" reads ../shared/data, and is not [.shared]");
}

}  // namespace tessera::house
