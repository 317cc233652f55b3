#include "stream/survey/scan_deviation.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/scratch_folder.h"
#include "stream/formats/vertex_fields.h"
#include "stream/import/crs_sidecar.h"
#include "stream/import/import_mesh.h"
#include "stream/render/value_picture.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"
#include "stream/survey/measured_inputs.h"
#include "stream/survey/point_distances.h"

namespace tessera {
namespace {

constexpr double kReachPerDiagonal = 0.1;
constexpr double kMostDiagonals = 1000.0;  ///< sums of squares have digits for no more
constexpr std::uint64_t kWorkShare = 4;    ///< a part in so many of the memory is for points on their way
/// Of reading points, and a file being written.
constexpr std::uint64_t kPassBytes = std::uint64_t{24} << 20;
constexpr const char* kWho = "deviate";

/// One call of measure_deviation().
class DeviationJob {
 public:
  DeviationJob(const std::vector<std::filesystem::path>& inputs, const std::filesystem::path& reference,
               const ScanDeviationOptions& options, const std::vector<std::filesystem::path>& outputs)
      : input_paths_(inputs),
        reference_path_(reference),
        options_(options),
        outputs_(outputs),
        scratch_(options.temp, "deviate") {
    run_.memory_bytes = options.memory_bytes;
    run_.threads = options.threads > 0 ? options.threads : core_count();
  }

  ScanDeviationReport run() {
    open_inputs();
    const MeshStore reference =
        import_mesh(reference_path_, scratch_.path(), "reference", run_, throw_if_stopped);
    report_.reference_faces = reference.face_count();
    if (reference.face_count() == 0)
      throw InputError(reference_path_.string() + ": has no faces to measure deviations from");
    report_.max_distance =
        options_.max_distance > 0.0 ? options_.max_distance : kReachPerDiagonal * reference.diagonal();
    if (!(report_.max_distance > 0.0))
      throw InputError(reference_path_.string() + ": has no extent; give --max-distance");
    if (report_.max_distance > kMostDiagonals * reference.diagonal())
      throw UsageError(fmt::format("--max-distance {:g}: is more than {:g} times the diagonal of {}, {:g}",
                                   report_.max_distance, kMostDiagonals, reference_path_.string(),
                                   reference.diagonal()));
    if (options_.tolerance > report_.max_distance)
      throw UsageError(
          fmt::format("--tolerance {:g}: deviations are told up to {:g} alone; raise --max-distance",
                      options_.tolerance, report_.max_distance));
    to_reference_ = inputs_->points().shift - reference.info().shift;
    const std::uint64_t base = resident_bytes();
    const auto share = [&](std::uint64_t cap) { return MemoryBudget(cap, base).capacity() / kWorkShare; };
    const std::uint64_t work = share(run_.memory_bytes);
    PointDistances distances(reference, report_.max_distance, scratch_.path(), work);
    // Points on their way and the fullest cell are there at one time.
    const std::uint64_t cell = distances.fullest_bytes();
    const std::uint64_t pass = kPassBytes + (options_.map ? ValueCells::bytes() : 0);
    const auto need = [&](std::uint64_t cap) { return std::max(cell, pass) + share(cap); };
    MemoryBudget(run_.memory_bytes, base)
        .require(need(run_.memory_bytes), kWho,
                 MemoryBudget::smallest_fitting_cap(run_.memory_bytes, base, need));
    WorkerPool pool(run_.threads);
    pool.run_here([&] { deal(distances); });
    MemoryBudget budget(run_.memory_bytes, base + work);
    distances.measure(pool, budget);
    trim_allocator();
    report_.searched = distances.searched();
    if (distances.measured() == 0)
      throw EmptyError(
          fmt::format("{}: no point lies within {:g} of {}; are both in one system? else raise "
                      "--max-distance",
                      input_paths_.front().string(), report_.max_distance, reference_path_.string()));
    // Distances wait in half of the share, sorting takes the other.
    DeviationStatistics statistics(report_.max_distance, options_.tolerance, options_.areas, scratch_.path(),
                                   std::max<std::uint64_t>(work / 2, 1u << 20));
    if (options_.map) start_map(reference.box());
    pool.run_here([&] { write(distances, statistics); });
    if (map_) report_.map = map_->finish();
    map_.reset();
    report_.table = statistics.finish();
    report_.crs = inputs_->points().crs.name;
    report_.vertices = measures_vertices(input_paths_.front());
    report_.notices = inputs_->points().notices();
    report_.bytes = inputs_->finish();
    return std::move(report_);
  }

