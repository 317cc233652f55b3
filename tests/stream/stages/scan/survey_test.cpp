#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/points/brick_histogram.h"
#include "stream/points/normal_sample.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/scan/probe_stage.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random_points.h"

namespace survey_test {

using namespace tessera;
using namespace tessera::test;

namespace {

Plan survey(const std::vector<TestPoint>& points, const ChainSetup& setup = {}) {
  const TempFolder work;
  const JobState job = chain_job(work.path(), setup);
  run_stage(SurveyStage(job, chain_inputs(points, setup), setup.h, 0), job.work, setup.backwards);
  return Plan::of_work(job.work);
}

/// What does not concern execution.
std::string result_of(Plan plan) {
  plan.buckets.clear();
  return dump_json(plan.to_json());
}

/// h as the two measuring passes choose it.
double measured_resolution(const std::vector<TestPoint>& points, ChainSetup setup = {}) {
  const TempFolder work;
  setup.h = 0.0;
  const JobState job = chain_job(work.path(), setup);
  const auto inputs = chain_inputs(points, setup);
  run_stage(*make_probe_stage(job, inputs), job.work, setup.backwards);
  run_stage(*make_spacing_stage(job, inputs), job.work, setup.backwards);
  return chosen_resolution(job.work).h;
}

ChainSetup at_resolution(double h) {
  ChainSetup setup;
  setup.h = h;
  return setup;
}

std::vector<TestPoint> random_plane(std::size_t count, double edge, double noise) {
  Random random(21);
  std::vector<TestPoint> points;
  for (std::size_t i = 0; i < count; ++i) {
    double z = -6.0;  // sum of uniforms, variance 1
    for (int k = 0; k < 12; ++k) z += random.unit();
    points.push_back({{random.in(0, edge), random.in(0, edge), noise * z}, {0, 0, 1}, 0});
  }
  return points;
}

}  // namespace

TEST_CASE("survey: counts every fate", "[unit]") {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  auto points = sphere_points(2000, 50.0, {0, 0, 0});
  points.push_back({{kNan, 0, 0}, {}, 0});
  points.push_back({{0, kInf, 0}, {}, 0});
  points.push_back({{0, -kInf, kNan}, {}, 0});
  points.push_back({{1e300, 1e300, 1e308}, {}, 0});  // finite, far beyond the lattice
  points.push_back({{0, 1e9, 0}, {}, 0});            // an outlier at 1e9
  const Plan plan = survey(points);
  CHECK(plan.dispositions.read == points.size());
  CHECK(plan.dispositions.non_finite == 3);
  CHECK(plan.dispositions.absurd == 2);
  CHECK(plan.dispositions.kept == 2000);
  CHECK(plan.brick_max[1] < 5);
  const ChainResult r = run_chain(points);
  CHECK(r.points.size() + r.order["duplicates"].get<std::uint64_t>() == 2000);
}

namespace {

/// A sphere whose points take turns: ground, vegetation in two returns, noise.
std::vector<TestPoint> classified_sphere() {
  auto points = sphere_points(4000, 50.0, {0, 0, 0});
  for (std::size_t i = 0; i < points.size(); ++i) {
    constexpr Echo kRotations[] = {{2, 1, 1}, {5, 1, 2}, {5, 2, 2}, {7, 1, 1}};
    points[i].echo = kRotations[i % 4];
  }
  return points;
}

}  // namespace

TEST_CASE("survey: classes and returns that are not wanted are left out and counted", "[unit]") {
  const auto points = classified_sphere();
  const auto dispositions = [&](std::vector<std::string> classes, const std::string& returns) {
    ChainSetup setup;
    setup.options.classes = std::move(classes);
    setup.options.returns = returns;
    const ChainResult r = run_chain(points, setup);
    const PointDispositions& f = r.plan.dispositions;
    CHECK(f.read == 4000);
    CHECK(f.read == f.kept + f.other_class + f.other_return + f.non_finite + f.absurd);
    CHECK(r.points.size() + r.order["duplicates"].get<std::uint64_t>() == f.kept);
    return std::array{f.other_class, f.other_return, f.kept};
  };
  using Dispositions = std::array<std::uint64_t, 3>;
  CHECK(dispositions({}, "all") == Dispositions{1000, 0, 3000});
  CHECK(dispositions({}, "last") == Dispositions{1000, 1000, 2000});
  CHECK(dispositions({"2"}, "all") == Dispositions{3000, 0, 1000});
  CHECK(dispositions({"5", "7"}, "first") == Dispositions{1000, 1000, 2000});
  CHECK(survey(points).multi_return_fraction == Approx(2000.0 / 3000.0));
  CHECK(survey(sphere_points(2000, 50.0, {0, 0, 0})).multi_return_fraction == 0.0);
  auto meaningless = points;  // as some exporters write it
  for (TestPoint& p : meaningless) p.echo = {1, 4, 5};
  CHECK(survey(meaningless).multi_return_fraction == 0.0);
}

TEST_CASE("survey: classes and returns that no input tells, or that leave nothing, are refused", "[unit]") {
  ChainSetup setup;
  setup.options.classes = {"2", "6"};
  CHECK_THROWS_WITH(survey(sphere_points(2000, 50.0, {0, 0, 0}), setup),
                    Catch::Contains("--classes 2,6") && Catch::Contains("no input tells"));
  CHECK_NOTHROW(survey(classified_sphere(), setup));
  setup.options.classes = {"6"};
  CHECK_THROWS_WITH(survey(classified_sphere(), setup), Catch::Contains("none of the 4000 points"));
  CHECK_THROWS_WITH(measured_resolution(classified_sphere(), setup),
                    Catch::Contains("none of the 4000 points"));
  for (const char* word : {"256", "-1", "ground", "", "2 "}) {
    setup.options.classes = {word};
    CHECK_THROWS_AS(survey(classified_sphere(), setup), UsageError);
  }
  setup.options.classes = {};
  setup.options.returns = "last";
  CHECK_THROWS_WITH(survey(sphere_points(2000, 50.0, {0, 0, 0}), setup), Catch::Contains("--returns last"));
}

TEST_CASE("order: points keep what their echo says, at one place ground wins, and a last return", "[unit]") {
  auto points = sphere_points(2000, 50.0, {0, 0, 0});
  for (TestPoint& t : points) t.echo = {1, 1, 1};
  points.push_back({{200, 0, 0}, {}, 0, {5, 1, 3}});
  points.push_back({{210, 0, 0}, {}, 0, {2, 3, 3}});
  for (const std::uint8_t number : {std::uint8_t{1}, std::uint8_t{3}})
    points.push_back({{220, 0, 0}, {}, 0, {static_cast<std::uint8_t>(number == 1 ? 2 : 5), number, 3}});
  const ChainResult r = run_chain(points);
  const auto at = [&](double x) {
    for (const PointRecord& p : r.points)
      if (std::fabs(world_of(r.plan, p)[0] - x) < 0.5) return int{p.flags};
    return -1;
  };
  CHECK(at(200) == kPointNotLast);
  CHECK(at(210) == kPointGround);
  CHECK(at(220) == kPointGround);
}

TEST_CASE("survey: the plan follows from the points alone", "[property]") {
  auto points = sphere_points(20000, 120.0, {1000.5, -77.25, 3.0});
  const Plan want = survey(points);
  CHECK(want.radius_cells >= 3.0);
  ChainSetup setup;
  shuffle(points, 4);
  setup.files = GENERATE(1, 4);
  setup.slice_points = GENERATE(500, 100000);
  setup.threads = 300;
  setup.backwards = true;
  CHECK(result_of(survey(points, setup)) == result_of(want));
}

TEST_CASE("survey: buckets cover all bricks once", "[unit]") {
  ChainSetup setup;
  setup.threads = 600;  // a small share of the cap each
  const ChainResult r = run_chain(sphere_points(60000, 300.0, {0, 0, 0}), setup);
  REQUIRE(r.plan.buckets.size() > 2);
  std::uint64_t bricks = 0;
  std::uint64_t points = 0;
  for (const PlanBucket& b : r.plan.buckets) {
    CHECK(b.first_brick == bricks);
    CHECK(b.first_key == r.bricks[b.first_brick].key);
    bricks += b.bricks;
    points += b.points;
  }
  CHECK(bricks == r.bricks.size());
  CHECK(points == r.plan.points());
}

TEST_CASE("survey: UTM coordinates keep sub-millimetre precision", "[unit]") {
  ChainSetup setup;
  setup.h = 0.05;
  std::vector<TestPoint> points;
  Random random(3);
  for (int i = 0; i < 3000; ++i)
    points.push_back(
        {{4.5e6 + random.in(0, 20), 5.2e6 + random.in(0, 20), 430.0 + random.in(0, 0.1)}, {}, 0});
  const ChainResult r = run_chain(points, setup);
  REQUIRE(r.points.size() == points.size());
  double worst = 0.0;
  std::vector<Double3> got;
  for (const PointRecord& p : r.points) got.push_back(world_of(r.plan, p));
  std::vector<Double3> want;
  for (const TestPoint& p : points) want.push_back(p.p);
  std::sort(got.begin(), got.end());
  std::sort(want.begin(), want.end());
  for (std::size_t i = 0; i < got.size(); ++i) worst = std::max(worst, std::fabs(got[i][0] - want[i][0]));
  CHECK(worst <= 0.05 / 1024 / 2 + 1e-9);
}

TEST_CASE("survey: what cannot be a surface is refused", "[unit]") {
  CHECK_THROWS_AS(survey({}), EmptyError);
  CHECK_THROWS_AS(survey({TestPoint{{1, 2, 3}, {}, 0}}), EmptyError);
  CHECK_THROWS_AS(survey({TestPoint{{1, 2, 3}, {}, 0}, TestPoint{{2, 2, 3}, {}, 0}}), EmptyError);
  CHECK_THROWS_AS(survey(std::vector<TestPoint>(100, TestPoint{{1, 2, 3}, {}, 0})), InputError);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(survey(std::vector<TestPoint>(5, TestPoint{{nan, 2, 3}, {}, 0})), EmptyError);
  ChainSetup setup;
  setup.h = 1e-6;
  CHECK_THROWS_WITH(survey(sphere_points(1000, 10.0, {0, 0, 0}), setup), Catch::Contains("--resolution"));
  setup.h = -1.0;
  CHECK_THROWS_AS(survey(sphere_points(1000, 10.0, {0, 0, 0}), setup), UsageError);
  setup.h = 1.0;
  setup.options.radius = 5.0;
  CHECK_THROWS_AS(survey(sphere_points(1000, 10.0, {0, 0, 0}), setup), UsageError);
}

TEST_CASE("survey: one point per brick", "[property]") {
  Random random(8);
  std::vector<TestPoint> points;
  for (int i = 0; i < 5000; ++i)
    points.push_back({{random.in(0, 20000), random.in(0, 20000), random.in(0, 20000)}, {}, 0});
  const ChainResult r = run_chain(points);
  CHECK(r.plan.bricks > 4900);
  CHECK(r.points.size() == points.size());
  CHECK_FALSE(r.plan.warnings.empty());
}

TEST_CASE("survey: spacing and noise of a random plane", "[unit]") {
  // Density 1: the spacing of a uniform random sample is 1.
  const Plan exact = survey(random_plane(40000, 200.0, 0.0), at_resolution(1.5));
  CHECK(exact.spacing == Approx(1.0).epsilon(0.15));
  CHECK(exact.noise_cells < 1e-3);
  CHECK(exact.radius_cells == 3.0);
  CHECK(exact.warnings.empty());
  const Plan noisy = survey(random_plane(40000, 200.0, 0.5), at_resolution(1.5));
  CHECK(noisy.noise_cells * 1.5 == Approx(0.5).epsilon(0.15));
  const Plan fine = survey(random_plane(40000, 200.0, 0.0), at_resolution(0.7));
  CHECK_FALSE(fine.warnings.empty());
  CHECK(fine.radius_cells > 3.5);
}

TEST_CASE("survey: the noise of points in rings, too few within reach of a cell, is that of the spacing pass",
          "[unit]") {
  Random random(5);
  std::vector<TestPoint> points;
  for (int ring = 0; ring < 40; ++ring)
    for (int i = 0; i < 70; ++i) {
      const double a = 6.283185307179586 * i / 70, r = 22.0 + random.in(-1, 1);
      points.push_back({{r * std::cos(a), r * std::sin(a), 5.0 * ring}, {0, 0, 1}, 0});
    }
  const TempFolder work;
  ChainSetup setup;
  setup.h = 0.0;
  const JobState job = chain_job(work.path(), setup);
  const auto inputs = chain_inputs(points, setup);
  run_stage(*make_probe_stage(job, inputs), job.work, false);
  run_stage(*make_spacing_stage(job, inputs), job.work, false);
  const double h = chosen_resolution(job.work).h;
  run_stage(SurveyStage(job, inputs, h, points.size()), job.work, false);
  const Plan plan = Plan::of_work(job.work);
  CHECK(plan.noise_cells == probed_noise(job.work) / h);
  CHECK(plan.noise_cells * h == Approx(0.58).epsilon(0.3));
  CHECK(plan.is_sparse());
  Plan dense = plan;
  dense.spacing = 0.9 * h;
  CHECK_FALSE(dense.is_sparse());
  Plan exact = plan;
  exact.noise_cells = 0.01;
  CHECK_FALSE(exact.is_sparse());
  Plan many = plan;
  many.dispositions.kept = 20'000;
  CHECK_FALSE(many.is_sparse());
}

TEST_CASE("resolution: one and a half spacings, whatever the order", "[property]") {
  auto points = random_plane(60000, 100.0, 0.0);  // spacing 0.41
  const double h = measured_resolution(points);
  CHECK(h > 1.3 * 0.408);
  CHECK(h < 1.8 * 0.408);
  shuffle(points, 5);
  ChainSetup setup;
  setup.files = 3;
  setup.slice_points = 4000;
  CHECK(measured_resolution(points, setup) == h);

  std::vector<TestPoint> grid;
  for (int i = 0; i < 300; ++i)
    for (int j = 0; j < 300; ++j) grid.push_back({{0.25 * i, 0.25 * j, 0.0}, {}, 0});
  CHECK(measured_resolution(grid) == Approx(0.375).epsilon(0.05));
}

TEST_CASE("resolution: the densest quarter decides where most of the rest closes, else the rest", "[unit]") {
  // A plane of 40 x 40 in four quarters; spacing of each, and h against three times the least.
  const auto quarters = [](const std::array<double, 4>& spacing) {
    Random random(9);
    std::vector<TestPoint> points;
    for (std::size_t q = 0; q < 4; ++q)
      for (double left = 400.0 / (spacing[q] * spacing[q]); left > 0; --left)
        points.push_back(
            {{random.in(0, 20) + (q % 2 == 0 ? 0.0 : 20.0), random.in(0, 20) + (q < 2 ? 0.0 : 20.0), 0.0},
             {0, 0, 1},
             0});
    return points;
  };
  const auto reason = [](const std::vector<TestPoint>& points) {
    const TempFolder work;
    ChainSetup setup;
    setup.h = 0.0;
    const JobState job = chain_job(work.path(), setup);
    const auto inputs = chain_inputs(points, setup);
    run_stage(*make_probe_stage(job, inputs), job.work);
    run_stage(*make_spacing_stage(job, inputs), job.work);
    const ChosenSpacing chosen = chosen_resolution(job.work);
    const SurveyStage survey(job, inputs, chosen.h, true);
    run_stage(survey, job.work);
    CHECK(Plan::of_work(job.work).warnings.empty());
    CHECK(Plan::of_work(job.work).resolution_reason == chosen.reason);
    return chosen;
  };
  const ChosenSpacing even = reason(quarters({0.2, 0.2, 0.2, 0.2}));
  CHECK(even.h == Approx(0.33).epsilon(0.1));
  CHECK_THAT(even.reason, Catch::StartsWith("1.5 times the spacing"));
  const ChosenSpacing dense = reason(quarters({0.1, 0.1, 0.2, 0.3}));
  CHECK(dense.h == Approx(0.28).epsilon(0.2));
  CHECK_THAT(dense.reason, Catch::StartsWith("3 times the spacing"));
  const ChosenSpacing sparse = reason(quarters({0.05, 0.6, 0.6, 0.6}));
  CHECK(sparse.h == Approx(0.27).epsilon(0.2));
  CHECK_THAT(sparse.reason, Catch::StartsWith("half the spacing"));
}

TEST_CASE("survey: a resolution far above the spacing is no cause for a warning", "[unit]") {
  const Plan plan = survey(random_plane(60000, 20.0, 0.0), at_resolution(1.5));  // 340 points a cell
  CHECK(plan.warnings.empty());
  CHECK(plan.spacing < 0.15);
}

TEST_CASE("resolution: outliers and few points do not mislead it", "[unit]") {
  auto points = random_plane(60000, 100.0, 0.0);
  Random random(6);
  for (int i = 0; i < 600; ++i)
    points.push_back({{random.in(-500, 500), random.in(-500, 500), random.in(-500, 500)}, {}, 0});
  points.push_back({{1e12, 0, 0}, {}, 0});
  const double h = measured_resolution(points);
  CHECK(h > 1.3 * 0.408);
  CHECK(h < 2.0 * 0.408);

  std::vector<TestPoint> few;
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 5; ++j) few.push_back({{1.0 * i, 1.0 * j, 0.1 * i * j}, {}, 0});
  const double small = measured_resolution(few);
  CHECK(small > 0.7);  // half the spacing: few points show a whole object
  CHECK(small < 5.0);
  CHECK_THROWS_AS(measured_resolution(std::vector<TestPoint>(9, few[0])), InputError);
}

