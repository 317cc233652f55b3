#include "stream/stages/reconstruct/forecast.h"
#include "stream/stages/smooth/untangle_stages.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <set>

#include "octree/error.h"
#include "stream/points/hot_brick.h"
#include "stream/runtime/memory_budget.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "stream/stages/surface/surface_stage.h"
#include "stream/stages/weld/patch_positions.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random_points.h"

namespace forecast_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

struct Forecasted {
  Plan plan;
  std::vector<PlanBrick> bricks;
  InputTasks inputs;
  Forecast forecast;
};

/// What is told of a surveyed job.
Forecasted tell(const JobState& job, const PointInputs& inputs) {
  Forecasted forecasted{Plan::of_work(job.work), load_plan_bricks(job.work / Plan::kBrickFile), {}, {}};
  forecasted.inputs.count = inputs.task_count();
  for (std::size_t k = 0; k < forecasted.inputs.count; ++k)
    forecasted.inputs.largest_bytes = std::max(forecasted.inputs.largest_bytes, inputs.task_input_bytes(k));
  forecasted.forecast = forecast_job(forecasted.plan, forecasted.bricks, forecasted.inputs, job);
  return forecasted;
}

struct Reserved {
  std::uint64_t task = 0, finish = 0;
};

/// Runs the whole job, stage by stage; what each asks for. \param forecasted  of it, before it runs
std::map<std::string, Reserved> run_all(const std::vector<TestPoint>& points, const ChainSetup& setup,
                                        const std::filesystem::path& work, Forecasted& forecasted) {
  JobState job = chain_job(work, setup);
  job.output = work / "mesh.ply";
  const auto inputs = chain_inputs(points, setup);
  run_stage(SurveyStage(job, inputs, setup.h, 0), job.work);
  forecasted = tell(job, *inputs);
  std::map<std::string, Reserved> reserved;
  bool after = false;
  for (const StageEntry& entry : reconstruct_stages(setup.options)) {
    if (entry.name == "distribute") after = true;
    if (!after) continue;
    const std::unique_ptr<Stage> stage =
        entry.name == "distribute" ? std::make_unique<DistributeStage>(job, inputs) : entry.make(job);
    Reserved& r = reserved[entry.name];
    for (std::size_t k = 0; k < stage->task_count(); ++k) r.task = std::max(r.task, stage->task_bytes(k));
    run_stage(*stage, job.work);
    r.finish = stage->finish_bytes();  // some look at what tasks have left
  }
  return reserved;
}

const StageForecast* find(const Forecast& forecast, const std::string& stage) {
  for (const StageForecast& f : forecast.stages)
    if (f.stage == stage) return &f;
  return nullptr;
}

std::vector<std::string> names_of(const Forecast& forecast, bool idle) {
  std::vector<std::string> names;
  for (const StageForecast& f : forecast.stages)
    if (idle || !f.is_idle()) names.push_back(f.stage);
  return names;
}

/// The stages that follow the forecast when the job runs.
std::vector<std::string> stages_of_the_run(const ReconstructOptions& options) {
  std::vector<std::string> names;
  for (const StageEntry& entry : reconstruct_stages(options)) names.push_back(entry.name);
  names.erase(names.begin(), std::find(names.begin(), names.end(), "forecast") + 1);
  return names;
}

/// Every stage of the run is told, and asks for no more. \param same  stages whose tasks ask for just that
void check_forecast(const Forecasted& forecasted, const std::map<std::string, Reserved>& reserved,
                    const std::set<std::string>& same) {
  CHECK(forecasted.forecast.stages.size() == reserved.size());
  for (const StageForecast& f : forecasted.forecast.stages) {
    INFO(f.stage);
    REQUIRE(reserved.count(f.stage) == 1);
    const Reserved& r = reserved.at(f.stage);
    CHECK(f.task_bytes >= r.task);
    CHECK(f.memory_bytes() >= r.finish);
    if (same.count(f.stage) > 0) CHECK(f.task_bytes == r.task);
    CHECK(f.sure_bytes <= f.memory_bytes());
  }
}

std::vector<TestPoint> scan_without_duplicates(std::size_t count, double radius) {
  auto points = sphere_points(count, radius, {0, 0, 0});
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.p < b.p; });
  points.erase(
      std::unique(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.p == b.p; }),
      points.end());
  return points;
}

