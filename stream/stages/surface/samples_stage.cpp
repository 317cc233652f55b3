#include "stream/stages/surface/samples_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "kernels/certify/certificate.h"
#include "kernels/mesh/closest_face.h"
#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/files/task_files.h"
#include "stream/import/import_plan.h"
#include "stream/points/plan.h"
#include "stream/points/point_overlay.h"
#include "stream/points/point_store.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/plan/forecast_rates.h"
#include "stream/stages/plan/planned_scan.h"

namespace tessera {
namespace {

constexpr double kMaxDistance = 4.0;       ///< times the tolerance: distances up to here are told
constexpr double kMaxDistanceCells = 6.0;  ///< before decimation at least so many spacings of the lattice
constexpr double kMinLeft = 1.0 / 64.0;    ///< of the tolerance, for decimation to do anything
constexpr const char* kLeftFile = "samples/left.json";
constexpr std::size_t kMinBricks = 16, kMaxTasks = 400;
constexpr std::uint64_t kPointBytes = 64;  ///< records read and the block that they become
/// Of the tolerance: squares of distances are integers in its square.
constexpr double kSquareUnit = 0x1p-12;

struct SampleSums {
  std::uint64_t samples = 0, over = 0, beyond = 0;
  std::uint64_t squares = 0;  ///< of those within reach
  double farthest = -1.0;     ///< rounding included; reach if some are beyond
  Double3 position = {0, 0, 0};
  std::array<std::uint64_t, kDeviationBins + 1> histogram{};  ///< the last: above the tolerance

  static void fields(auto& self, auto&& field) {
    field("samples", self.samples);
    field("over", self.over);
    field("beyond", self.beyond);
    field("squares", self.squares);
    field("farthest", self.farthest);
    field("place", self.position);
    field("histogram", self.histogram);
  }
  void add(const SampleSums& part) {
    samples += part.samples, over += part.over, beyond += part.beyond, squares += part.squares;
    for (std::size_t i = 0; i < histogram.size(); ++i) histogram[i] += part.histogram[i];
    if (part.farthest > farthest) farthest = part.farthest, position = part.position;
  }
};

/// Up to the next number of three digits.
double min_above(double value) {
  double unit = 1.0;
  while (unit * 100.0 > value) unit /= 10.0;
  while (unit * 1000.0 <= value) unit *= 10.0;
  return std::ceil(value / unit) * unit;
}

class SamplesStage : public Stage {
 public:
  SamplesStage(const JobState& state, const SamplesRequest& request)
      : tolerance_(request.tolerance),
        before_(request.before),
        lattice_(Plan::of_work(state.work).lattice),
        max_distance_(std::max(kMaxDistance * tolerance_, before_ ? kMaxDistanceCells * lattice_.h : 0.0)),
        points_(PointStore::of_surface(state.work)),
        mesh_(request.mesh(state)),
        per_task_(std::max(kMinBricks, (points_.bricks().size() + kMaxTasks - 1) / kMaxTasks)) {}

  std::string name() const override { return before_ ? "points" : "samples"; }
  std::size_t task_count() const override { return (points_.bricks().size() + per_task_ - 1) / per_task_; }
  std::uint64_t units() const override { return points_.point_count(); }
  std::string unit_name() const override { return "points"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t b = first(task); b < first(task + 1); ++b) {
      const BrickEntry& brick = points_.bricks()[b];
      const std::vector<std::size_t> near = mesh_.select(near_box(brick));
      std::uint64_t faces = 0;
      for (const std::size_t p : near) faces += mesh_.patches()[p].faces;
      maximum = std::max(maximum, samples_task_bytes(brick.points, mesh_.block_bytes(near), faces));
    }
    return maximum;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    SampleSums sums;
    for (std::size_t b = first(task); b < first(task + 1); ++b) {
      context.check_stop();
      measure(points_.bricks()[b], sums);
      context.advance(points_.bricks()[b].points);
      context.count_read(points_.bricks()[b].points * sizeof(PointRecord));
    }
    return fields_to_json(sums);
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    SampleSums sum;
    for (const Json& task : summaries) sum.add(fields_from_json<SampleSums>(task));
    const double left = tolerance_ - std::max(0.0, sum.farthest);
    if (before_ && left < kMinLeft * tolerance_)
      throw ValidationError(
          "--reference points: points lie up to " + std::string(sum.beyond > 0 ? "more than " : "") +
          number_text(sum.farthest) + " from the surface of full resolution (" + std::to_string(sum.over) +
          " of " + std::to_string(sum.samples) + " farther than the tolerance of " + number_text(tolerance_) +
          ", the farthest at " + number_text(sum.position[0]) + " " + number_text(sum.position[1]) + " " +
          number_text(sum.position[2]) + "): the least --tolerance that can do is " +
          (sum.beyond > 0 ? "more than " : "") + number_text(min_above(sum.farthest / (1.0 - kMinLeft))));
    if (before_) write_text(context.create(kLeftFile), dump_json(Json{{"left", left}}));
    if (sum.over > 0)
      throw ValidationError("the result gets no name: " + std::to_string(sum.over) + " of " +
                            std::to_string(sum.samples) + " points are farther than " +
                            number_text(tolerance_) + " from it, the farthest " +
                            (sum.beyond > 0 ? "more than " : "") + number_text(sum.farthest) + " at " +
                            number_text(sum.position[0]) + " " + number_text(sum.position[1]) + " " +
                            number_text(sum.position[2]));
    const double unit = tolerance_ * kSquareUnit;
    const double mean =
        sum.samples > 0 ? static_cast<double>(sum.squares) / static_cast<double>(sum.samples) : 0.0;
    return {{"samples", sum.samples},
            {"certified_max", std::max(0.0, sum.farthest)},
            {"place", sum.position},
            {"rms", unit * std::sqrt(mean)},
            {"histogram", sum.histogram}};
  }

