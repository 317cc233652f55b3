#include "stream/runtime/task_counts.h"

#include <limits>

#include <catch2/catch.hpp>

namespace task_counts_test {

using namespace tessera;

TEST_CASE("task counts: signed integers count as unsigned ones do", "[unit]") {
  const int literal = 1;
  const std::vector<Json> parts = {
      {{"blocks", literal}, {"inside", {{"faces", 7}}}, {"bound", 0.25}},
      {{"blocks", std::uint64_t{2}}, {"inside", {{"faces", 5u}}}, {"bound", 0.5}}};
  const Json sum = sum_counts(parts);
  CHECK(sum == parse_json(R"({"blocks": 3, "inside": {"faces": 12}, "bound": 0.5})"));
  CHECK(sum_counts(parts, {{"blocks", 4}, {"kind", "any"}}) ==
        parse_json(R"({"blocks": 7, "kind": "any", "inside": {"faces": 12}, "bound": 0.5})"));
  const std::vector<Json> none, lists = {{{"list", {1, 2}}, {"faces", 1}}, {{"faces", 2}}};
  CHECK(sum_counts(none, {{"needed", true}}) == parse_json(R"({"needed": true})"));
  CHECK(sum_counts(lists) == parse_json(R"({"faces": 3})"));
}

TEST_CASE("task counts: a resumed run adds up to the same as one in memory", "[property]") {
  const std::vector<Json> made = {
      {{"grown", 5}, {"shrunk", -3}, {"both", -7}, {"large", std::numeric_limits<std::uint64_t>::max() - 4}},
      {{"grown", std::uint64_t{6}}, {"shrunk", -4}, {"both", 9}, {"large", 3}}};
  std::vector<Json> read;
  for (const Json& part : made) read.push_back(parse_json(dump_json(part)));
  const Json sum = sum_counts(made);
  CHECK(sum == parse_json(R"({"grown": 11, "shrunk": -7, "both": 2, "large": 18446744073709551614})"));
  CHECK(sum_counts(read) == sum);
  CHECK(dump_json(sum_counts({made[0], read[1]})) == dump_json(sum));
  CHECK(dump_json(sum_counts({made[1], read[0]})) == dump_json(sum));
}

}  // namespace task_counts_test