std::uint64_t named_cap(const std::string& message) {
  const auto at = message.find("--memory ");
  REQUIRE(at != std::string::npos);
  return std::stoull(message.substr(at + 9)) * kMiB;
}

/// The forecast of a survey under any cap, as the stage composes it.
std::function<Forecast(std::uint64_t)> under(const Forecasted& forecasted, const JobState& job) {
  return [&forecasted, job](std::uint64_t cap) {
    JobState other = job;
    other.run.memory_bytes = cap;
    Plan plan = forecasted.plan;
    plan.buckets = cut_buckets(forecasted.bricks, bucket_target(other.run, plan.points()),
                               reconstruct_options(job).max_brick_points);
    return forecast_job(plan, forecasted.bricks, forecasted.inputs, other);
  };
}

/// "uncross" stands for its rounds.
std::vector<std::string> with_rounds(const std::vector<std::string>& names) {
  std::vector<std::string> all;
  for (const std::string& name : names)
    if (name == "uncross")
      for (int round = 1; round <= kUncrossRounds; ++round) all.push_back("uncross-" + std::to_string(round));
    else
      all.push_back(name);
  return all;
}

}  // namespace

TEST_CASE("forecast: disk of the passes over points is what they write", "[unit]") {
  const TempFolder work;
  ChainSetup setup;
  const auto points = sphere_points(50000, 60.0, {0, 0, 0});
  const JobState job = chain_job(work.path(), setup);
  const auto inputs = chain_inputs(points, setup);
  run_stage(SurveyStage(job, inputs, setup.h, 0), job.work);
  const Forecasted forecasted = tell(job, *inputs);
  run_stage(DistributeStage(job, inputs), job.work);
  run_stage(OrderStage(job), job.work);
  const auto written = [&](const char* folder) {
    std::uint64_t bytes = 0;
    for (const auto& f : std::filesystem::directory_iterator(job.work / folder)) bytes += f.file_size();
    return static_cast<double>(bytes);
  };
  const auto& stages = forecasted.forecast.stages;
  REQUIRE(stages.size() >= 4);
  CHECK(stages[0].stage == "distribute");
  CHECK(static_cast<double>(stages[0].disk_bytes) == Approx(written("distribute")).epsilon(0.02));
  CHECK(stages[1].stage == "order");
  // Every 17th point is a duplicate, which the forecast cannot know.
  CHECK(static_cast<double>(stages[1].disk_bytes) == Approx(written("points")).epsilon(0.08));
  CHECK(forecasted.forecast.peak_disk_bytes >= stages[0].disk_bytes + stages[1].disk_bytes);
  // A sphere of radius 60 h has about 3 x 4 pi 60^2 triangles.
  CHECK(static_cast<double>(forecasted.plan.faces_estimate) == Approx(3 * 4 * 3.14159 * 3600).epsilon(0.25));
}

