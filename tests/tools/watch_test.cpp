// `tessera watch`: scans that come into a folder become meshes, one after another, through stops and faults.
#include <catch2/catch.hpp>

#include <filesystem>
#include <string>

#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"

namespace watch_test {

using namespace tessera::test;

namespace {

bool holds(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("watch: each scan becomes a mesh with a report, a page and lines of log", "[pipeline]") {
  const TempFolder folder;
  const std::string in = (folder / "in").string(), out = (folder / "out").string();
  std::filesystem::create_directories(folder / "in" / "b");
  spill(folder / "job.json", "{\"memory\": \"256M\", \"threads\": 1}");
  const auto scan = [&](const std::string& name) {
    REQUIRE(shell(TESSERA_BINARY " synth --scene sphere --points 5k --normals -o " + in + "/" + name).code ==
            0);
    std::filesystem::remove(in + "/" + name + ".truth.json");
  };
  scan("a.ply");
  scan("b/c.ply");
  spill(folder / "in" / "bad.ply", "ply\nthis is none\n");
  const std::string watch = TESSERA_BINARY " watch " + in + " " + out + " --job " +
                            (folder / "job.json").string() + " --once --settle 0";
  const Outcome first = shell(watch);
  INFO(first.said);
  CHECK(first.code == 0);
  for (const char* mesh : {"/a.ply.ply", "/b/c.ply.ply"}) {
    CAPTURE(mesh);
    CHECK(std::filesystem::exists(out + mesh));
    CHECK(std::filesystem::exists(out + mesh + ".report.json"));
    CHECK(std::filesystem::exists(out + mesh + ".report.html"));
  }
  CHECK(holds(file_bytes(out + "/watch.log"), "a.ply: done in"));
  CHECK(holds(file_bytes(out + "/bad.ply.ply.failed"), "bad.ply"));
  // What is done, and what failed as it stands, is left alone.
  const Outcome again = shell(watch);
  CHECK(again.code == 0);
  CHECK(again.said.empty());
  std::filesystem::remove(in + "/bad.ply");
  scan("bad.ply");
  CHECK(shell(watch).code == 0);
  CHECK(std::filesystem::exists(out + "/bad.ply.ply"));
  // The bytes are those of the command.
  CHECK(shell(TESSERA_BINARY " reconstruct " + in + "/a.ply -o " + (folder / "one.ply").string()).code == 0);
  CHECK(file_bytes(out + "/a.ply.ply") == file_bytes(folder / "one.ply"));
}

TEST_CASE("watch: a kill and a full disk are gone on from", "[fault]") {
  const TempFolder folder;
  const std::string in = (folder / "in").string(), out = (folder / "out").string();
  std::filesystem::create_directories(folder / "in");
  REQUIRE(shell(TESSERA_BINARY " synth --scene sphere --points 300k --normals -o " + in + "/a.ply").code ==
          0);
  std::filesystem::remove(in + "/a.ply.truth.json");
  const std::string watch = TESSERA_BINARY " watch " + in + " " + out + " --once --settle 0 --every 0.1";
  // SIGTERM while the job runs: the watch passes it on, and says so.
  const Outcome stopped =
      shell(watch + " & P=$!; while [ ! -e " + out +
            "/a.ply.ply.tessera/journal ] && kill -0 $P 2>/dev/null; do sleep 0.01; done; "
            "kill -TERM $P; wait $P");
  INFO(stopped.said);
  CHECK(stopped.code == 143);
  CHECK(holds(stopped.said, "stopped, goes on"));
  CHECK_FALSE(std::filesystem::exists(out + "/a.ply.ply"));
  // A limit on files stands for the full disk: it waits, is told, and is no failure of the scan.
  const Outcome full = shell("ulimit -f 64; " + watch);
  INFO(full.said);
  CHECK(full.code == 4);
  CHECK(holds(full.said, "a.ply: waits: "));
  CHECK_FALSE(std::filesystem::exists(out + "/a.ply.ply.failed"));
  const Outcome done = shell(watch);
  INFO(done.said);
  CHECK(done.code == 0);
  CHECK(std::filesystem::exists(out + "/a.ply.ply"));
}

TEST_CASE("watch: a watch that is killed leaves a job that the next one waits for", "[fault]") {
  const TempFolder folder;
  const std::string in = (folder / "in").string(), out = (folder / "out").string();
  std::filesystem::create_directories(folder / "in");
  const std::string scan = in + "/a.ply", mesh = out + "/a.ply.ply";
  REQUIRE(shell(TESSERA_BINARY " synth --scene sphere --points 300k --normals -o " + scan).code == 0);
  std::filesystem::remove(scan + ".truth.json");
  const std::string watch = TESSERA_BINARY " watch " + in + " " + out + " --once --settle 0 --every 0.1";
  const std::string until_begun =
      " & P=$!; while [ ! -e " + mesh + ".tessera/journal ] && kill -0 $P 2>/dev/null; do sleep 0.01; done; ";
  // Its job goes on without it, and holds the work directory.
  const Outcome killed =
      shell(watch + until_begun + "kill -9 $P; wait $P; [ -e " + mesh + " ] || exec " + watch);
  INFO(killed.said);
  CHECK(killed.code == 0);
  CHECK(holds(killed.said, "waits: another process works on it"));
  CHECK_FALSE(std::filesystem::exists(mesh + ".failed"));
  REQUIRE(std::filesystem::exists(mesh));
  CHECK(std::filesystem::exists(mesh + ".report.html"));  // the watch did not end before its job
  CHECK(
      shell(TESSERA_BINARY " reconstruct --no-html " + scan + " -o " + (folder / "one.ply").string()).code ==
      0);
  CHECK(file_bytes(mesh) == file_bytes(folder / "one.ply"));
}

TEST_CASE("watch: a disk that is full takes a scan when it has room again", "[fault]") {
  const TempFolder folder;
  const std::string in = (folder / "in").string(), disk = (folder / "disk").string();
  std::filesystem::create_directories(folder / "in");
  std::filesystem::create_directories(disk);
  const std::string scan = in + "/a.ply", one = (folder / "one.ply").string();
  REQUIRE(shell(TESSERA_BINARY " synth --scene sphere --points 100k --normals -o " + scan).code == 0);
  std::filesystem::remove(scan + ".truth.json");
  const std::string mount = "mount -t tmpfs -o size=4m tmpfs " + disk;
  if (shell("unshare --mount sh -c '" + mount + "'").code != 0)
    return skip("needs the right to mount (root)");
  REQUIRE(shell(TESSERA_BINARY " reconstruct --no-html " + scan + " -o " + one).code == 0);
  const std::string watch =
      TESSERA_BINARY " watch " + in + " " + disk + "/out --once --settle 0 --every 0.1; echo code $?; ";
  const Outcome both = shell("unshare --mount sh -c '" + mount + " && " + watch + "ls " + disk +
                             "/out; mount -o remount,size=400m " + disk + "; " + watch + "cmp " + one + " " +
                             disk + "/out/a.ply.ply && echo the same bytes'");
  INFO(both.said);
  const std::size_t full = both.said.find("code 4"), done = both.said.find("code 0");
  CHECK(holds(both.said, "waits: "));
  CHECK(holds(both.said, "the disk is full"));
  CHECK(full != std::string::npos);
  CHECK(done != std::string::npos);
  CHECK(full < done);
  CHECK_FALSE(holds(both.said, ".failed"));
  CHECK(holds(both.said, "the same bytes"));
}

TEST_CASE("watch: folders that make no sense are refused", "[pipeline]") {
  const TempFolder folder;
  const std::string in = (folder / "in").string();
  std::filesystem::create_directories(in);
  CHECK(shell(TESSERA_BINARY " watch").code == 2);
  CHECK(shell(TESSERA_BINARY " watch " + in + " " + in + "/out").code == 2);
  CHECK(shell(TESSERA_BINARY " watch " + in + " " + in).code == 2);
  CHECK(shell(TESSERA_BINARY " watch " + (folder / "none").string() + " " + in).code == 3);
  CHECK(shell(TESSERA_BINARY " watch " + in + " " + (folder / "out").string() + " --job none.json").code ==
        3);
  CHECK(shell(TESSERA_BINARY " watch " + in + " " + (folder / "out").string() + " --oonce").code == 2);
}

}  // namespace watch_test
