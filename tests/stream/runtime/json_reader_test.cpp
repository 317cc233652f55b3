#include "stream/runtime/json_reader.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>

#include "octree/error.h"

namespace json_reader_test {

using namespace tessera;
using Catch::Contains;
TEST_CASE("json reader: what a file may hold is read", "[unit]") {
  const JsonReader read("edit.json");
  const Json object =
      read.parsed(R"({"at": [1, 2.5, -3], "on": true, "name": "a", "all": [[0, 0, 0], [1, 1, 1]]})");
  read.known(object, "the file", {"at", "on", "name", "all"});
  CHECK(read.point(read.member(object, "at", "the file"), "\"at\"") == Double3{1, 2.5, -3});
  CHECK(read.flag(object.at("on"), "\"on\""));
  CHECK(read.text(object.at("name"), "\"name\"") == "a");
  CHECK(read.points(read.list(object, "all", 2, "the file"), "\"all\"").back() == Double3{1, 1, 1});
}

TEST_CASE("json reader: what it may not hold is told with file and place", "[unit]") {
  const JsonReader read("edit.json");
  CHECK_THROWS_WITH(read.parsed("{"), Contains("edit.json") && Contains("no JSON at byte"));
  CHECK_THROWS_WITH(read.known({{"rolle", 1}}, "region 3", {"role"}),
                    Contains("edit.json: \"rolle\" is not known in region 3") && Contains("role"));
  CHECK_THROWS_WITH(read.known(3, "region 3", {}), Contains("region 3 is an object"));
  CHECK_THROWS_WITH(read.member({{"a", 1}}, "b", "region 3"), Contains("region 3 wants \"b\""));
  CHECK_THROWS_WITH(read.list({{"a", {1}}}, "a", 2, "region 3"), Contains("a list of at least 2"));
  CHECK_THROWS_WITH(read.flag(1, "\"on\""), Contains("true or false"));
  CHECK_THROWS_WITH(read.text(1, "\"name\""), Contains("takes a text"));
  CHECK_THROWS_WITH(read.number("1", "\"x\""), Contains("takes a number"));
  CHECK_THROWS_WITH(read.numbers({1, "2"}, 2, "\"x\""), Contains("takes 2 numbers"));
  CHECK_THROWS_WITH(read.points(Json::array(), "\"x\""), Contains("at least one point"));
  CHECK_THROWS_AS(read.point({1, 2}, "\"x\""), InputError);
}

}  // namespace json_reader_test
