// What adopters link: the installed C++ package, in an empty folder, and what it brings along.
#include <catch2/catch.hpp>

#include <filesystem>
#include <string>

#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace package_test {

using namespace tessera::test;

namespace {

const std::filesystem::path kBuild = std::filesystem::path(TESSERA_BINARY).parent_path();

std::string said_by(const std::string& command) {
  const Outcome outcome = shell(command);
  INFO(command << "\n" << outcome.said);
  REQUIRE(outcome.code == 0);
  return outcome.said;
}

}  // namespace

TEST_CASE("package: programs link the installed floors from an empty folder", "[pipeline]") {
  const TempFolder folder;
  const std::string prefix = (folder / "prefix").string(), examples = (folder / "examples").string(),
                    build = (folder / "build").string();
  said_by("cmake --install " + kBuild.string() + " --component library --prefix " + prefix);
  std::filesystem::copy(TESSERA_SOURCE_DIR "/tools/examples", examples,
                        std::filesystem::copy_options::recursive);
  said_by("cmake -G Ninja -S " + examples + " -B " + build + " -D CMAKE_PREFIX_PATH=" + prefix);
  said_by("cmake --build " + build);
  const std::string flags = shell("grep -h INCLUDES " + build + "/build.ninja").said;
  CHECK(flags.find(TESSERA_SOURCE_DIR) == std::string::npos);  // nothing of the tree is needed
  // Nor what the package libtessera-dev does not depend on.
  CHECK(said_by("ninja -C " + build + " -t deps").find("/openvdb/") == std::string::npos);

  CHECK(said_by(build + "/simplify_block").find("19602 faces became") != std::string::npos);
  CHECK(said_by(build + "/remesh_openmesh").find("closed: 1") != std::string::npos);

  // A job as a call: the bytes of the program, failures by their exit codes.
  const std::string scan = (folder / "scan.ply").string(), mesh = (folder / "mesh.ply").string(),
                    called = (folder / "called.ply").string(), run = (folder / "run.ply").string();
  said_by(TESSERA_BINARY " synth --scene sphere --points 20k --normals -o " + scan);
  said_by(TESSERA_BINARY " reconstruct " + scan + " -o " + mesh);
  CHECK(said_by(build + "/run_job " + mesh + " " + called + " 0.01").find("write: ") != std::string::npos);
  said_by(TESSERA_BINARY " decimate " + mesh + " -o " + run + " --tolerance 0.01");
  CHECK(file_bytes(called) == file_bytes(run));
  CHECK(shell(build + "/run_job " + (folder / "none.ply").string() + " " + (folder / "x.ply").string() +
              " 0.01")
            .code == 3);
  CHECK(shell(build + "/run_job " + mesh + " " + mesh + " 0.01").code == 2);

  // Nothing that is under the GPL: the orderings are AMD's and METIS's.
  const std::string linked = said_by("ldd " + build + "/run_job " TESSERA_BINARY);
  CHECK(linked.find("libmetis") != std::string::npos);
  for (const char* library : {"libcholmod", "libumfpack", "libopenblas", "liblapack"}) {
    CAPTURE(library);
    CHECK(linked.find(library) == std::string::npos);
  }
}

TEST_CASE("package: the page of licences is what every target links", "[pipeline]") {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  skip("sanitizers are linked too");
#else
  for (const char* built : {"tessera-vdb", "tessera-gdal", "python/tessera"})
    if (!std::filesystem::exists(kBuild / built)) return skip(std::string(built) + " is not built");
  said_by(TESSERA_SOURCE_DIR "/tools/licences --check " + kBuild.string());
#endif
}

TEST_CASE("package: the unit of the folder watch is one that systemd takes", "[pipeline]") {
  if (shell("command -v systemd-analyze").code != 0) return skip("needs systemd-analyze (systemd)");
  const TempFolder folder;
  const std::string unit = (folder / "tessera-watch@site.service").string();
  said_by("sed 's#/usr/bin/tessera#" TESSERA_BINARY "#' '" TESSERA_SOURCE_DIR
          "/tools/packaging/tessera-watch@.service' >" +
          unit);
  CHECK(said_by("systemd-analyze verify " + unit + " 2>&1").find(unit) == std::string::npos);
}

}  // namespace package_test
