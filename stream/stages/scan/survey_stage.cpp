#include "stream/stages/scan/survey_stage.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/files/task_files.h"
#include "stream/formats/ply_header.h"
#include "stream/formats/points/quantise.h"
#include "stream/points/brick_histogram.h"
#include "stream/points/cell_ladder.h"
#include "stream/points/normal_sample.h"
#include "stream/points/sampled_layers.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/scan/point_colours.h"
#include "stream/stages/scan/probe_stage.h"

namespace tessera {
namespace {

constexpr std::size_t kCounterBricks = std::size_t{1} << 15;
// Complete cells of 16 h are sampled to measure spacing, noise and faces, fewer of 64, 4 and 1 h for scans that are
// sparser or denser than h asks for; in quanta, so that they are exact.
constexpr double kSampleCell = 16.0 * kQuantaPerCell;
constexpr double kLayerRatio = double{1 << LayeredSampler::kRatioBits};
constexpr LayeredSampler::Limits kSamplePoints = {1u << 13, 1u << 15, 1u << 13, 1u << 13};
constexpr double kQuantaPerBlock = double{kQuantaPerCell} * kLeafCells;
constexpr std::size_t kWarningsPerTask = 8;
/// Of a pulse (LAS: 15): every so many points one is a first return.
constexpr std::uint64_t kMaxEchoes = 16;
constexpr std::uint64_t kMergeBytesPerBrick = 384;  // merging, with slack for the tables made of it

std::string counts_file(std::size_t task) {
  return "survey/" + task_file_stem(task) + ".bricks";
}
std::string sample_file(std::size_t task) {
  return "survey/" + task_file_stem(task) + ".cells";
}

std::string normals_file(std::size_t task) {
  return "survey/" + task_file_stem(task) + ".normals";
}

/// What one task adds up.
struct Tally {
  PointDispositions dispositions;
  std::uint64_t surplus = 0;
  std::uint64_t with_normal = 0, black = 0, not_black = 0;
  std::uint64_t multi_return = 0, first_return = 0;
  IntensityHistogram intensities;                      ///< where they are asked for
  Double3 min = {kMaxQuanta, kMaxQuanta, kMaxQuanta};  ///< quanta of good points, whole numbers
  Double3 max = {-kMaxQuanta, -kMaxQuanta, -kMaxQuanta};
  std::vector<std::string> warnings;

