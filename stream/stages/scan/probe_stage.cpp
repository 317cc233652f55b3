#include "stream/stages/scan/probe_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <span>
#include <string>

#include "kernels/points/spacing.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/points/reconstruct_options.h"
#include "stream/points/sampled_layers.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

constexpr std::size_t kProbePoints = 16384;
constexpr std::size_t kProbeQueries = 1024;
constexpr std::size_t kLayerPoints = std::size_t{1} << 16;
constexpr LayeredSampler::Limits kSpacingPoints = {kLayerPoints, kLayerPoints, kLayerPoints, kLayerPoints};
// The first layer is so much coarser than the cell that the probe has told: that one follows the bulk of the points.
constexpr double kCoarsest = 4.0;
constexpr std::uint64_t kSmall = std::uint64_t{1} << 20;
constexpr std::uint64_t kMinMeasured = 100;
constexpr const char* kProbeFile = "probe.json";
constexpr const char* kSpacingFile = "spacing.json";

std::string probe_file(std::size_t task) {
  return "probe/" + task_file_stem(task) + ".sample";
}
std::string cells_file(std::size_t task) {
  return "spacing/" + task_file_stem(task) + ".cells";
}

/// Axes of the points of a chunk that lie within `far` of zero along each, in `scratch` where some do not.
std::array<std::span<const double>, 3> points_within(double far, const PointChunk& c, PointChunk& scratch) {
  const auto within = [&](std::size_t i) {
    return (std::fabs(c.x[i]) <= far) & (std::fabs(c.y[i]) <= far) & (std::fabs(c.z[i]) <= far);
  };
  std::size_t good = 0;
  for (std::size_t i = 0; i < c.size(); ++i) good += within(i) ? 1 : 0;
  if (good == c.size()) return {c.x, c.y, c.z};
  scratch.clear();
  for (std::size_t i = 0; i < c.size(); ++i)
    if (within(i)) scratch.x.push_back(c.x[i]), scratch.y.push_back(c.y[i]), scratch.z.push_back(c.z[i]);
  return {scratch.x, scratch.y, scratch.z};
}

void save_json(const std::filesystem::path& path, const Json& j) {
  std::ofstream out(path, std::ios::trunc);
  out << dump_json(j, 1) << "\n";
  out.close();
  if (!out)
    throw ResourceError(path.string() + ": cannot be written: the disk is full or the folder is read-only");
}

Json load_json(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) throw InputError(path.string() + ": missing; run again with --force");
  Json j = try_parse_json(read_text(path));
  if (j.is_discarded()) throw InputError(path.string() + ": damaged; run again with --force");
  return j;
}

/// Common to both passes: no task when the resolution is given.
class MeasuringStage : public Stage {
 public:
  MeasuringStage(const JobState& job, std::shared_ptr<const PointInputs> inputs)
      : job_(job), measures_(reconstruct_options(job).resolution == 0.0), inputs_(std::move(inputs)) {}
  std::size_t task_count() const override { return needed() ? inputs_->task_count() : 0; }
  std::uint64_t units() const override { return needed() ? inputs_->bytes() : 0; }
  std::string unit_name() const override { return "bytes"; }

 protected:
  bool needed() const { return measures_; }
  JobState job_;
  bool measures_;
  std::shared_ptr<const PointInputs> inputs_;
};

/// Squared distances to the nearest of some points, the least first.
class NearestSquares {
 public:
  /// \param rank  of the farthest that is wanted, from 0; below the number of points
  NearestSquares(std::vector<Double3> points, std::size_t rank) : rank_(rank), points_(std::move(points)) {
    for (std::size_t a = 1; a < 3; ++a)
      if (extent(a) > extent(axis_)) axis_ = a;
    std::sort(points_.begin(), points_.end(),
              [&](const Double3& p, const Double3& q) { return p[axis_] < q[axis_]; });
  }

  std::vector<double> of(const Double3& p) const {
    std::vector<double> minimum(rank_ + 1, std::numeric_limits<double>::infinity());
    // Away from p along one axis, on either side until what is left lies too far off in that alone.
    const auto meet = [&](const Double3& q) {
      const Double3 d = p - q;
      if (d[axis_] * d[axis_] >= minimum.back()) return false;
      const double square = dot(d, d);
      if (square < minimum.back()) {
        const auto at = std::upper_bound(minimum.begin(), minimum.end(), square);
        std::copy_backward(at, minimum.end() - 1, minimum.end());
        *at = square;
      }
      return true;
    };
    const auto middle =
        std::lower_bound(points_.begin(), points_.end(), p,
                         [&](const Double3& q, const Double3& r) { return q[axis_] < r[axis_]; });
    for (auto q = middle; q != points_.end() && meet(*q);) ++q;
    for (auto q = middle; q != points_.begin() && meet(*(q - 1));) --q;
    return minimum;
  }

