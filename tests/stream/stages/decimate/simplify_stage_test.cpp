// What passes of decimation add up in their summaries. The passes themselves run in tests/tools/decimate_test.cpp.
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>
#include <limits>

namespace simplify_stage_test {

namespace {

using namespace tessera;
Json sum_of(const std::vector<Json>& parts) {
  Json sum = Json::object();
  for (const Json& part : parts) add_counts(sum, part);
  return sum;
}

}  // namespace

TEST_CASE("decimate summaries: signed integers count as unsigned ones do", "[unit]") {
  const int literal = 1;
  const std::vector<Json> parts = {
      {{"blocks", literal}, {"inside", {{"faces", 7}}}, {"bound", 0.25}},
      {{"blocks", std::uint64_t{2}}, {"inside", {{"faces", 5u}}}, {"bound", 0.5}}};
  const Json sum = sum_of(parts);
  CHECK(sum == parse_json(R"({"blocks": 3, "inside": {"faces": 12}, "bound": 0.5})"));
}

TEST_CASE("decimate summaries: a resumed run adds up to the same as one in memory", "[property]") {
  const std::vector<Json> made = {
      {{"grown", 5}, {"shrunk", -3}, {"both", -7}, {"large", std::numeric_limits<std::uint64_t>::max() - 4}},
      {{"grown", std::uint64_t{6}}, {"shrunk", -4}, {"both", 9}, {"large", 3}}};
  std::vector<Json> read;
  for (const Json& part : made) read.push_back(parse_json(dump_json(part)));
  const Json sum = sum_of(made);
  CHECK(sum == parse_json(R"({"grown": 11, "shrunk": -7, "both": 2, "large": 18446744073709551614})"));
  CHECK(sum_of(read) == sum);
  CHECK(dump_json(sum_of({made[0], read[1]})) == dump_json(sum));
  CHECK(dump_json(sum_of({made[1], read[0]})) == dump_json(sum));
}

}  // namespace simplify_stage_test
