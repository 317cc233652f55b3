#include "stream/runtime/option_table.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/decimate/simplify_options.h"
#include "stream/stages/jobs.h"
#include "stream/stages/smooth/smooth_job.h"

namespace option_table_test {

using namespace tessera;
namespace {

/// A value that the row does not hold and may.
Json other_value(const OptionRow& row) {
  if (std::holds_alternative<std::vector<Double3>*>(row.field)) return {{0.1, -2.5, 1e300}, {4.0, 5.0, 6.0}};
  if (std::holds_alternative<std::vector<std::string>*>(row.field)) return {"x", "y"};
  if (std::holds_alternative<bool*>(row.field)) return !*std::get<bool*>(row.field);
  if (std::holds_alternative<double*>(row.field)) return *std::get<double*>(row.field) == 0.7 ? 0.8 : 0.7;
  if (std::holds_alternative<int*>(row.field)) return *std::get<int*>(row.field) + 1;
  if (std::holds_alternative<std::uint32_t*>(row.field)) return *std::get<std::uint32_t*>(row.field) + 1;
  if (std::holds_alternative<std::uint64_t*>(row.field)) return *std::get<std::uint64_t*>(row.field) + 1;
  if (std::holds_alternative<std::optional<Double3>*>(row.field)) return {0.0, 1.0 / 3.0, -1.0};
  return row.words.empty()                      ? "some text"
         : row.words.back() == row.value_text() ? row.words.front()
                                                : row.words.back();
}

/// Changes one row after the other; each must show, alone, and survive the way through text.
template <typename Options>
void check_round_trip() {
  Options plain;
  const OptionTable names = option_table(plain);
  const Json defaults = names.to_json();
  CHECK(parse_json(to_settings(plain)) == defaults);
  CHECK(defaults.size() == names.rows().size());
  for (const OptionRow& row : names.rows()) {
    CAPTURE(row.names.front());
    Options changed;
    const OptionTable table = option_table(changed);
    const Json value = other_value(*table.find(row.names.front()));
    table.from_json({{row.names.front(), value}});
    Json expected = defaults;
    expected[row.names.front()] = value;
    CHECK(table.to_json() == expected);
    CHECK(table.to_json() != defaults);
    const std::string settings = to_settings(changed);
    CHECK(to_settings(from_settings<Options>(settings)) == settings);
  }
}

}  // namespace

TEST_CASE("option table: every option of every job survives the way to text and back", "[unit]") {
  check_round_trip<ReconstructOptions>();
  check_round_trip<SimplifyOptions>();
  check_round_trip<SmoothOptions>();
}

TEST_CASE("option table: what is typed is read, or refused by name", "[unit]") {
  double length = 1.0;
  int count = 0;
  std::uint32_t edges = 0;
  std::uint64_t bytes = 0;
  bool flag = false;
  std::string method = "emc";
  std::vector<std::string> columns = {"old"};
  std::vector<Double3> positions;
  std::optional<Double3> up;
  OptionTable t("group");
  t.add("length,voxel,l", &length, "a length").at_least(0);
  t.add("count", &count, "how many").within(-3, 8);
  t.add("edges", &edges, "edges");
  t.add("memory", &bytes, "cap").bytes();
  t.add("flag", &flag, "a flag");
  t.add("way", &method, "how").one_of({"emc", "mc"});
  t.add("columns", &columns, "names").split();
  t.add("places", &positions, "places");
  t.add("up", &up, "upwards");
  const auto set = [&](const std::string& name, const std::vector<std::string>& words) {
    t.find(name)->set(words);
  };
  set("voxel", {"2.5e-1"});
  CHECK(length == 0.25);
  set("count", {"-3"});
  CHECK(count == -3);
  set("memory", {"2G"});
  CHECK(bytes == std::uint64_t{2} << 30);
  set("flag", {"true"});
  CHECK(flag);
  set("columns", {"x,y", "z"});
  CHECK(columns == std::vector<std::string>{"x", "y", "z"});
  set("places", {"1,2,3", "4,5,6"});
  CHECK(positions == std::vector<Double3>{{1, 2, 3}, {4, 5, 6}});
  set("up", {"0,0,1"});
  CHECK(up == Double3{0, 0, 1});
  t.from_json({{"up", nullptr}, {"places", Json::array()}, {"memory", "1K"}, {"columns", "a,b"}});
  CHECK_FALSE(up.has_value());
  CHECK(positions.empty());
  CHECK(bytes == 1024);
  CHECK(columns == std::vector<std::string>{"a", "b"});

  const auto refused = [&](const std::string& name, const std::string& word, const std::string& why) {
    CAPTURE(name, word);
    CHECK_THROWS_AS(set(name, {word}), UsageError);
    CHECK_THROWS_WITH(set(name, {word}), Catch::Contains("--" + name + " " + word) && Catch::Contains(why));
  };
  for (const char* word : {"nan", "NaN", "inf", "-inf", "1e999", "0x10", "1.5m", "", " 1", "1,2"})
    refused("length", word, "finite number");
  refused("length", "-1", "at least 0");
  refused("count", "9", "-3 to 8");
  refused("count", "1.5", "whole number");
  refused("edges", "-1", "from 0 on");
  refused("edges", "4294967296", "whole number");
  refused("flag", "maybe", "true or false");
  refused("way", "m", "not one of emc, mc");
  for (const char* word : {"1,2", "1,2,3,4", "1,2,nan", "1, 2, 3", "x"}) refused("up", word, "three numbers");
  CHECK(length == 0.25);
  CHECK(method == "emc");
}

TEST_CASE("option table: a word that stands for a number is typed, kept and shown as the word", "[unit]") {
  double share = 0.0;
  OptionTable t;
  t.add("share", &share, "a share").at_least(0).or_word("auto", -1.0);
  const OptionRow* row = t.find("share");
  CHECK(row->value_text() == "0");
  row->set({"auto"});
  CHECK(share == -1.0);
  CHECK(row->value_text() == "auto");
  CHECK(t.to_json() == Json({{"share", "auto"}}));
  share = 0.5;
  t.from_json({{"share", "auto"}});
  CHECK(share == -1.0);
  t.from_json({{"share", 2}});
  CHECK(share == 2.0);
  CHECK_THROWS_WITH(row->set({"-1"}), Catch::Contains("at least 0"));
  CHECK_THROWS_WITH(row->set({"automatic"}), Catch::Contains("is not auto or a finite number"));
  CHECK(t.markdown().find("| `--share auto\\|X` | 2 | a share |") != std::string::npos);
}

TEST_CASE("option table: keys that are none are refused with the nearest one", "[unit]") {
  ReconstructOptions options;
  const OptionTable table = option_table(options);
  CHECK_THROWS_AS(table.from_json({{"resolutoin", 2}}), UsageError);
  CHECK_THROWS_WITH(table.from_json({{"resolutoin", 2}}),
                    Catch::Contains("'resolutoin'") && Catch::Contains("--resolution"));
  CHECK_THROWS_WITH(table.from_json({{"resolution", {{"x", 1}}}}), Catch::Contains("'resolution'"));
  CHECK_THROWS_AS(table.from_json({{"columns", {1, "x"}}}), UsageError);
  table.from_json({{"voxel", 3}, {"radius", 1}},
                  [](const OptionRow& row) { return row.names.front() == "radius"; });
  CHECK(options.resolution == 3.0);
  CHECK(options.radius == 0.0);
}

TEST_CASE("option table: a row of the README", "[unit]") {
  double share = 0.5;
  std::string method = "emc";
  bool hidden = false;
  OptionTable t;
  t.add("h,s", &share, "a share").shown_as("F");
  t.add("way", &method, "emc: this; mc: that").one_of({"emc", "mc"});
  t.add("secret", &hidden, "for tests").hidden();
  CHECK(t.markdown() ==
        "| option | default | meaning |\n|---|---|---|\n| `--h F` | 0.5 | a share |\n"
        "| `--way emc\\|mc` | emc | emc: this; mc: that |\n");
}

TEST_CASE("jobs: found by name, a name that is none is an error and never another job", "[unit]") {
  const JobDescription job = find_job("reconstruct", to_settings(ReconstructOptions{}));
  CHECK(job.command == "reconstruct");
  CHECK(job.stages.front().name == "unpack");
  CHECK(find_job("smooth", to_settings(SmoothOptions{})).command == "smooth");
  SimplifyOptions simplify;
  simplify.tolerance = 1.0;
  CHECK(find_job("decimate", to_settings(simplify)).stages.back().name == "write");
  for (const char* name : {"polish", "", "plan", "Reconstruct"}) {
    CHECK_THROWS_AS(find_job(name, "{}"), InputError);
    CHECK_THROWS_WITH(find_job(name, "{}"),
                      Catch::Contains("reconstruct, remesh, resample, resurface, smooth, tiles"));
  }
  CHECK_THROWS_AS(find_job("smooth", to_settings(ReconstructOptions{})), UsageError);
}

}  // namespace option_table_test