 private:
  double extent(std::size_t a) const {
    const auto [low, high] = std::minmax_element(
        points_.begin(), points_.end(), [&](const Double3& p, const Double3& q) { return p[a] < q[a]; });
    return (*high)[a] - (*low)[a];
  }

  std::size_t rank_;
  std::size_t axis_ = 0;
  std::vector<Double3> points_;
};

class ProbeStage : public MeasuringStage {
 public:
  using MeasuringStage::MeasuringStage;
  std::string name() const override { return "probe"; }
  std::uint64_t task_bytes(std::size_t) const override { return kSampleBytes + PointInputs::kReadBytes; }
  std::uint64_t finish_bytes() const override { return needed() ? 2 * kSampleBytes : kSmall; }

  Json run(std::size_t task, TaskContext& context) const override {
    PointSampler sampler(kProbePoints);
    std::uint64_t points = 0;
    PointChunk scratch;
    constexpr double kFinite = std::numeric_limits<double>::max();
    const ReadCounts counts = inputs_->read(task, context, true, [&](std::uint32_t, const PointChunk& chunk) {
      const auto [x, y, z] = points_within(kFinite, chunk, scratch);
      sampler.add(x, y, z);
      points += x.size();
    });
    const std::vector<Double3> sample = sampler.take();
    DirectFile out(context.create(probe_file(task)), std::size_t{256} << 10);
    out.write(sample.data(), sample.size() * sizeof(Double3));
    context.count_written(out.finish());
    return {{"points", points},
            {"read", counts.points},
            {"left_out", counts.other_class + counts.other_return + counts.outside + counts.thinned}};
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    if (!needed()) return {{"skipped", "the resolution is given"}};
    PointSampler sampler(kProbePoints);
    std::uint64_t points = 0;
    std::uint64_t read = 0;
    std::uint64_t left_out = 0;
    for (std::size_t k = 0; k < summaries.size(); ++k) {
      points += summaries[k].at("points").get<std::uint64_t>();
      read += summaries[k].at("read").get<std::uint64_t>();
      left_out += summaries[k].at("left_out").get<std::uint64_t>();
      const ReadFile in(job_.work / probe_file(k));
      std::vector<Double3> part(in.size() / sizeof(Double3));
      in.read_at(0, part.data(), part.size() * sizeof(Double3));
      for (const Double3& p : part) sampler.add(p);
    }
    const std::vector<Double3> sample = sampler.take();
    inputs_->require_wanted(read, left_out);
    if (points == 0) throw EmptyError("the input holds no point with finite coordinates");
    if (sample.size() < 3)
      throw InputError("the input holds only " + std::to_string(sample.size()) +
                       " different positions; a surface needs at least three");
    Json probe = measure(sample, points);
    save_json(context.create(kProbeFile), probe);
    return probe;
  }

 private:
  static constexpr std::uint64_t kSampleBytes = 5 * kProbePoints * sizeof(HashedPoint) * 2;

  /// Distances within the sample, scaled to the whole as on a surface.
  static Json measure(const std::vector<Double3>& sample, std::uint64_t points) {
    constexpr std::size_t kRank = 8;
    constexpr double kMaxSpread = 16.0;  // of the median distance; scans whose density varies reach 10
    ScaleHistogram nearest;
    ScaleHistogram eighth;
    const std::size_t queries = std::min(sample.size(), kProbeQueries);
    const NearestSquares squares(sample, std::min(kRank, sample.size() - 1));
    for (std::size_t i = 0; i < queries; ++i) {
      // Element 0 of the order is the point itself.
      const std::vector<double> nearby = squares.of(sample[i]);
      eighth.add(std::sqrt(nearby.back()));
      nearest.add(std::sqrt(nearby[1]));
    }
    const double scale = std::sqrt(static_cast<double>(sample.size()) / static_cast<double>(points));
    // Strewn points may be more than one in twenty: they must not make the cell too coarse for the surface.
    const double eighth_most = std::min(eighth.quantile(0.95), kMaxSpread * eighth.quantile(0.5));
    const double eighth_95 = eighth_most * std::min(1.0, scale);
    const double nearest_50 = nearest.quantile(0.5) * std::min(1.0, scale);
    if (!std::isfinite(eighth_95))
      throw InputError(
          "the points lie too far apart for their distances to be numbers; scale the scan, or leave out what "
          "lies so far away");
    if (!(eighth_95 > 0.0))
      throw InputError("the extent of the scan is zero; there is no surface to reconstruct");
    // Powers of two, so that the cell does not hang on the last digit of an estimate.
    double cell = 1.0;
    while (cell > 8.0 * eighth_95) cell /= 2;
    while (cell < 8.0 * eighth_95) cell *= 2;
    return {{"points", points},
            {"sample", sample.size()},
            {"spacing_guess", std::max(eighth_95 / 2, nearest_50)},
            {"cell", cell}};
  }
};