TEST_CASE("resolution: strewn points do not coarsen it, few or many, near or in a box many times as wide",
          "[unit]") {
  Random random(4);
  std::vector<TestPoint> ground;
  for (int i = 0; i < 150; ++i)
    for (int j = 0; j < 150; ++j)
      ground.push_back(
          {{0.3 * i, 0.3 * j, std::sin(0.05 * i) + std::cos(0.04 * j) + random.in(-0.03, 0.03)}, {}, 0});
  const double clean = measured_resolution(ground);
  CHECK(clean == Approx(0.46).epsilon(0.05));
  const auto with_outliers = [&](double share, double wide, double high) {
    std::vector<TestPoint> points = ground;
    const double middle = 22.5;
    const auto count = static_cast<int>(share / (1.0 - share) * static_cast<double>(ground.size()));
    for (int k = 0; k < count; ++k)
      points.push_back({{random.in(middle - wide, middle + wide), random.in(middle - wide, middle + wide),
                         random.in(-high, high)},
                        {},
                        0});
    CAPTURE(share, wide, high);
    CHECK(measured_resolution(points) == Approx(clean).epsilon(0.16));
  };
  for (const double share : {0.003, 0.01, 0.03, 0.1, 0.2}) {
    for (const double high : {20.0, 8.0, 4.0, 3.0}) with_outliers(share, 22.5, high);
    with_outliers(share, 400.0, 400.0);
  }
  with_outliers(0.2, 22.5, 2.5);
  with_outliers(0.2, 30.0, 6.0);
  // Close over and under the ground, where they look like a surface of fewer points.
  for (const double share : {0.03, 0.05, 0.1, 0.2})
    for (const double close : {0.6, 1.0, 1.5, 2.0, 3.0}) {
      std::vector<TestPoint> points = ground;
      const auto count = static_cast<int>(share / (1.0 - share) * static_cast<double>(ground.size()));
      for (int k = 0; k < count; ++k) {
        TestPoint p = ground[random.below(ground.size())];
        for (const std::size_t a : {0, 1}) p.p[a] += random.in(-0.2, 0.2);
        p.p[2] += random.in(-close, close);
        points.push_back(p);
      }
      CAPTURE(share, close);
      CHECK(measured_resolution(points) == Approx(clean).epsilon(0.17));
    }
}

