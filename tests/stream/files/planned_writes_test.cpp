// What a command may write over.
#include "stream/files/planned_writes.h"

#include <catch2/catch.hpp>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <fstream>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/output_file.h"
#include "tests/helpers/temp_folder.h"

namespace planned_writes_test {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

void spill(const fs::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

using Existing = PlannedWrite::Existing;

struct Fixture {
  TempFolder folder;
  fs::path in = folder.path() / "in.ply", out = folder.path() / "out.ply";
  Fixture() { spill(in, "precious"); }

  void check(std::vector<PlannedWrite> writes, const fs::path& emptied = {}) const {
    check_writes(std::array{in}, writes, emptied);
  }
};

}  // namespace

TEST_CASE("planned writes: an input is never written over, whatever it is called", "[unit]") {
  const Fixture p;
  p.check({{p.out, "-o"}});
  for (const Existing existing : {Existing::kRefuse, Existing::kReplace, Existing::kAppend}) {
    const auto refused = [&](const fs::path& path) {
      CHECK_THROWS_AS(p.check({{path, "-o", existing}}), UsageError);
    };
    refused(p.in);
    refused(p.folder.path() / "." / "in.ply");
    fs::create_hard_link(p.in, p.folder.path() / "hard.ply");
    refused(p.folder.path() / "hard.ply");
    fs::create_symlink("in.ply", p.folder.path() / "soft.ply");
    refused(p.folder.path() / "soft.ply");
    fs::create_directory_symlink(p.folder.path(), p.folder.path() / "loop");
    refused(p.folder.path() / "loop" / "in.ply");
    for (const char* name : {"hard.ply", "soft.ply", "loop"}) fs::remove(p.folder.path() / name);
  }
  // nor is its name used for what is unfinished
  const fs::path unfinished = output_aside(p.out);
  spill(unfinished, "precious");
  CHECK_THROWS_AS(check_writes(std::array{unfinished}, std::array{PlannedWrite{p.out, "-o"}}), UsageError);
}

TEST_CASE("planned writes: no two outputs share a file", "[unit]") {
  const Fixture p;
  CHECK_THROWS_AS(p.check({{p.out, "-o"}, {p.out, "--report"}}), UsageError);
  CHECK_THROWS_AS(p.check({{p.out, "-o"}, {p.folder.path() / "x" / ".." / "out.ply", "--log"}}), UsageError);
  CHECK_THROWS_AS(p.check({{p.out, "-o"}, {output_aside(p.out), "--log"}}), UsageError);
  p.check({{p.out, "-o"}, {p.folder.path() / "out.json", "--report"}, {"", "--log"}});
}

TEST_CASE("planned writes: what is there stays without --force", "[unit]") {
  const Fixture p;
  spill(p.out, "somebody's");
  CHECK_THROWS_AS(p.check({{p.out, "-o"}}), UsageError);
  p.check({{p.out, "-o", Existing::kReplace}});
  CHECK_THROWS_AS(p.check({{p.out, "--log", Existing::kAppend}}), UsageError);
  spill(p.out, "");
  p.check({{p.out, "--log", Existing::kAppend}});
  spill(p.out, "2026-11-20 12:00:00.000 I tessera 0.1.0 on a machine\n");
  p.check({{p.out, "--log", Existing::kAppend}});
  const fs::path dangling = p.folder.path() / "dangling.ply";
  fs::create_symlink("nowhere", dangling);
  CHECK_THROWS_AS(p.check({{dangling, "-o"}}), UsageError);
}

TEST_CASE("planned writes: folders, devices and places that do not exist are refused at once", "[unit]") {
  const Fixture p;
  for (const Existing existing : {Existing::kRefuse, Existing::kReplace, Existing::kAppend}) {
    CHECK_THROWS_AS(p.check({{p.folder.path(), "-o", existing}}), UsageError);
    CHECK_THROWS_AS(p.check({{p.folder.path() / "", "-o", existing}}), UsageError);
    CHECK_THROWS_AS(p.check({{p.folder.path() / "missing" / "a.ply", "-o", existing}}), UsageError);
    CHECK_THROWS_AS(p.check({{p.in / "a.ply", "-o", existing}}), UsageError);
    CHECK_THROWS_AS(p.check({{"/dev/null", "-o", existing}}), UsageError);
  }
}

TEST_CASE("planned writes: nothing of the user's lies in a folder that is emptied", "[unit]") {
  const Fixture p;
  const fs::path work = p.folder.path() / "out.ply.tessera";
  fs::create_directory(work);
  p.check({{p.out, "-o"}}, work);
  CHECK_THROWS_AS(p.check({{p.out, "-o"}, {work / "a.json", "--report"}}, work), UsageError);
  CHECK_THROWS_AS(p.check({{p.out, "-o"}}, p.folder.path()), UsageError);
}

TEST_CASE("output aside: one process at a time, and nothing planted is written to", "[fault]") {
  const Fixture p;
  const fs::path aside = output_aside(p.out);
  SECTION("a second writer is told") {
    const int fd = create_aside(p.out);
    CHECK_THROWS_AS(create_aside(p.out), UsageError);
    ::close(fd);
    const int again = create_aside(p.out);  // a leftover
    CHECK(again >= 0);
    ::close(again);
  }
  SECTION("a link is not followed") {
    fs::create_symlink(p.in, aside);
    CHECK_THROWS_AS(create_aside(p.out), UsageError);
  }
  SECTION("a leftover's name goes, not its content") {
    fs::create_hard_link(p.in, aside);
    OutputFile file(p.out);
    file.append("new");
    file.finish();
    CHECK(text_of(p.out) == "new");
  }
  SECTION("a pipe in the way holds nobody up") {
    REQUIRE(::mkfifo(aside.c_str(), 0600) == 0);
    OutputFile file(p.out);
    file.append("new");
    file.finish();
    CHECK(text_of(p.out) == "new");
  }
  SECTION("durable texts go the same way") {
    fs::create_symlink(p.in, aside);
    CHECK_THROWS_AS(write_durably(p.out, "new"), UsageError);
  }
  CHECK(text_of(p.in) == "precious");
}

}  // namespace planned_writes_test