class SpacingStage : public MeasuringStage {
 public:
  SpacingStage(const JobState& job, std::shared_ptr<const PointInputs> inputs)
      : MeasuringStage(job, std::move(inputs)) {
    if (needed()) probe_ = load_json(job_.work / kProbeFile);
  }
  std::string name() const override { return "spacing"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return LayeredSampler::bytes(kSpacingPoints) + PointInputs::kReadBytes;
  }
  std::uint64_t finish_bytes() const override { return needed() ? spacing_bytes() : kSmall; }
  std::vector<std::string> obsolete() const override {
    return needed() ? std::vector<std::string>{"probe/"} : std::vector<std::string>{};
  }

  Json run(std::size_t task, TaskContext& context) const override {
    LayeredSampler sampler(kCoarsest * cell(), kSpacingPoints, probe_.at("points").get<std::uint64_t>());
    PointChunk scratch;
    const double far = std::min(1e15 * cell(), std::numeric_limits<double>::max());
    inputs_->read(task, context, true, [&](std::uint32_t, const PointChunk& chunk) {
      const auto [x, y, z] = points_within(far, chunk, scratch);
      sampler.add(x, y, z);
    });
    const auto path = context.create(cells_file(task));
    sampler.save(path);
    context.count_written(std::filesystem::file_size(path));
    return Json::object();
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    if (!needed()) return {{"skipped", "the resolution is given"}};
    LayeredSampler sampler(kCoarsest * cell(), kSpacingPoints, probe_.at("points").get<std::uint64_t>());
    std::vector<std::filesystem::path> files;
    for (std::size_t k = 0; k < summaries.size(); ++k) files.push_back(job_.work / cells_file(k));
    sampler.merge(files);
    SampledLayers layers(sampler);
    const std::vector<SpacingProbe> probes = layers.probes();
    SpacingSummary s = summarise_spacing(probes, {});
    const double guess = probe_.at("spacing_guess").get<double>();
    const bool guessed = probes.size() < kMinMeasured;
    if (guessed) s.dense = s.middle = s.wide = s.spacing = guess;
    s.noise = summarise_spacing({}, layers.residuals(3.0 * choose_spacing(s).h)).noise;
    ChosenSpacing chosen = choose_spacing(s, probe_.at("points").get<std::uint64_t>());
    if (guessed)
      chosen.reason = "1.5 times a spacing guessed from a few points, too few lie together to measure it";
    if (s.outliers > 0.0)
      chosen.reason += "; " + number_text(round_up_2_digits(100.0 * s.outliers)) +
                       " % of the points are strewn off any surface and left out of that";
    Json result = {{"resolution", round_up_2_digits(chosen.h)},
                   {"reason", chosen.reason},
                   {"spacing", s.spacing},
                   {"spacing_dense", s.dense},
                   {"spacing_middle", s.middle},
                   {"spacing_wide", s.wide},
                   {"gap", s.gap},
                   {"noise", s.noise},
                   {"strewn", s.outliers},
                   {"cell", cell()},
                   {"measured", probes.size()}};
    save_json(context.create(kSpacingFile), result);
    return result;
  }

 private:
  double cell() const { return probe_.at("cell").get<double>(); }
  Json probe_;
};

}  // namespace

ChosenSpacing chosen_resolution(const std::filesystem::path& work) {
  const Json j = load_json(work / kSpacingFile);
  try {
    return {j.at("resolution").get<double>(), j.at("reason").get<std::string>()};
  } catch (const JsonError&) {
    throw InputError((work / kSpacingFile).string() + ": damaged; run again with --force");
  }
}

double probed_noise(const std::filesystem::path& work) {
  const Json j = load_json(work / kSpacingFile);
  try {
    return j.at("noise").get<double>();
  } catch (const JsonError&) {
    throw InputError((work / kSpacingFile).string() + ": damaged; run again with --force");
  }
}

std::uint64_t probed_points(const std::filesystem::path& work) {
  const Json j = load_json(work / kProbeFile);
  try {
    return j.at("points").get<std::uint64_t>();
  } catch (const JsonError&) {
    throw InputError((work / kProbeFile).string() + ": damaged; run again with --force");
  }
}

std::unique_ptr<Stage> make_probe_stage(const JobState& job, std::shared_ptr<const PointInputs> inputs) {
  return std::make_unique<ProbeStage>(job, std::move(inputs));
}
std::unique_ptr<Stage> make_spacing_stage(const JobState& job, std::shared_ptr<const PointInputs> inputs) {
  return std::make_unique<SpacingStage>(job, std::move(inputs));
}
std::uint64_t spacing_bytes() {
  return 2 * LayeredSampler::bytes(kSpacingPoints) + kSmall;
}

std::unique_ptr<Stage> make_probe_stage(const JobState& job) {
  return make_probe_stage(job, open_point_inputs(job, false));
}
std::unique_ptr<Stage> make_spacing_stage(const JobState& job) {
  return make_spacing_stage(job, open_point_inputs(job, false));
}

}  // namespace tessera
