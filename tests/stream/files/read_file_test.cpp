// Inputs that change while they are read, and what is no file at all.
#include "stream/files/read_file.h"

#include <catch2/catch.hpp>

#include <sys/stat.h>

#include "octree/error.h"
#include "stream/formats/byte_window.h"
#include "stream/formats/closed_file.h"
#include "tests/helpers/temp_folder.h"

namespace read_file_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("read file: what changes while it is read is told at the end of the pass", "[fault]") {
  const TempFolder folder;
  const auto path = folder.write("a.xyz", std::string(100000, 'x'));
  const ReadFile file(path);
  const ClosedFile closed(file);
  ByteWindow window(file, 0, file.size(), 4096);
  const auto pass = [&] {
    while (window.remaining() > 0) {
      window.peek(1);
      window.skip(4096);
    }
  };
  SECTION("nothing changes") {
    CHECK_NOTHROW(pass());
    CHECK_NOTHROW(closed.open());
  }
  SECTION("it shrinks and grows again") {
    window.peek(1);
    std::filesystem::resize_file(path, 10);
    std::filesystem::resize_file(path, 100000);
    CHECK_THROWS_AS(pass(), InputError);
    CHECK_THROWS_AS(closed.open(), InputError);
  }
  SECTION("it is written over in place") {
    window.peek(1);
    std::fstream(path, std::ios::in | std::ios::out | std::ios::binary) << "yyy";
    CHECK_THROWS_AS(pass(), InputError);
  }
  SECTION("it grows") {
    std::ofstream(path, std::ios::app) << "more";
    CHECK_THROWS_AS(pass(), InputError);
  }
}

TEST_CASE("read file: pipes, folders and devices are no input", "[fault]") {
  const TempFolder folder;
  REQUIRE(::mkfifo((folder / "pipe").c_str(), 0600) == 0);
  CHECK_THROWS_AS(ReadFile(folder / "pipe"), InputError);
  CHECK_THROWS_AS(ReadFile(folder.path()), InputError);
  CHECK_THROWS_AS(ReadFile("/dev/zero"), InputError);
}

}  // namespace read_file_test