 private:
  /// What the inputs are refused for they shall be refused for before the work.
  void open_inputs() {
    if (!options_.areas.empty()) ClipPolygon::text_of_file(options_.areas);
    MeasuredInputOptions o;
    o.scalars = {kDeviationName};
    o.columns = options_.columns;
    o.anew = o.recoloured = options_.colour_scale > 0.0;
    o.memory_bytes = run_.memory_bytes, o.threads = run_.threads, o.scratch = scratch_.path();
    inputs_.emplace(input_paths_, outputs_, o);
    const Crs own = inputs_->points().crs, other = crs_of_wkt(crs_of_mesh(reference_path_));
    if (other.geographic)
      throw InputError(reference_path_.string() + ": its coordinates are degrees, " + other.name +
                       "; deviations are lengths");
    if (own.known() && other.known() && !may_be_same(own, other))
      throw InputError(reference_path_.string() + ": is in " + other.name + ", the points are in " +
                       own.name + "; deviations are measured in one system");
  }

  void deal(PointDistances& distances) {
    inputs_->read([&](const Double3& p) { distances.add(p + to_reference_); });
    report_.points = inputs_->finite();
    report_.left_out = inputs_->left_out();
  }

  /// Of what can have a deviation, and what lies around it; strays farther off would leave the rest a dot.
  void start_map(const MeshBox& reference) {
    const auto [near_low, near_high] = grown(reference, report_.max_distance);
    Double3 low, high;
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::max(inputs_->min()[a], near_low[a] - to_reference_[a]);
      high[a] = std::min(inputs_->max()[a], near_high[a] - to_reference_[a]);
    }
    map_.emplace(low, high, report_.max_distance);
  }

  /// The second pass: every point with its distance.
  void write(PointDistances& distances, DeviationStatistics& statistics) {
    inputs_->write([&](const Double3& p, MeasuredInputs::Found& found) {
      const PointDistance distance = distances.next();
      if (std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2])) {
        statistics.add(p, distance);
        if (map_) map_->add(p, distance.value);
      }
      found.scalars[0] = distance.value;
      if (options_.colour_scale > 0.0) found.rgba = measured_colour(distance.value, options_.colour_scale);
      return true;
    });
  }

  std::vector<std::filesystem::path> input_paths_;
  std::filesystem::path reference_path_;
  ScanDeviationOptions options_;
  std::vector<std::filesystem::path> outputs_;
  ScratchFolder scratch_;
  RunOptions run_;
  ScanDeviationReport report_;

  std::optional<MeasuredInputs> inputs_;
  std::optional<ValueCells> map_;
  Double3 to_reference_{};  ///< added to positions: frames of meshes may be shifted
};

}  // namespace

ScanDeviationReport measure_deviation(const std::vector<std::filesystem::path>& inputs,
                                      const std::filesystem::path& reference,
                                      const ScanDeviationOptions& options,
                                      const std::vector<std::filesystem::path>& outputs) {
  return DeviationJob(inputs, reference, options, outputs).run();
}

Json to_json(const ScanDeviationReport& report, double tolerance) {
  Json out = to_json(report.table, tolerance);
  out["points"] = report.points;
  out["left_out"] = report.left_out;
  out["searched"] = report.searched;
  out["max_distance"] = report.max_distance;
  out["reference_faces"] = report.reference_faces;
  if (tolerance >= 0.0) out["tolerance"] = tolerance;
  return out;
}

}  // namespace tessera
