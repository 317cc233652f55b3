#include "stream/files/json_fields.h"

#include <array>
#include <catch2/catch.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace json_fields_test {
using namespace tessera;

struct Part {
  std::uint64_t faces = 0;
  std::string name = "none";

  static void fields(auto& self, auto&& field) {
    field("faces", self.faces);
    field("name", self.name);
  }
};
struct Whole {
  double edge = 0.0;
  std::array<int, 2> range = {0, 0};
  Part largest;
  std::vector<Part> parts;
  std::optional<double> confidence;

  static void fields(auto& self, auto&& field) {
    field("edge", self.edge);
    field("range", self.range);
    field("largest", self.largest);
    field("parts", self.parts);
    field("confidence", self.confidence);
  }
};

TEST_CASE("json fields: a struct comes back with its parts, lists and what is optional", "[unit]") {
  Whole whole{0.5, {3, -4}, {7, "a"}, {{1, "b"}, {2, "c"}}, std::nullopt};
  const Json written = fields_to_json(whole);
  CHECK(
      dump_json(written) ==
      R"({"edge":0.5,"largest":{"faces":7,"name":"a"},"parts":[{"faces":1,"name":"b"},{"faces":2,"name":"c"}],"range":[3,-4]})");
  CHECK(fields_to_json(fields_from_json<Whole>(written)) == written);
  whole.confidence = 0.25;
  CHECK(fields_to_json(whole).at("confidence") == 0.25);
  CHECK(fields_from_json<Whole>(fields_to_json(whole)).confidence == 0.25);
}

TEST_CASE("json fields: a member that is missing or of another kind is damage", "[unit]") {
  Json written = fields_to_json(Whole{});
  CHECK_NOTHROW(fields_from_json<Whole>(written));
  SECTION("missing") {
    written.erase("edge");
  }
  SECTION("missing in a part") {
    written["largest"].erase("name");
  }
  SECTION("a number that is text") {
    written["edge"] = "0.5";
  }
  SECTION("a list that is none") {
    written["parts"] = 3;
  }
  CHECK_THROWS_AS(fields_from_json<Whole>(written), JsonError);
}

}  // namespace json_fields_test