TEST_CASE("forecast: what it tells of memory is what the stages reserve", "[unit]") {
  const TempFolder work;
  ChainSetup setup;
  const auto points = scan_without_duplicates(60000, 90.0);
  setup.task_points = setup.slice_points = 20000;
  std::set<std::string> same = {"distribute", "seen", "normals", "surface"};
  std::vector<std::string> names = {"distribute", "order", "seen-spacing",  "seen",     "normals",
                                    "surface",    "weld",  "border",        "blunt",    "uncross",
                                    "loops",      "holes", "uncross-holes", "coverage", "write"};
  SECTION("given normals") {}
  SECTION("tiles that the cap cuts") {
    setup.memory = 160 * kMiB;
  }
  SECTION("estimated normals, holes filled") {
    setup.options.normals = "estimate";
    setup.options.max_hole = "100";
    names = {"distribute", "order",   "seen-spacing", "seen",    "normals",  "links",
             "orient",     "top",     "top-points",   "surface", "weld",     "border",
             "blunt",      "uncross", "loops",        "holes",   "coverage", "write"};
  }
  SECTION("the bare ground") {
    setup.options.normals = "estimate";
    setup.options.from = "above";
    setup.options.surface = "ground";
    same.erase("surface");  // there are fewer points by then
    names = {"distribute",   "order",   "seen-spacing", "seen",       "normals",       "links",    "orient",
             "ground-cells", "ground",  "top",          "top-points", "surface",       "weld",     "border",
             "blunt",        "uncross", "loops",        "holes",      "uncross-holes", "coverage", "write"};
  }
  SECTION("decimated") {
    setup.options.tolerance = 0.1;
    names = {"distribute", "order",     "seen-spacing", "seen",    "normals",  "surface",
             "sides-1",    "sides-2",   "sides-3",      "islands", "prune",    "pass-2",
             "pass-3",     "crossings", "mend",         "certify", "coverage", "write"};
  }
  SECTION("smoothed and decimated") {
    setup.options.tolerance = 0.1;
    setup.options.smooth = "auto";
    names = {"distribute", "order",   "seen-spacing", "seen",  "normals", "surface",  "sides-1", "sides-2",
             "sides-3",    "islands", "prune",        "reach", "noise",   "smooth-1", "smooth-2"};
    for (int round = 1; round <= kUntangleRounds; ++round)
      names.push_back("untangle-" + std::to_string(round));
    for (const char* name : {"untangle", "noise-left", "pass-1", "pass-2", "pass-3", "crossings", "mend",
                             "certify", "coverage", "write"})
      names.emplace_back(name);
  }
  SECTION("decimated against the points, the surface kept: by way of a mesh") {
    setup.options.tolerance = 0.5;
    setup.options.reference = "points";
    setup.options.keep_raw = true;
    names = {"distribute",    "order",   "seen-spacing", "seen",          "normals",      "surface",
             "weld",          "border",  "blunt",        "uncross",       "loops",        "holes",
             "uncross-holes", "raw",     "mesh-read",    "mesh-vertices", "mesh-corners", "mesh-tiles",
             "points",        "pass-1",  "pass-2",       "pass-3",        "crossings",    "mend",
             "certify",       "samples", "coverage",     "keep-raw",      "write"};
  }
  Forecasted forecasted;
  const auto reserved = run_all(points, setup, work.path(), forecasted);
  check_forecast(forecasted, reserved, same);
  CHECK(names_of(forecasted.forecast, false) == with_rounds(names));
  CHECK(names_of(forecasted.forecast, true) == stages_of_the_run(setup.options));
  // Minutes of work come before these: what they may need is asked for by then.
  for (const StageForecast& f : forecasted.forecast.stages)
    if (f.stage == "links" || f.stage == "orient") CHECK((f.is_idle() || f.sure_bytes == f.memory_bytes()));
}

TEST_CASE("forecast: points that merge, hot bricks and noise stay below what is told", "[unit]") {
  const TempFolder work;
  ChainSetup setup;
  auto points = sphere_points(60000, 50.0, {0, 0, 0});
  SECTION("a hot brick, thinned") {
    const auto more = sphere_points(30000, 4.0, {20, 20, 20}, 2);
    points.insert(points.end(), more.begin(), more.end());
    setup.options.max_brick_points = 12000;
  }
  SECTION("noise and strays, signs by propagation") {
    Random random(5);
    for (TestPoint& p : points)
      for (double& c : p.p) c += random.in(-1.0, 1.0);
    for (int i = 0; i < 3000; ++i)
      points.push_back({{random.in(-90, 90), random.in(-90, 90), random.in(-90, 90)}, {}, 0});
    setup.options.normals = "estimate";
    setup.options.tolerance = GENERATE(0.0, 0.3);
  }
  Forecasted forecasted;
  check_forecast(forecasted, run_all(points, setup, work.path(), forecasted), {});
}

TEST_CASE("forecast: closing and decimation have their stages, with the disk that they take", "[unit]") {
  const TempFolder work;
  ChainSetup setup;
  setup.options.holes = "close";
  setup.options.tolerance = 0.1;
  auto points = scan_without_duplicates(50000, 60.0);
  std::erase_if(points, [](const TestPoint& p) { return p.p[2] > 50.0; });
  setup.options.normals = "given";
  Forecasted forecasted;
  const auto reserved = run_all(points, setup, work.path(), forecasted);
  for (const StageForecast& f : forecasted.forecast.stages) {
    INFO(f.stage);
    if (f.stage != "surface") CHECK(f.task_bytes >= reserved.at(f.stage).task);
  }
  CHECK(names_of(forecasted.forecast, true) == stages_of_the_run(setup.options));
  CHECK(names_of(forecasted.forecast, false) ==
        std::vector<std::string>{
            "distribute", "order",   "seen-spacing", "seen",    "normals", "multipole", "rims",
            "close",      "surface", "sides-1",      "sides-2", "sides-3", "islands",   "prune",
            "pass-2",     "pass-3",  "crossings",    "mend",    "certify", "coverage",  "write"});
  for (const char* stage : {"normals", "multipole", "rims"})
    CHECK(find(forecasted.forecast, stage)->task_bytes == reserved.at(stage).task);
  CHECK(find(forecasted.forecast, "close")->memory_bytes() >= reserved.at("close").finish);
  // The surface's own cells close the hole, which no plan can know.
  CHECK(find(forecasted.forecast, "surface")->sure_bytes <= reserved.at("surface").task);
  const auto written = [&](const char* folder) {
    std::uint64_t bytes = 0;
    for (const auto& f : std::filesystem::directory_iterator(work.path() / folder)) bytes += f.file_size();
    return static_cast<double>(bytes);
  };
  CHECK(static_cast<double>(find(forecasted.forecast, "multipole")->disk_bytes) ==
        Approx(written("multipole")).epsilon(0.3));
}

