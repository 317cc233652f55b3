// How much of a scan is in a mesh: both figures against counting, and the same whatever the cut into tasks and files.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include "stream/files/json.h"
#include "stream/stages/coverage/coverage_stage.h"
#include "stream/stages/coverage/missing_picture.h"
#include "stream/stages/coverage/seen_stages.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random.h"

namespace coverage_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr double kStep = 0.75;  // between points of the ground, scan units; h is 1
constexpr double kWidth = 126.0;

/// Level ground, a cloud that lies on no surface above it, a few points apart from all.
std::vector<TestPoint> ground_and_cloud() {
  std::vector<TestPoint> points;
  for (double y = 0.0; y < kWidth; y += kStep)
    for (double x = 0.0; x < kWidth; x += kStep) points.push_back({{x + 0.01, y + 0.01, 0.3}, {0, 0, 1}});
  Random random(9);
  for (int i = 0; i < 4000; ++i)
    points.push_back({{random.in(20.0, 60.0), random.in(20.0, 60.0), random.in(10.0, 50.0)}, {0, 0, 1}});
  return points;
}

/// A rectangle of level faces in parts: [0, right] by [0, top], in strips of two faces.
class Rectangle : public FaceSource {
 public:
  Rectangle(const Lattice& lattice, double right, double top, std::size_t strips, std::size_t tasks)
      : lattice_(lattice), right_(right), top_(top), strips_(strips), tasks_(tasks) {}
  std::size_t task_count() const override { return tasks_; }
  std::uint64_t task_bytes(std::size_t) const override { return 1 << 20; }
  std::uint64_t face_count() const override { return 2 * strips_; }
  void read(std::size_t task, const std::function<void(const PlacedFaces&)>& use) const override {
    for (std::size_t s = task; s < strips_; s += tasks_) {
      const double low = top_ * static_cast<double>(s) / static_cast<double>(strips_);
      const double high = top_ * static_cast<double>(s + 1) / static_cast<double>(strips_);
      PlacedFaces out;
      for (const auto& [x, y] : {std::pair{0.0, low}, {right_, low}, {right_, high}, {0.0, high}}) {
        const Double3 world = {x, y, 0.3};
        Double3 at{};
        for (std::size_t a = 0; a < 3; ++a)
          at[a] = world[a] / lattice_.h - static_cast<double>(lattice_.origin_brick[a] * kBrickCells);
        out.position.push_back(at);
      }
      out.faces = {{0, 1, 2}, {0, 2, 3}};
      use(out);
    }
  }

 private:
  Lattice lattice_;
  double right_, top_;
  std::size_t strips_, tasks_;
};

struct Measured {
  Json coverage;
  Plan plan;
  std::string picture;
};

Measured measure(const std::vector<TestPoint>& points, const ChainSetup& setup, double right, double top,
                 std::size_t strips, std::size_t tasks) {
  const TempFolder work;
  const JobState job = chain_job(work.path(), setup);
  const auto inputs = chain_inputs(points, setup);
  run_stage(SurveyStage(job, inputs, setup.h, 0), job.work, setup.backwards);
  run_stage(DistributeStage(job, inputs), job.work, setup.backwards);
  run_stage(OrderStage(job), job.work, setup.backwards);
  run_stage(*make_seen_spacing_stage(job), job.work, setup.backwards);
  run_stage(*make_seen_stage(job), job.work, setup.backwards);
  Measured m;
  m.plan = Plan::of_work(job.work);
  // What is left is enough: the points go.
  std::filesystem::remove_all(job.work / kScanPointFolder);
  const auto stage = make_coverage_stage(job, [&](const JobState&) {
    return std::make_unique<Rectangle>(m.plan.lattice, right, top, strips, tasks);
  });
  m.coverage = run_stage(*stage, job.work, setup.backwards);
  const std::filesystem::path picture = missing_picture_path(job.output);
  if (std::filesystem::exists(picture)) m.picture = file_bytes(picture);
  return m;
}

}  // namespace

