#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "stream/points/cubes.h"
#include "stream/stages/scan/thin_stage.h"
#include "stream/stages/scan/unpack_stage.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random_points.h"

namespace thin_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr double kEdge = 3.0;

struct Thinned {
  std::vector<std::pair<Double3, std::uint32_t>> points;  ///< with their colours, ascending
  ReadCounts counts;
  PointDispositions dispositions;
};

/// Through the passes, read from `files` files.
Thinned thinned(const std::vector<TestPoint>& points, std::size_t files, bool backwards) {
  ChainSetup setup;
  setup.files = files;
  setup.backwards = backwards;
  setup.slice_points = 300 * files;
  setup.options.thin = kEdge;
  const TempFolder work;
  const JobState job = chain_job(work.path(), setup);
  const auto first = chain_inputs(points, setup);
  run_stage(*make_unpack_stage(job, first), job.work, backwards);
  const Json report = run_stage(*make_thin_stage(job, first), job.work, backwards);
  auto inputs = std::const_pointer_cast<PointInputs>(chain_inputs(points, setup));
  inputs->read_unpacked_of(job.work, true);
  Thinned t;
  SerialContext context(job.work);
  for (std::size_t k = 0; k < inputs->task_count(); ++k) {
    const ReadCounts c = inputs->read(k, context, true, [&](std::uint32_t, const PointChunk& chunk) {
      for (std::size_t i = 0; i < chunk.size(); ++i)
        t.points.push_back({{chunk.x[i], chunk.y[i], chunk.z[i]}, chunk.rgba[i]});
    });
    t.counts.points += c.points;
    t.counts.thinned += c.thinned;
    t.counts.other_class += c.other_class;
  }
  CHECK(context.advanced == inputs->bytes());
  CHECK(report.at("kept") == t.points.size());
  std::erase_if(t.points, [](const auto& p) { return std::isnan(p.first[0]); });
  std::sort(t.points.begin(), t.points.end());
  run_stage(SurveyStage(job, inputs, 1.0, 0), job.work);
  t.dispositions = Plan::of_work(job.work).dispositions;
  const auto distribute = run_stage(DistributeStage(job, inputs), job.work);
  CHECK(distribute.at("points") == t.dispositions.kept);
  return t;
}

}  // namespace

TEST_CASE("thin: of every cube the point nearest to its middle, whatever the order and the files", "[unit]") {
  auto points = sphere_points(20000, 40.0, {7, -11, 1000});
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].rgba = static_cast<std::uint32_t>(i) | 0xff000000u;
    points[i].n = {0, 0, 1};  // some have one place; then colours decide
    points[i].echo = Echo{static_cast<std::uint8_t>(i % 10 == 0 ? 7 : 2), 1, 1};
  }
  // As near to the middle as each other, and the same but for their colours.
  points.push_back({{300.5, 301.5, 301.5}, {}, 5, Echo{2, 1, 1}});
  points.push_back({{302.5, 301.5, 301.5}, {}, 4, Echo{2, 1, 1}});
  points.push_back({{300.5, 301.5, 301.5}, {}, 3, Echo{2, 1, 1}});
  const std::size_t finite = points.size();
  points.push_back({{std::numeric_limits<double>::quiet_NaN(), 0, 0}, {}, 9, Echo{2, 1, 1}});
  points.push_back({{std::numeric_limits<double>::quiet_NaN(), 1, 0}, {}, 9, Echo{2, 1, 1}});

  std::map<Cube, std::pair<double, std::pair<Double3, std::uint32_t>>> best;
  std::size_t wanted = 0;
  for (std::size_t i = 0; i < finite; ++i) {
    if (points[i].echo.kind == 7) continue;
    ++wanted;
    Cube cube;
    REQUIRE(cube_of(points[i].p, kEdge, cube));
    const std::pair<double, std::pair<Double3, std::uint32_t>> mine = {
        squared_distance_to_middle(points[i].p, kEdge, cube), {points[i].p, points[i].rgba}};
    const auto [at, is_new] = best.try_emplace(cube, mine);
    if (!is_new) at->second = std::min(at->second, mine);
  }
  std::vector<std::pair<Double3, std::uint32_t>> truth;
  for (const auto& [cube, b] : best) truth.push_back(b.second);
  std::sort(truth.begin(), truth.end());
  REQUIRE(truth.size() < wanted / 2);

  const Thinned one = thinned(points, 1, false);
  CHECK(one.points == truth);
  CHECK(one.counts.points == points.size());
  CHECK(one.counts.thinned == wanted - truth.size());
  CHECK(one.dispositions.read == points.size());
  CHECK(one.dispositions.non_finite == 2);
  CHECK(one.dispositions.read == one.dispositions.kept + one.dispositions.other_class +
                                     one.dispositions.thinned + one.dispositions.non_finite +
                                     one.dispositions.absurd);
  std::reverse(points.begin(), points.end());
  CHECK(thinned(points, 3, true).points == truth);
}

TEST_CASE("cubes: whole multiples of the edge, and none for what is no place", "[unit]") {
  Cube c;
  REQUIRE(cube_of({-0.5, 0.0, 2.9}, 1.0, c));
  CHECK(c == Cube{-1, 0, 2});
  CHECK(squared_distance_to_middle({-0.5, 0.5, 2.5}, 1.0, c) == 0.0);
  CHECK_FALSE(cube_of({std::numeric_limits<double>::infinity(), 0, 0}, 1.0, c));
  CHECK_FALSE(cube_of({1e30, 0, 0}, 1.0, c));
}

TEST_CASE("thin: nothing to do where all points stay", "[unit]") {
  ChainSetup setup;
  const TempFolder work;
  const JobState job = chain_job(work.path(), setup);
  const auto stage = make_thin_stage(job, chain_inputs(sphere_points(500, 30.0, {0, 0, 0}), setup));
  CHECK(stage->task_count() == 0);
  CHECK(run_stage(*stage, job.work).contains("skipped"));
}

}  // namespace thin_test