TEST_CASE("survey: the agreement of given normals is measured, whatever the order", "[property]") {
  const auto agreement = [](const std::vector<TestPoint>& points, const ChainSetup& setup = {}) {
    const TempFolder work;
    const JobState job = chain_job(work.path(), setup);
    run_stage(SurveyStage(job, chain_inputs(points, setup), setup.h, 0), job.work, setup.backwards);
    return agreement_of_work(job.work);
  };
  auto points = random_plane(20000, 100.0, 0.02);
  CHECK(agreement(points).pairs > 10000);
  CHECK(agreement(points).against == 0);
  CHECK(agreement(points).split == 0);
  for (TestPoint& t : points)
    if (t.p[0] < 40.0) t.n = {0, 0, -1};
  CHECK(agreement(points).split > 2);
  for (std::size_t i = 0; i < points.size(); i += 12) points[i].n = -points[i].n;
  const NormalAgreement before = agreement(points);
  CHECK(before.share() > 0.03);
  shuffle(points, 3);
  ChainSetup setup;
  setup.files = 3;
  const NormalAgreement after = agreement(points, setup);
  CHECK(fields_to_json(after) == fields_to_json(before));
}

TEST_CASE("resolution: two decimal digits, never below", "[unit]") {
  CHECK(round_up_2_digits(0.7841) == 0.79);
  CHECK(round_up_2_digits(0.00079) == 0.00079);
  CHECK(round_up_2_digits(123.4) == 130.0);
  CHECK(round_up_2_digits(2.01) == 2.1);
  CHECK(round_up_2_digits(10.0) == 10.0);
}