TEST_CASE("coverage: both figures are what counting says, strewn points in neither", "[unit]") {
  const std::vector<TestPoint> points = ground_and_cloud();
  const double right = 84.0;
  const Measured m = measure(points, {}, right, kWidth, 7, 3);
  const Json& c = m.coverage;
  CAPTURE(dump_json(c));
  CHECK(c.at("spacing").get<double>() == Approx(kStep).epsilon(0.002));
  CHECK(c.at("one_in") == 1);
  // Points of the ground whose neighbours lie all around them; those beyond the faces by more than two spacings are missing.
  const auto rows = std::llround(kWidth / kStep);
  const auto confirmed = c.at("points").get<std::int64_t>();
  CHECK(confirmed < rows * rows);
  CHECK(confirmed >= (rows - 4) * (rows - 4));
  const auto beyond = static_cast<double>(c.at("points_missing").get<std::int64_t>());
  CHECK(beyond / static_cast<double>(rows) ==
        Approx((kWidth - right) / kStep - c.at("distance").get<double>() / kStep).margin(3.0));
  CHECK(c.at("confirmed").get<double>() == Approx(1.0 - beyond / static_cast<double>(confirmed)));
  // Columns by counting the points of each.
  const double edge = c.at("column_edge").get<double>();
  CHECK(edge == Approx(4.0 * c.at("spacing").get<double>()).epsilon(0.001));
  std::map<std::pair<int, int>, int> columns;
  const auto corner = [&](std::size_t a) { return m.plan.lattice.world(static_cast<int>(a), 0.0); };
  for (const TestPoint& p : points)
    ++columns[{static_cast<int>(std::floor((p.p[0] - corner(0)) / edge)),
               static_cast<int>(std::floor((p.p[1] - corner(1)) / edge))}];
  std::int64_t filled = 0, bare = 0;
  for (const auto& [at, count] : columns)
    if (count >= 4) ++filled, bare += corner(0) + (at.first + 0.5) * edge > right;
  CHECK(std::fabs(static_cast<double>(c.at("columns").get<std::int64_t>() - filled)) <
        0.004 * static_cast<double>(filled));
  // The columns of the last corners are covered whatever their middle is.
  CHECK(std::fabs(static_cast<double>(c.at("columns_missing").get<std::int64_t>() - bare)) < 60.0);
  CHECK(c.at("plan").get<double>() == Approx(right / kWidth).margin(0.03));  // a column is a 43rd
  CHECK(c.at("picture") == true);
  CHECK(m.picture.size() > 100);
}

TEST_CASE("coverage: the same figures and picture for any order, files, tasks, caps and parts of the mesh",
          "[unit]") {
  auto points = ground_and_cloud();
  const Measured want = measure(points, {}, 93.0, 140.0, 12, 1);
  CHECK(want.coverage.at("points_missing") > 0);
  std::reverse(points.begin(), points.end());
  std::swap(points[100], points[30000]);
  for (const auto& [files, task_points, tasks] :
       {std::tuple<std::size_t, std::size_t, std::size_t>{3, 500, 12}, {1, 20000, 5}}) {
    ChainSetup setup;
    setup.files = files;
    setup.task_points = setup.slice_points = task_points;
    setup.memory = std::uint64_t{64} << 20;
    setup.backwards = files > 1;
    const Measured got = measure(points, setup, 93.0, 140.0, 12, tasks);
    CHECK(got.coverage == want.coverage);
    CHECK(got.picture == want.picture);
  }
}

TEST_CASE("coverage: points that merge leave the spacing what it is", "[unit]") {
  auto points = ground_and_cloud();
  const Measured want = measure(points, {}, 93.0, 140.0, 12, 1);
  const std::size_t count = points.size();
  for (std::size_t i = 0; i < count; i += 2) points.push_back(points[i]);
  const Measured got = measure(points, {}, 93.0, 140.0, 12, 1);
  CHECK(got.coverage.at("spacing").get<double>() ==
        Approx(want.coverage.at("spacing").get<double>()).epsilon(0.002));
}

TEST_CASE("coverage: where nothing is missing it is all, without a picture, and one of before goes",
          "[unit]") {
  const Measured m = measure(ground_and_cloud(), {}, kWidth + 1.0, kWidth + 1.0, 4, 2);
  CHECK(m.coverage.at("plan") == 1.0);
  CHECK(m.coverage.at("confirmed") == 1.0);
  CHECK(m.coverage.at("picture") == false);
  CHECK(m.picture.empty());
}

TEST_CASE("coverage: a mesh of nothing holds nothing", "[unit]") {
  const Measured m = measure(ground_and_cloud(), {}, 1.0, 1.0, 1, 1);
  CHECK(m.coverage.at("plan").get<double>() < 0.002);
  CHECK(m.coverage.at("confirmed").get<double>() < 0.002);
}

TEST_CASE("coverage: points too far apart for the lattice are not measured", "[unit]") {
  std::vector<TestPoint> points;
  for (int i = 0; i < 400; ++i) points.push_back({{20.0 * (i % 20), 20.0 * (i / 20), 0.0}, {0, 0, 1}});
  const Measured m = measure(points, {}, 10.0, 10.0, 1, 1);
  CHECK(m.coverage == Json{{"measured", false}});
  CHECK(m.picture.empty());
}

}  // namespace coverage_test
