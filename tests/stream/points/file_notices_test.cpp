#include "stream/points/file_notices.h"

#include <catch2/catch.hpp>

namespace tessera::file_notices_test {

TEST_CASE("file notices: a line for every kind, with how many files and the first three", "[unit]") {
  FileNotices notices;
  for (int i = 0; i < 200; ++i)
    notices.add("site/node" + std::to_string(i) + ".laz",
                "the header declares " + std::to_string(100 + i) + " points");
  notices.add("other.las", "the bounds are wide");
  PointFileInfo info;
  info.path = "a.ply";
  info.left_out = {"ring", "t\nime"};
  notices.add(info);
  using Lines = std::vector<std::string>;
  CHECK(notices.lines() ==
        Lines{"a.ply: fields left out, as nothing here takes them: ring, t?ime",
              "other.las: the bounds are wide",
              "200 files (node0.laz, node1.laz, node2.laz, ...): the header declares 100 points"});
  for (int i = 0; i < 1000; ++i) notices.add("b.las", std::string(static_cast<std::size_t>(i + 1), 'x'));
  CHECK(notices.lines().size() == 32);
  FileNotices odd;
  odd.add("\xff.las", "bytes \xfe that are no text");
  CHECK(odd.lines().size() == 1);
}

}  // namespace tessera::file_notices_test
