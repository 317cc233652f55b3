#include "stream/files/json.h"

#include <limits>
#include <nlohmann/json.hpp>

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "octree/vector.h"

using namespace tessera;

namespace json_test {

TEST_CASE("json: lists of pairs are objects, all others arrays, and members stand in the order of their keys",
          "[unit]") {
  const Json object = {{"b", 1}, {"a", {1, 2.5, "text"}}, {"none", nullptr}, {"yes", true}};
  CHECK(dump_json(object) == R"({"a":[1,2.5,"text"],"b":1,"none":null,"yes":true})");
  CHECK(Json{"a", 1}.is_array());
  CHECK(Json::object().is_object());
  CHECK(Json::array({Json::array({"a", 1})}).is_array());
  CHECK(Json::array().empty());
  CHECK_THROWS_AS(Json::object({Json(1)}), JsonError);
}

TEST_CASE("json: values keep their kind, and are read as other numbers", "[unit]") {
  const Json largest = std::numeric_limits<std::uint64_t>::max();
  CHECK(largest.is_number_unsigned());
  CHECK(largest.get<std::uint64_t>() == std::numeric_limits<std::uint64_t>::max());
  CHECK(Json(-3).get<double>() == -3.0);
  CHECK(Json(2.75).get<int>() == 2);
  CHECK(Json(-2.75).get<int>() == -2);
  CHECK_THROWS_AS(Json(-1.0).get<std::uint64_t>(), JsonError);
  CHECK_THROWS_AS(Json(1e300).get<std::uint64_t>(), JsonError);
  CHECK_THROWS_AS(Json(-1e300).get<int>(), JsonError);
  CHECK_THROWS_AS(Json(std::numeric_limits<double>::quiet_NaN()).get<int>(), JsonError);
  CHECK(Json(3) == Json(3u));
  CHECK(Json(3) == Json(3.0));
  CHECK_FALSE(Json(-1) == Json(std::numeric_limits<std::uint64_t>::max()));
  CHECK(Json("a") == "a");
  CHECK_FALSE(Json("1") == Json(1));
  CHECK(Json(-1) < Json(0u));
  CHECK(Json(-2) < Json(-1));
  CHECK(Json(2.5) > Json(2));
  CHECK(Json(std::numeric_limits<std::uint64_t>::max()) > Json(-1));
  CHECK_FALSE(Json("a") < Json(1));
  CHECK_FALSE(Json("a") >= Json(1));
  CHECK_THROWS_AS(Json("1").get<double>(), JsonError);
  CHECK_THROWS_AS(Json(1).get<bool>(), JsonError);
  CHECK_THROWS_AS(Json(1).get<std::string>(), JsonError);
}

TEST_CASE("json: what is missing is told by its name", "[unit]") {
  Json j = {{"list", {1, 2}}};
  CHECK_THROWS_WITH(std::as_const(j).at("other"), Catch::Contains("\"other\" is missing"));
  CHECK_THROWS_WITH(std::as_const(j).at("list").at(2), Catch::Contains("element 2 of 2"));
  CHECK(j.find("other") == nullptr);
  CHECK(j.value("other", 7) == 7);
  CHECK(j.value("other", "none") == "none");
  CHECK_THROWS_AS(j.at("list").value("other", 7), JsonError);
  j["deep"]["deeper"] = 1;
  CHECK(j.at_path("/deep/deeper")->get<int>() == 1);
  CHECK(j.at_path("/list/1")->get<int>() == 2);
  CHECK(j.at_path("/list/2") == nullptr);
  CHECK(j.at_path("/list/x") == nullptr);
  CHECK(j.at_path("/deep/none/deeper") == nullptr);
  CHECK(j.at_path("") == &j);
}

TEST_CASE("json: copies are their own, references to members stay", "[unit]") {
  Json first = {{"a", {{"x", 1}}}};
  Json& a = first["a"];
  for (int i = 0; i < 100; ++i) first["k" + std::to_string(i)] = i;
  a["x"] = 2;
  CHECK(first.at("a").at("x") == 2);
  Json copy = first;
  copy["a"]["x"] = 3;
  CHECK(first.at("a").at("x") == 2);
  const Json moved = std::move(copy);
  CHECK(moved.at("a").at("x") == 3);
  first = first.at("a");  // a part of itself
  CHECK(dump_json(first) == R"({"x":2})");
  first.update({{"y", {{"z", 1}}}, {"x", 4}});
  CHECK(dump_json(first) == R"({"x":4,"y":{"z":1}})");
  CHECK(first.erase("x") == 1);
  CHECK(first.erase("x") == 0);
}

TEST_CASE("json: vectors, arrays and maps go in and come out", "[unit]") {
  const std::vector<double> numbers = {0.1, 1e300, -0.0};
  const Json j = {{"numbers", numbers}, {"corners", std::array<std::array<int, 2>, 2>{{{1, 2}, {3, 4}}}}};
  CHECK(j.at("numbers").get<std::vector<double>>() == numbers);
  CHECK(j.at("corners").get<std::array<std::array<int, 2>, 2>>()[1][0] == 3);
  std::vector<std::string> words;
  Json({"a", "b", "c"}).get_to(words);
  CHECK(words == std::vector<std::string>{"a", "b", "c"});
  CHECK_THROWS_AS(j.at("corners").get<std::vector<double>>(), JsonError);
  CHECK_THROWS_AS((j.at("numbers").get<std::array<double, 4>>()), JsonError);
  CHECK_THROWS_AS(Json(1).begin(), JsonError);
  CHECK(Json().begin() == Json().end());
  CHECK(Json().items().empty());
}

TEST_CASE("json: vectors of coordinates are arrays", "[unit]") {
  const Double3 v = {1.5, -2, 3};
  const Json json = {{"one", v}, {"all", std::vector<Double3>{v, v}}};
  CHECK(dump_json(json) == R"({"all":[[1.5,-2.0,3.0],[1.5,-2.0,3.0]],"one":[1.5,-2.0,3.0]})");
  CHECK(json.at("one").get<Double3>() == v);
  CHECK(json.at("all").get<std::vector<Double3>>() == std::vector<Double3>{v, v});
  CHECK(json.value("none", v) == v);
}

TEST_CASE("json text: what is read and written is what the library reads and writes", "[unit]") {
  const std::vector<std::string> texts = {
      R"({"a":[1,-2,3.25,1e-7,18446744073709551615,-9223372036854775808],"b":{"c":null,"d":[true,false]},"e":"\u00e9\n"})",
      R"([[],{},"",0.1,1e22,123456789012345680000,-0.0])", "7", R"("text")", "null"};
  for (const std::string& text : texts) {
    const nlohmann::json oracle = nlohmann::json::parse(text);
    const Json read = parse_json(text);
    CHECK(dump_json(read) == oracle.dump());
    CHECK(dump_json(read, 2) == oracle.dump(2));
    CHECK(dump_json(read, -1, true) == oracle.dump(-1, ' ', true));
    CHECK(parse_json(dump_json(read)) == read);
  }
  CHECK(dump_json(std::numeric_limits<double>::quiet_NaN()) == "null");
  CHECK(dump_json("a\xff") == "\"a\xEF\xBF\xBD\"");
}

TEST_CASE("json text: what is no JSON is refused with its byte", "[unit]") {
  CHECK_THROWS_WITH(parse_json(R"({"a": 1,})", "f.json"), Catch::Contains("f.json: no JSON at byte 9"));
  CHECK_THROWS_WITH(parse_json("[1e999]", "f.json"), Catch::Contains("larger than any"));
  CHECK_THROWS_WITH(parse_json(std::string(100000, '['), "f.json"), Catch::Contains("deeper than 512"));
  CHECK_THROWS_AS(parse_json("[1", "f.json"), InputError);
  CHECK_THROWS_AS(parse_json(""), JsonError);
  CHECK_THROWS_WITH(parse_json("{\n  \"a\": 1,}"), Catch::Contains("line 2, column 10"));
  CHECK_THROWS_WITH(parse_json(std::string(1000, '[')), Catch::Contains("deeper than 512"));
  CHECK(try_parse_json("{").is_discarded());
  CHECK(try_parse_json(std::string(100000, '[')).is_discarded());
  const std::string deep = std::string(512, '[') + std::string(512, ']');
  CHECK(dump_json(parse_json(deep)) == deep);
}

}  // namespace json_test