  static void fields(auto& self, auto&& field) {
    PointDispositions::fields(self.dispositions, field);
    field("surplus", self.surplus);
    field("with_normal", self.with_normal);
    field("black", self.black);
    field("not_black", self.not_black);
    field("multi_return", self.multi_return);
    field("first_return", self.first_return);
    field("min", self.min);
    field("max", self.max);
    field("warnings", self.warnings);
  }
};

Json to_json(const Tally& t) {
  Json out = fields_to_json(t);
  out["intensities"] = t.intensities.counts();
  return out;
}

void add_json(const Json& j, Tally& t) {
  const auto part = fields_from_json<Tally>(j);
  t.dispositions.add(part.dispositions);
  t.surplus += part.surplus, t.with_normal += part.with_normal, t.black += part.black,
      t.not_black += part.not_black;
  t.multi_return += part.multi_return, t.first_return += part.first_return;
  for (std::size_t a = 0; a < 3; ++a)
    t.min[a] = std::min(t.min[a], part.min[a]), t.max[a] = std::max(t.max[a], part.max[a]);
  t.intensities.merge(j.at("intensities").get<std::vector<std::uint64_t>>());
  t.warnings.insert(t.warnings.end(), part.warnings.begin(), part.warnings.end());
}

void count_returns(const PointChunk& chunk, const std::vector<PointClass>& disposition, Tally& tally) {
  for (std::size_t i = 0; i < chunk.echo.size(); ++i) {
    if (disposition[i] != PointClass::kGood) continue;
    tally.multi_return += chunk.echo[i].of > 1 ? 1 : 0;
    tally.first_return += chunk.echo[i].number == 1 ? 1 : 0;
  }
}

/// Lattice frame of the surveyed bricks: keys, ascending.
std::vector<PlanBrick> lattice_bricks(const std::vector<BrickCount>& counts, const BrickWindow& window) {
  std::vector<PlanBrick> bricks;
  for (const BrickCount& c : counts) {
    if (!window.holds(c.brick)) continue;
    Int3 at{};
    for (std::size_t a = 0; a < 3; ++a) at[a] = static_cast<std::int32_t>(c.brick[a] - window.min[a] + 1);
    std::uint64_t blocks = 0;
    for (const std::uint64_t word : c.blocks) blocks += static_cast<std::uint64_t>(std::popcount(word));
    bricks.push_back({brick_key(at), c.points, blocks});
  }
  std::sort(bricks.begin(), bricks.end(),
            [](const PlanBrick& a, const PlanBrick& b) { return a.key < b.key; });
  return bricks;
}

}  // namespace

std::uint64_t bucket_target(const RunOptions& run, std::uint64_t points) {
  constexpr std::uint64_t kMax = 1 << 20, kMin = 1 << 14, kMaxBuckets = 600;
  constexpr std::uint64_t kWorthwhile = 1 << 16, kTasksPerThread = 4;  // a bucket is a task of later stages
  const auto threads = static_cast<std::uint64_t>(std::max(1, run.threads));
  const std::uint64_t fits = std::clamp(run.memory_bytes / threads / 4 / 24, kMin, kMax);
  const std::uint64_t shared = std::max(points / (kTasksPerThread * threads), kWorthwhile);
  return std::max(std::min(fits, shared), points / kMaxBuckets);
}

SurveyStage::SurveyStage(const JobState& job, std::shared_ptr<const PointInputs> inputs, double h,
                         std::uint64_t probed)
    : job_(job), options_(reconstruct_options(job)), inputs_(std::move(inputs)), h_(h), probed_(probed) {
  if (!(h_ > 0.0) || !std::isfinite(h_))
    throw UsageError("--resolution must be a positive number in the scan's units");
  if (options_.radius > 0.0 && !(options_.radius >= h_ && options_.radius <= 4.0 * h_))
    throw UsageError("--radius must lie between 1 and 4 times the resolution " + number_text(h_) + ", not " +
                     number_text(options_.radius));
}

std::size_t SurveyStage::max_bricks() const {
  return static_cast<std::size_t>(
      std::min<std::uint64_t>(job_.run.memory_bytes / 4 / kMergeBytesPerBrick, std::uint64_t{1} << 28));
}

std::uint64_t SurveyStage::task_bytes(std::size_t) const {
  // The counter's table (two slots a brick) and its sorted copy, quanta of a chunk, the sampled cells, the reader.
  return LayeredSampler::bytes(kSamplePoints) + kCounterBricks * sizeof(BrickCount) * 3 +
         NormalSampler::kBytes + (std::uint64_t{65536} * 25) + (std::uint64_t{1} << 20) +
         PointInputs::kReadBytes;
}

std::uint64_t survey_finish_bytes(const RunOptions& run, std::uint64_t input_bytes) {
  return std::min<std::uint64_t>(run.memory_bytes / 4, (input_bytes / 3 + 4096) * kMergeBytesPerBrick) +
         2 * LayeredSampler::bytes(kSamplePoints) + NormalSampler::kBytes;
}

Json SurveyStage::run(std::size_t task, TaskContext& context) const {
  BrickCounter counter(context.create(counts_file(task)), kCounterBricks);
  LayeredSampler sampler(kSampleCell * kLayerRatio, kSamplePoints, probed_);
  NormalSampler normals(probed_);
  ChunkQuanta quanta;
  GoodPoints good;
  Tally tally;
  const ReadCounts counts = inputs_->read(task, context, true, [&](std::uint32_t, const PointChunk& chunk) {
    quanta.compute(chunk, h_);
    good.choose(chunk, quanta);
    if (good.size() < chunk.size())
      for (const PointClass c : quanta.disposition) {
        tally.dispositions.non_finite += c == PointClass::kNonFinite ? 1 : 0;
        tally.dispositions.absurd += c == PointClass::kTooFar ? 1 : 0;
      }
    for (std::size_t i = 0; i < good.size(); ++i)
      counter.add({static_cast<std::int64_t>(std::floor(good.p[0][i] / kQuantaPerBlock)),
                   static_cast<std::int64_t>(std::floor(good.p[1][i] / kQuantaPerBlock)),
                   static_cast<std::int64_t>(std::floor(good.p[2][i] / kQuantaPerBlock))});
    sampler.add(good.p[0], good.p[1], good.p[2]);
    for (std::size_t a = 0; a < 3; ++a)
      for (const double v : good.p[a]) {
        tally.min[a] = std::min(tally.min[a], v);
        tally.max[a] = std::max(tally.max[a], v);
      }
    if (!good.n[0].empty()) tally.with_normal += normals.add(good.p, good.n);
    count_returns(chunk, quanta.disposition, tally);
    tally.intensities.add(chunk);
    for (const std::uint32_t rgba : chunk.rgba)  // alpha 0 tells no colour
      if (rgba >> 24 != 0) ++((rgba & 0xffffffu) == 0 ? tally.black : tally.not_black);
  });
  context.count_written(counter.finish());
  sampler.save(context.create(sample_file(task)));
  if (tally.with_normal > 0) normals.save(context.create(normals_file(task)));
  tally.dispositions.read = counts.points;
  tally.dispositions.withheld = counts.withheld;
  tally.dispositions.empty = counts.empty;
  tally.dispositions.missing = counts.missing;
  tally.dispositions.other_class = counts.other_class;
  tally.surplus = counts.surplus;
  tally.dispositions.other_return = counts.other_return;
  tally.dispositions.outside = counts.outside;
  tally.dispositions.thinned = counts.thinned;
  tally.warnings = counts.warnings;
  if (tally.warnings.size() > kWarningsPerTask) tally.warnings.resize(kWarningsPerTask);
  return to_json(tally);
}

PointClumps SurveyStage::measure(std::size_t tasks, std::uint64_t blocks,
                                 const std::vector<BrickCount>& counts, Plan& plan) const {
  LayeredSampler sampler(kSampleCell * kLayerRatio, kSamplePoints, probed_);
  std::vector<std::filesystem::path> files;
  for (std::size_t k = 0; k < tasks; ++k) files.push_back(job_.work / sample_file(k));
  sampler.merge(files);
  const SampledLayers layers(sampler);
  // A surface of area A crosses about 1.5 A / e^2 cells of edge e and becomes about 3 A / h^2 triangles.
  plan.faces_estimate =
      static_cast<std::uint64_t>(8.0 * static_cast<double>(blocks) * layers.double_cells_per_block(1));
  PointClumps clumps = clumps_of_samples(layers.cells(1), kSampleCell, counts);
  clumps.spacing *= h_;
  const std::vector<SpacingProbe> probes = layers.probes();
  SpacingSummary s = summarise_spacing(probes, layers.residuals(3.0 * kQuantaPerCell));
  for (double* v : {&s.middle, &s.spacing, &s.gap, &s.noise, &s.residual}) *v /= kQuantaPerCell;  // in cells
  plan.spacing = s.spacing * h_;
  plan.noise_cells = s.noise;
  if (measured() && s.residuals == 0) plan.noise_cells = probed_noise(job_.work) / h_;
  // Three cells, more where gaps or noise ask for it; in eighths, so that the last digit of a quantile is
  // nothing.
  const double wanted = std::ceil(std::max({3.0, 2.5 * s.gap, 4.0 * s.residual}) * 8.0) / 8.0;
  plan.radius_cells = options_.radius > 0.0 ? options_.radius / h_ : std::min(4.0, wanted);
  if (measured()) {
    plan.resolution_reason = chosen_resolution(job_.work).reason;
    if (clumps.spacing > 0.0) plan.warnings.push_back(clump_sentence(clumps));
    return clumps;  // no warning against what we chose ourselves
  }
  if (probes.empty() && !layers.too_dense() && plan.points() >= 1000)
    plan.warnings.push_back(
        "the resolution " + number_text(h_) +
        " is far below the spacing of the scan: expect holes, and many cells for few points");
  else if (s.middle > 1.0)
    plan.warnings.push_back(
        "the resolution " + number_text(h_) + " is below the spacing of the scan, on half of its surface " +
        number_text(s.middle * h_) + " or more: expect pinholes, and " +
        number_text(round_up_2_digits(s.middle * s.middle)) + " times the cells that the spacing carries");
  return clumps;
}

Json SurveyStage::finish(const std::vector<Json>& summaries, TaskContext& context) const {
  Tally tally;
  std::vector<std::filesystem::path> files;
  NormalSampler normals(probed_);
  for (std::size_t k = 0; k < summaries.size(); ++k) {
    add_json(summaries[k], tally);
    if (summaries[k].at("with_normal").natural() > 0) normals.merge(job_.work / normals_file(k));
    files.push_back(job_.work / counts_file(k));
  }
  const std::uint64_t left_out = tally.dispositions.other_class + tally.dispositions.other_return +
                                 tally.dispositions.outside + tally.dispositions.thinned;
  const std::uint64_t finite = tally.dispositions.read - left_out - tally.dispositions.non_finite;
  inputs_->require_wanted(tally.dispositions.read, left_out);
  if (tally.dispositions.read == 0) throw EmptyError("the input holds no point");
  if (finite == 0)
    throw EmptyError("none of the " + std::to_string(tally.dispositions.read - left_out) +
                     " points has finite coordinates");
  if (finite == tally.dispositions.absurd)
    throw InputError(
        "every point lies more than 2^50 quanta (h / 1024) from zero; choose a coarser --resolution");
  if (tally.min == tally.max && finite - tally.dispositions.absurd > 1)
    throw InputError("all " + std::to_string(finite) +
                     " points lie at one position; there is no surface to reconstruct");
  const std::vector<BrickCount> counts = merge_brick_counts(files, max_bricks());
  const BrickWindow window = scan_window(counts, h_, measured());
  const std::vector<PlanBrick> bricks = lattice_bricks(counts, window);
  Plan plan;
  plan.lattice.h = h_;
  for (std::size_t a = 0; a < 3; ++a) {
    plan.lattice.origin_brick[a] = window.min[a] - 1;
    plan.brick_min[a] = 1;
    plan.brick_max[a] = static_cast<std::int32_t>(window.max[a] - window.min[a] + 1);
  }
  plan.dispositions = tally.dispositions;
  plan.dispositions.absurd += window.dropped_points;
  plan.dispositions.kept = finite - plan.dispositions.absurd;
  plan.auto_resolution = measured();
  const ColourBy by = colour_by(options_.colour);
  plan.has_colour = has_point_colours(by, *inputs_);
  // Formats of LAS with room for colours are filled with zeros where there are none.
  const bool black = by == ColourBy::kRgb && plan.has_colour && tally.black > 0 && tally.not_black == 0;
  if (black) plan.has_colour = false;
  if (by == ColourBy::kIntensity) plan.colour_range = tally.intensities.range();
  if (by == ColourBy::kHeight)
    for (std::size_t end = 0; end < 2; ++end)
      plan.colour_range[end] = static_cast<double>(occupied_heights(counts, window)[end]) * kQuantaPerBlock;
  plan.normal_fraction =
      static_cast<double>(tally.with_normal) / static_cast<double>(finite - tally.dispositions.absurd);
  const NormalAgreement agreement = normals.measure();
  save_agreement(context.create(kAgreementFile), agreement);
  if (options_.normals == "estimate") plan.normal_fraction = 0.0;
  plan.grid_normals = plan.has_normals() && inputs_->has_grid_normals();
  // Some files say the same return of the same pulse for every point: that is no measurement.
  if (tally.first_return >= tally.multi_return / kMaxEchoes)
    plan.multi_return_fraction =
        static_cast<double>(tally.multi_return) / static_cast<double>(finite - tally.dispositions.absurd);
  plan.sensors = inputs_->sensors();
  plan.metres = inputs_->crs().height_unit;
  plan.bricks = bricks.size();
  plan.buckets = cut_buckets(bricks, bucket_target(job_.run, plan.points()), options_.max_brick_points);
  plan.warnings = inputs_->notices(tally.warnings);
  if (tally.surplus > 0) plan.warnings.push_back(surplus_sentence(tally.surplus));
  if (black)
    plan.warnings.push_back(
        "every point is black, so the scan has no colours: --colour intensity, class or height gives some");
  std::uint64_t blocks = 0;
  for (const PlanBrick& b : bricks) blocks += b.blocks;
  const PointClumps clumps = measure(summaries.size(), blocks, counts, plan);
  if (plan.points() < 3)
    throw EmptyError("the input holds " + std::to_string(plan.points()) +
                     " usable points; a surface needs at least three");
  plan.save(context.create(Plan::kFile));
  if (clumps.spacing > 0.0) save_clumps(context.create(kClumpFile), clumps);
  save_plan_bricks(context.create(Plan::kBrickFile), bricks);
  Json report = plan.to_json();
  report.erase("buckets");
  if (agreement.cells > 0) report["normal_agreement"] = fields_to_json(agreement);
  if (inputs_->crs().known()) report["coordinate_system"] = to_json(inputs_->crs());
  return report;
}

std::unique_ptr<Stage> make_survey_stage(const JobState& job) {
  const double given = reconstruct_options(job).resolution;
  const bool auto_resolution = given == 0.0;
  const double h = auto_resolution ? chosen_resolution(job.work).h : given;
  const bool colours = colour_by(reconstruct_options(job).colour) == ColourBy::kRgb;
  return std::make_unique<SurveyStage>(job, open_point_inputs(job, colours), h,
                                       auto_resolution ? probed_points(job.work) : 0);
}

}  // namespace tessera
