// The same bytes on other machines, as far as one machine can be others: other kernels of BLAS, and a processor of which
// the C library believes that it can do less.
#include <catch2/catch.hpp>

#include <cstdlib>

#include "tests/helpers/command.h"
#include "tests/helpers/temp_folder.h"

namespace same_bytes_test {

namespace {

using namespace tessera;
namespace fs = std::filesystem;

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// NAME=VALUE, for commands that follow.
void set_variable(const std::string& text) {
  const auto equals = text.find('=');
  ::setenv(text.substr(0, equals).c_str(), text.substr(equals + 1).c_str(), 1);
}
void clear_variable(const std::string& text) {
  ::unsetenv(text.substr(0, text.find('=')).c_str());
}

}  // namespace

TEST_CASE("same bytes: whatever BLAS and the C library take the processor for", "[pipeline]") {
  const test::TempFolder folder;
  const auto at = [&](const char* name) { return (folder.path() / name).string(); };
  const auto run = [](const std::vector<std::string>& words) {
    const test::CommandResult result = test::tessera_command(words);
    INFO(result.errors);
    REQUIRE(result.code == 0);
  };
  run({"synth", "--scene", "terrain", "--points", "12k", "--noise", "0.2s", "-o", at("scan.ply")});
  run({"reconstruct", at("scan.ply"), "-o", at("mesh.ply")});
  // Something like a disk for a map: the terrain without its details.
  run({"decimate", at("mesh.ply"), "-o", at("small.ply"), "--target-faces", "3000"});
  const auto edit = [&](const char* name, const std::string& more) {
    std::ofstream(folder.path() / name)
        << R"({"regions": [{"role": "support", "sphere": {"centre": [0, 0, 0], "radius": 1e9}},
               {"role": "fixed", "half_space": {"point": [300, 0, 0], "normal": [1, 0, 0]}},
               {"role": "handle", "name": "end", "half_space": {"point": [700, 0, 0], "normal": [-1, 0, 0]})"
        << more
        << R"(}], "handles": {"end": [{"move": [0, 30, 90]}, {"rotate": {"axis": [0, 1, 0], "angle": 20}}]},
               "order": )"
        << (more.empty() ? 2 : 3) << "}";
  };
  edit("bend.json", {});
  edit("uneven.json", R"(, "smoothness": 1)");  // not symmetric
  const std::vector<std::vector<std::string>> commands = {
      {"synth", "--scene", "terrain", "--points", "12k", "--noise", "0.2s"},
      {"reconstruct", at("scan.ply")},
      {"reconstruct", at("scan.ply"), "--tolerance", "0.01", "--holes", "close"},
      {"decimate", at("mesh.ply"), "--tolerance", "0.01"},
      {"smooth", at("mesh.ply"), "--method", "denoise"},
      {"smooth", at("mesh.ply"), "--lambda", "1e5"},
      {"smooth", at("mesh.ply"), "--lambda", "1e6", "--order", "2"},
      {"smooth", at("small.ply"), "--method", "curvature-flow", "--lambda", "100"},
      {"parameterize", at("small.ply")},
      {"deform", at("mesh.ply"), at("bend.json")},
      {"deform", at("mesh.ply"), at("uneven.json")},
  };
  // Of BLAS and of the C library at once: neither can take back what the other changes.
  using Variables = std::vector<std::string>;
  const std::vector<Variables> machines = {
      {"OPENBLAS_CORETYPE=Prescott",
       "GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX,-SSE4_1,-AVX512F,-AVX512VL"},
      {"OPENBLAS_CORETYPE=Sandybridge", "GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-AVX512VL"},
      {"OPENBLAS_CORETYPE=Haswell",
       "GLIBC_TUNABLES=glibc.cpu.x86_rep_movsb_threshold=4096:glibc.cpu.hwcaps=-ERMS"},
  };
  for (const auto& command : commands) {
    std::vector<std::string> words = command;
    words.insert(words.end(), {"-o", at("out.ply"), "--force"});
    if (command[0] != "parameterize") words.insert(words.end(), {"--threads", "1"});
    run(words);
    const std::string want = bytes_of(at("out.ply"));
    REQUIRE(want.size() > 1000);
    for (const Variables& machine : machines) {
      CAPTURE(command[0], machine);
      for (const std::string& variable : machine) set_variable(variable);
      run(words);
      for (const std::string& variable : machine) clear_variable(variable);
      CHECK(bytes_of(at("out.ply")) == want);
    }
  }
}

}  // namespace same_bytes_test