TEST_CASE("brick counter: spilled runs add up", "[unit]") {
  const TempFolder folder;
  BrickCounter counter(folder.path() / "counts", 100);
  Random random(1);
  for (int i = 0; i < 20000; ++i)
    counter.add(
        {8 * (static_cast<std::int64_t>(random.bits() % 300) - 150) + 3, -7 * 8 + i % 4, 8 * (i % 2)});
  counter.finish();
  const auto all = merge_brick_counts({folder.path() / "counts", folder.path() / "counts"}, 10000);
  std::uint64_t points = 0;
  for (const BrickCount& b : all) {
    points += b.points;
    // i % 4 is i % 2 or that and two more
    CHECK(b.blocks[0] == (b.brick[2] == 0 ? 0x080008ULL : 0x08000800ULL));
  }
  CHECK(all.size() == 600);
  CHECK(points == 40000);
  CHECK(
      std::is_sorted(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.brick < b.brick; }));
  CHECK_THROWS_AS(merge_brick_counts({folder.path() / "counts"}, 500), ResourceError);
}

TEST_CASE("brick counter: a table that grows loses nothing", "[unit]") {
  const TempFolder folder;
  BrickCounter counter(folder.path() / "counts", 5000);
  for (int round = 0; round < 2; ++round)
    for (std::int64_t i = 0; i < 4000; ++i) counter.add({8 * (i % 63), 8 * (i / 63), 0});
  counter.finish();
  const auto all = merge_brick_counts({folder.path() / "counts"}, 10000);
  CHECK(all.size() == 4000);
  CHECK(std::all_of(all.begin(), all.end(), [](const BrickCount& b) { return b.points == 2; }));
}

