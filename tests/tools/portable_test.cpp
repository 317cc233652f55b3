// Processors without AVX2, as an emulator shows them: what is compiled for more says so or hands over, and the portable build, where
// there is one, has the same bytes.
#include <catch2/catch.hpp>

#include <filesystem>
#include <string>

#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"

namespace portable_test {

using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

constexpr const char* kOld = "qemu-x86_64 -cpu Nehalem ";  // SSE4.2, no AVX

bool has_emulator() {
#if defined(TESSERA_PORTABLE) || defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  skip("this build runs on any processor, or on none that is emulated");
  return false;
#else
  if (shell("command -v qemu-x86_64").code == 0) return true;
  skip("needs qemu-x86_64 (qemu-user)");
  return false;
#endif
}

bool holds(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("portable: an old processor is told, not hit by an illegal instruction", "[pipeline]") {
  if (!has_emulator()) return;
  const TempFolder folder;
  const std::string tessera = (folder / "tessera").string();
  fs::copy_file(TESSERA_BINARY, tessera);
  const Outcome alone = shell(kOld + tessera + " --version");
  INFO(alone.said);
  CHECK(alone.code == 4);
  CHECK(holds(alone.said, "tessera: error: this processor lacks AVX2"));
  CHECK(holds(alone.said, "tessera-portable"));
  // A processor that has all of it: nothing of this.
  CHECK(shell("qemu-x86_64 -cpu max " + tessera + " --version").code == 0);
  // With a portable build beside it that one runs, with the same arguments and the same standing.
  spill(tessera + "-portable", "#!/bin/sh\necho \"portable with $# words: $2\"\nexit 5\n");
  fs::permissions(tessera + "-portable", fs::perms::owner_all);
  const Outcome handed = shell(kOld + tessera + " info 'a  scan.las'");
  INFO(handed.said);
  CHECK(handed.code == 5);
  CHECK(handed.said == "portable with 2 words: a  scan.las\n");
}

TEST_CASE("portable: the portable build has the same bytes on an old processor", "[pipeline]") {
  if (!has_emulator()) return;
  const fs::path portable = TESSERA_SOURCE_DIR "/build/portable/tessera";
  if (!fs::exists(portable)) {
    skip("no portable build: tools/build portable tessera makes it, in a quarter of an hour");
    return;
  }
  const TempFolder folder;
  const std::string scan = (folder / "scan.ply").string(), mesh = (folder / "mesh.ply").string();
  const auto same = [&](const std::string& words, const std::string& want) {
    const std::string got = (folder / "got.ply").string();
    const Outcome made = shell(TESSERA_BINARY " " + words + " -o " + want);
    INFO(made.said);
    REQUIRE(made.code == 0);
    const Outcome old = shell(kOld + portable.string() + " " + words + " --force -o " + got);
    INFO(old.said);
    CHECK(old.code == 0);
    CHECK(file_bytes(got) == file_bytes(want));
  };
  same("synth --scene terrain --points 3k", scan);
  same("reconstruct --no-html --threads 1 " + scan, mesh);
  same("decimate --no-html --threads 1 --tolerance 0.05 " + mesh, (folder / "small.ply").string());
}

}  // namespace portable_test