 private:
  std::size_t first(std::size_t task) const { return std::min(points_.bricks().size(), task * per_task_); }

  double world(std::size_t axis, double cells) const {
    const int a = static_cast<int>(axis);
    return lattice_.world(a, cells) - mesh_.info().shift[axis];
  }
  MeshBox near_box(const BrickEntry& brick) const {
    const Int3 at = brick_of_key(brick.key);
    MeshBox box;
    for (std::size_t a = 0; a < 3; ++a) {
      box.low[a] = world(a, at[a] * double{kBrickCells});
      box.high[a] = world(a, (at[a] + 1) * double{kBrickCells});
    }
    return grown(box, max_distance_ * (1.0 + 0x1p-20));
  }

  void measure(const BrickEntry& brick, SampleSums& sums) const {
    const Int3 at = brick_of_key(brick.key);
    const Int3 corner = {at[0] * kBrickCells, at[1] * kBrickCells, at[2] * kBrickCells};
    const PointBlock points = points_.load(corner, {kBrickCells, kBrickCells, kBrickCells}, 0);
    const MeshBox near = near_box(brick);
    const MeshBlock mesh = mesh_.load_box(near);
    const ClosestFaces faces(mesh.position, mesh.faces, near.low);
    const double per_unit = 1.0 / (tolerance_ * kSquareUnit);
    std::uint32_t hint = ClosestFaces::kNone;
    double size = 0.0;
    for (std::size_t a = 0; a < 3; ++a) size = std::max(size, near.high[a] - near.low[a]);
    const double rounding = certificate_rounding(std::max(size, faces.largest_coordinate()));
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Double3 p = {world(0, corner[0] + double{points.x[i]}), world(1, corner[1] + double{points.y[i]}),
                         world(2, corner[2] + double{points.z[i]})};
      const Double3 local = {p[0] - near.low[0], p[1] - near.low[1], p[2] - near.low[2]};
      const ClosestFaces::Hit hit =
          faces.empty() ? ClosestFaces::Hit{} : faces.closest(local, max_distance_ * max_distance_, hint);
      const bool known = hit.slot != ClosestFaces::kNone;
      if (known) hint = hit.slot;
      const double distance = known ? std::sqrt(hit.square) + rounding : max_distance_;
      ++sums.samples;
      sums.beyond += !known;
      sums.over += distance > tolerance_;
      const double units = distance * per_unit;
      sums.squares += static_cast<std::uint64_t>(units * units);
      ++sums.histogram[static_cast<std::size_t>(
          std::min<double>(kDeviationBins, std::floor(distance / tolerance_ * kDeviationBins)))];
      if (distance <= sums.farthest) continue;
      sums.farthest = distance;
      sums.position = p;
    }
  }

  double tolerance_;
  bool before_;
  Lattice lattice_;
  double max_distance_;  ///< distances up to here are told
  PointStore points_;
  MeshStore mesh_;
  std::size_t per_task_;
};

}  // namespace

std::uint64_t samples_task_bytes(std::uint64_t brick_points, std::uint64_t block_bytes, std::uint64_t faces) {
  return kPointBytes * brick_points + block_bytes + faces * (ClosestFaces::bytes_per_face() + 32) +
         (std::uint64_t{2} << 20);
}

std::unique_ptr<Stage> make_samples_stage(const JobState& state, const SamplesRequest& request) {
  return std::make_unique<SamplesStage>(state, request);
}

double tolerance_left(const std::filesystem::path& work) {
  return parse_json(read_text(work / kLeftFile)).at("left").get<double>();
}

namespace {

constexpr double kSamplesTime = 0.5;  ///< microseconds a point
/// Patches of an imported mesh that lie near one brick of points: itself and all around it.
constexpr std::uint64_t kImportedNear = 27;

}  // namespace

StageForecast forecast_samples(const PlannedScan& scan, bool before) {
  const auto faces = bytes_of(scan.faces, rates::kFacesMargin);
  const std::uint64_t largest = scan.largest_patch.faces;
  const std::uint64_t near =
      before ? std::min(faces, kImportedNear * std::max(largest, 2 * ImportPlan::kBrickVertices))
             : std::min(faces / 10, 2 * largest);
  return {.tasks = scan.plan.buckets.size(),
          .task_bytes = samples_task_bytes(scan.largest_brick, surface_block_bytes(near), near),
          .sure_bytes = samples_task_bytes(scan.largest_brick, 0, 0),
          .processor_us = scan.points * kSamplesTime,
          .moved_bytes = static_cast<double>(scan.store_bytes)};
}

}  // namespace tessera