TEST_CASE("forecast: a hot brick of 4.19 million points is told with what normals take", "[unit]") {
  const TempFolder work;
  ChainSetup setup;
  setup.options.normals = "estimate";
  JobState job = chain_job(work.path(), setup);
  Plan plan;
  const std::vector<PlanBrick> bricks = {{brick_key({1, 1, 1}), (std::uint64_t{1} << 22) + 1, 512}};
  plan.dispositions.kept = bricks[0].points;
  plan.bricks = 1;
  plan.buckets = cut_buckets(bricks, 1 << 20, reconstruct_options(job).max_brick_points);
  const Forecast forecast = forecast_job(plan, bricks, {4, 32 * kMiB}, job);
  CHECK(find(forecast, "normals")->task_bytes == (std::uint64_t{1} << 22) * 201 + 12 * kMiB);
  CHECK(find(forecast, "order")->task_bytes >= HotBrick::bytes(std::uint64_t{1} << 22, 0));
  job.run.memory_bytes = 700 * kMiB;
  CHECK_THROWS_WITH(require_resources(forecast, job, 0, [&](std::uint64_t) { return forecast; }),
                    Catch::Contains("stage normals"));
}

TEST_CASE("forecast: a small cap has dense bricks computed in parts instead of being refused", "[unit]") {
  const TempFolder work;
  ChainSetup setup;
  setup.options.normals = "estimate";
  JobState job = chain_job(work.path(), setup);
  job.run.threads = 1;
  Plan plan;
  std::vector<PlanBrick> bricks;  // a street: many points a brick, all on one floor
  for (int y = 1; y < 6; ++y)
    for (int x = 1; x < 6; ++x) bricks.push_back({brick_key({x, y, 1}), 400'000, 64});
  std::sort(bricks.begin(), bricks.end(), [](const auto& a, const auto& b) { return a.key < b.key; });
  plan.dispositions.kept = bricks.size() * 400'000;
  plan.bricks = bricks.size();
  plan.buckets = cut_buckets(bricks, 1 << 20, reconstruct_options(job).max_brick_points);
  const auto surface = [&](std::uint64_t cap) {
    job.run.memory_bytes = cap;
    return find(forecast_job(plan, bricks, {4, 32 * kMiB}, job), "surface")->task_bytes;
  };
  CHECK(surface(4096 * kMiB) > 300 * kMiB);
  CHECK(surface(256 * kMiB) < 160 * kMiB);
  CHECK(surface(128 * kMiB) < 100 * kMiB);
}

TEST_CASE("forecast: a surface takes longer the noisier it is, and not where crowns are the noise",
          "[unit]") {
  Plan plan;
  RunOptions run;
  PlannedScan scan{plan, run, {}, {}, {}};
  const auto time = [&](double noise) {
    plan.noise_cells = noise;
    return surface_face_time(scan);
  };
  CHECK(time(0.0) < time(0.02));
  CHECK(time(0.02) < time(0.1));
  CHECK(time(0.1) < time(0.2));
  CHECK(time(0.2) == time(0.9));
  const double noisy = time(0.2);
  scan.columns.emplace();  // a surface model may stand in for what is strewn
  for (int i = 0; i < 100; ++i) scan.columns->points[{i, 0}] = 1;
  scan.columns->gapped_share = 0.8;  // but not in rooms, which take less
  const double room = time(0.2);
  CHECK(room < noisy);
  CHECK(time(0.4) == room);
  scan.columns->gapped_share = 0.0;
  CHECK(time(0.02) > time(0.0));
  CHECK(time(0.4) < noisy);
  CHECK(time(0.9) < time(0.4));
  CHECK(time(0.9) > time(0.0));
}

TEST_CASE("forecast: rooms have no surface model, open scenes are oriented in blocks", "[unit]") {
  const auto forecast_of = [](const std::vector<TestPoint>& points) {
    const TempFolder work;
    ChainSetup setup;
    setup.h = 1.0;
    setup.options.normals = "estimate";
    JobState job = chain_job(work.path(), setup);
    job.output = work.path() / "mesh.ply";
    const auto inputs = chain_inputs(points, setup);
    run_stage(SurveyStage(job, inputs, setup.h, 0), job.work);
    return tell(job, *inputs).forecast;
  };
  std::vector<TestPoint> ground, room;
  for (int i = 0; i < 12 * 32; ++i)
    for (int j = 0; j < 12 * 32; ++j) {
      TestPoint p;
      p.p = {2.0 * i, 2.0 * j, 0.0};
      ground.push_back(p), room.push_back(p);
      p.p[2] = 300.0;
      room.push_back(p);
    }
  const Forecast open = forecast_of(ground), closed = forecast_of(room);
  CHECK(find(open, "top")->seconds > 0.0);
  CHECK(find(closed, "top")->seconds == 0.0);
  CHECK(find(closed, "top")->task_bytes > 0);
  CHECK(find(closed, "top-points")->seconds == 0.0);
}

TEST_CASE("forecast: too small a cap is refused once, with the smallest that would do", "[unit]") {
  const TempFolder work;
  ChainSetup setup;
  bool dense = false;
  SECTION("ends of stages that do not depend on points") {}
  SECTION("a dense brick") {
    setup.h = 8.0;
    dense = true;
    setup.slice_points = setup.task_points = 100000;
  }
  SECTION("decimated") {
    setup.options.tolerance = 0.1;
  }
  JobState job = chain_job(work.path(), setup);
  const auto inputs = chain_inputs(sphere_points(dense ? 400000 : 60000, 100.0, {256, 256, 256}), setup);
  run_stage(SurveyStage(job, inputs, setup.h, 0), job.work);
  const Forecasted forecasted = tell(job, *inputs);
  const std::uint64_t base = 20 * kMiB;
  const auto at_cap = under(forecasted, job);
  const auto refuse = [&](std::uint64_t cap) {
    job.run.memory_bytes = cap;
    try {
      require_resources(at_cap(cap), job, base, at_cap);
    } catch (const ResourceError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const std::uint64_t named = named_cap(refuse(30 * kMiB));
  for (const std::uint64_t cap : {40, 50, 60}) CHECK(named_cap(refuse(cap * kMiB)) == named);
  CHECK(refuse(named).empty());
  // The stages themselves: they fit the named cap, and do not fit less.
  std::uint64_t maximum = 0;
  for (const StageForecast& f : at_cap(named).stages) maximum = std::max(maximum, f.memory_bytes());
  CHECK_NOTHROW(MemoryBudget(named, base).require(maximum, "a stage"));
  if (!dense) return;             // else what is estimated may ask for more than what is sure
  std::uint64_t minimum = named;  // to the byte
  while (MemoryBudget(minimum - 1, base).capacity() >= maximum) --minimum;
  CHECK(minimum > named - kMiB);
  CHECK(refuse(minimum).empty());
  CHECK(named_cap(refuse(minimum - 1)) == named);
}

TEST_CASE("forecast: what cap or disk cannot carry is refused with the smallest that would", "[unit]") {
  const TempFolder work;
  const JobState job = chain_job(work.path(), {});
  Forecast forecast;
  const auto same = [&](std::uint64_t) { return forecast; };
  CHECK_NOTHROW(require_resources(forecast, job, 0, same));
  forecast.stages.push_back({"normals", 1, std::uint64_t{3} << 30, 0, std::uint64_t{3} << 30});
  CHECK_THROWS_WITH(require_resources(forecast, job, 0, same),
                    Catch::Contains("stage normals") && Catch::Contains("--memory 3"));
  forecast.stages.clear();
  forecast.peak_disk_bytes = std::uint64_t{1} << 60;
  CHECK_THROWS_WITH(require_resources(forecast, job, 0, same), Catch::Contains("--temp"));
  CHECK_THROWS_AS(require_resources(forecast, job, 0, same), ResourceError);
}

}  // namespace forecast_test