TEST_CASE("point inputs: sixteen tasks share what is no more than sixteen large ones read", "[unit]") {
  const TempFolder folder;
  const auto tasks_of = [&](std::uint64_t points) {
    const auto path = folder.path() / "scan.ply";
    std::ofstream(path)
        << "ply\nformat binary_little_endian 1.0\nelement vertex " << points
        << "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar grey\nend_header\n";
    std::filesystem::resize_file(path, std::filesystem::file_size(path) + 13 * points);
    std::vector<std::unique_ptr<PointFile>> files;
    files.push_back(open_point_file(path, {}));
    return PointInputs(std::move(files), {}).task_count();
  };
  CHECK(tasks_of(300'000) == 1);  // 4 MiB a task at least
  CHECK(tasks_of(1'700'000) == 6);
  CHECK(tasks_of(14'000'000) == 16);  // 174 MiB
  CHECK(tasks_of(14'000'007) == 16);  // slices end with a whole record
}

TEST_CASE("robust window: keeps a far part of the scan, drops a far speck", "[unit]") {
  std::vector<BrickCount> bricks;
  for (std::int64_t i = 0; i < 10; ++i) bricks.push_back({{i, 0, 0}, 1000});
  bricks.push_back({{5000, 0, 0}, 3});  // within 1000 extents
  BrickWindow w = robust_window(bricks, 1.0);
  CHECK(w.dropped_points == 0);
  CHECK(w.max[0] == 5000);
  bricks.push_back({{-40000, 0, 0}, 2});  // beyond
  w = robust_window(bricks, 1.0);
  CHECK(w.dropped_points == 2);
  CHECK(w.min[0] == 0);
  bricks.push_back({{-9900, 0, 0}, 2});  // within, but the lattice ends: a speck gives way
  bricks.push_back({{9900, 0, 0}, 2});
  w = robust_window(bricks, 1.0);
  CHECK(w.max[0] == 5000);
  CHECK(w.dropped_points == 6);
  bricks.back().points = 500;  // no speck
  CHECK_THROWS_AS(robust_window(bricks, 1.0), InputError);
}

}  // namespace survey_test
