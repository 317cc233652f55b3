#include "stream/survey/scan_deviation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/commands/convert_mesh.h"
#include "stream/files/file_extension.h"
#include "stream/files/json.h"
#include "stream/files/scratch_folder.h"
#include "stream/formats/points/las_copy.h"
#include "stream/import/crs_sidecar.h"
#include "stream/import/import_mesh.h"
#include "stream/meshes/mesh_weld.h"
#include "stream/render/render_scene.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"
#include "stream/survey/deviation_files.h"
#include "stream/survey/measured_points.h"
#include "stream/survey/point_distances.h"

namespace tessera {
namespace {

constexpr double kReachPerDiagonal = 0.1;
constexpr double kMostDiagonals = 1000.0;  ///< sums of squares have digits for no more
constexpr std::uint64_t kWorkShare = 4;    ///< a part in so many of the memory is for points on their way
/// Of reading points, and a file being written.
constexpr std::uint64_t kPassBytes = std::uint64_t{24} << 20;
constexpr const char* kWho = "deviate";

bool is_las_name(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  return extension == ".las" || extension == ".laz";
}

bool is_finite(const Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// What the first pass finds.
struct Extent {
  Double3 min{}, max{};
  std::uint64_t finite = 0;
  bool exact_in_float = true;
  void add(const Double3& p) {
    for (std::size_t a = 0; a < 3; ++a) {
      min[a] = finite == 0 ? p[a] : std::min(min[a], p[a]);
      max[a] = finite == 0 ? p[a] : std::max(max[a], p[a]);
      exact_in_float = exact_in_float && static_cast<double>(static_cast<float>(p[a])) == p[a];
    }
    ++finite;
  }
};

/// One call of measure_deviation().
class DeviationJob {
 public:
  DeviationJob(const std::vector<std::filesystem::path>& inputs, const std::filesystem::path& reference,
               const ScanDeviationOptions& options, const std::vector<std::filesystem::path>& outputs)
      : inputs_(inputs),
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
    to_reference_ = points_->shift - reference.info().shift;
    const std::uint64_t base = resident_bytes();
    const auto share = [&](std::uint64_t cap) { return MemoryBudget(cap, base).capacity() / kWorkShare; };
    const std::uint64_t work = share(run_.memory_bytes);
    PointDistances distances(reference, report_.max_distance, scratch_.path(), work);
    // Points on their way and the fullest cell are there at one time.
    const std::uint64_t cell = distances.fullest_bytes();
    const auto need = [&](std::uint64_t cap) { return std::max(cell, kPassBytes) + share(cap); };
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
                      inputs_.front().string(), report_.max_distance, reference_path_.string()));
    // Distances wait in half of the share, sorting takes the other.
    DeviationStatistics statistics(report_.max_distance, options_.tolerance, options_.areas, scratch_.path(),
                                   std::max<std::uint64_t>(work / 2, 1u << 20));
    pool.run_here([&] { write(distances, statistics); });
    report_.table = statistics.finish();
    report_.notices = points_->notices();
    if (file_) report_.bytes += file_->finish();
    return std::move(report_);
  }

 private:
  bool copies_records() const {
    return outputs_.size() == inputs_.size() && options_.colour_scale == 0.0 &&
           std::all_of(inputs_.begin(), inputs_.end(), is_las_name) &&
           std::all_of(outputs_.begin(), outputs_.end(), is_las_name);
  }

  /// What the inputs are refused for they shall be refused for before the work.
  void open_inputs() {
    if (!options_.areas.empty()) ClipPolygon::text_of_file(options_.areas);
    if (measures_vertices(inputs_.front())) {
      if (inputs_.size() > 1)
        throw UsageError(inputs_.front().string() + " is a mesh: meshes are measured one at a time");
      mesh_ = open_mesh_file(inputs_.front(), {.temp = scratch_.path()});
      if (!mesh_->shared_vertices())
        welded_ = std::make_unique<WeldedMesh>(
            *mesh_, WeldOptions{run_.memory_bytes / kWorkShare, scratch_.path(), throw_if_stopped});
      points_ = open_measured_vertices(welded_ ? *welded_ : *mesh_);
      points_->crs = crs_of_wkt(crs_of_mesh(inputs_.front()));
    } else if (copies_records()) {
      records_.reserve(inputs_.size());
      for (std::size_t i = 0; i < inputs_.size(); ++i) {
        records_.emplace_back(inputs_[i]);
        const LasCopy probe(records_.back(), outputs_[i], 1, kDeviationName);
      }
      points_ = open_measured_records(records_);
    } else {
      points_ = open_measured_scans(inputs_, options_.columns, slice_window());
    }
    const Crs other = crs_of_wkt(crs_of_mesh(reference_path_));
    if (other.geographic)
      throw InputError(reference_path_.string() + ": its coordinates are degrees, " + other.name +
                       "; deviations are lengths");
    if (points_->crs.known() && other.known() && !may_be_same(points_->crs, other))
      throw InputError(reference_path_.string() + ": is in " + other.name + ", the points are in " +
                       points_->crs.name + "; deviations are measured in one system");
  }

  /// Slices are read while neither cells nor their faces are there, beside points on their way, a file and what sorts.
  std::size_t slice_window() const {
    const std::uint64_t free = MemoryBudget(run_.memory_bytes, resident_bytes()).capacity() / 2;
    return std::clamp<std::size_t>(static_cast<std::size_t>(free / kSliceMemory), 1,
                                   static_cast<std::size_t>(run_.threads) + 1);
  }

  static Double3 position(const PointChunk& chunk, std::size_t i) {
    return {chunk.x[i], chunk.y[i], chunk.z[i]};
  }

  void deal(PointDistances& distances) {
    points_->read([&](const PointChunk& chunk) {
      for (std::size_t i = 0; i < chunk.size(); ++i) {
        const Double3 p = position(chunk, i);
        distances.add(p + to_reference_);
        if (is_finite(p)) extent_.add(p);
      }
    });
    report_.points = extent_.finite;
    // Records that are marked withheld come without a position.
    report_.left_out = points_->left_out + distances.count() - extent_.finite;
    if (extent_.finite == 0)
      throw EmptyError(inputs_.front().string() + (inputs_.size() > 1 ? " and the others" : "") +
                       ": there is no point to measure");
  }

  /// The second pass: every point with its distance.
  void write(PointDistances& distances, DeviationStatistics& statistics) {
    if (!records_.empty()) {
      for (std::size_t i = 0; i < records_.size(); ++i)
        write_records(records_[i], outputs_[i], distances, statistics);
      return require_all(distances);
    }
    if (!outputs_.empty()) file_ = create_file(outputs_.front());
    std::vector<double> values;
    PointChunk coloured;
    points_->read([&](const PointChunk& chunk) {
      values.clear();
      for (std::size_t i = 0; i < chunk.size(); ++i)
        values.push_back(next_value(position(chunk, i), distances, statistics));
      if (!file_) return;
      if (options_.colour_scale > 0.0) {
        coloured = chunk;
        coloured.rgba.clear();
        for (const double v : values) coloured.rgba.push_back(colour_of(v));
      }
      file_->add(options_.colour_scale > 0.0 ? coloured : chunk, values);
    });
    require_all(distances);
  }

  void write_records(const LasRecords& scan, const std::filesystem::path& output, PointDistances& distances,
                     DeviationStatistics& statistics) {
    LasCopy copy(scan, output, std::min(run_.threads, 2), kDeviationName);
    const std::size_t old_bytes = scan.record_bytes(), new_bytes = copy.record_bytes();
    std::vector<char> longer;
    constexpr std::size_t kSlots = 2;
    scan.read(
        kSlots, [](LasBatch&) {},
        [&](LasBatch& batch) {
          longer.resize(batch.count * new_bytes);
          for (std::size_t i = 0; i < batch.count; ++i) {
            const char* record = batch.records.data() + i * old_bytes;
            const double value = next_value(measured_position(scan, record), distances, statistics);
            char* to = longer.data() + i * new_bytes;
            std::copy_n(record, old_bytes, to);
            std::copy_n(reinterpret_cast<const char*>(&value), sizeof value, to + old_bytes);
          }
          copy.append(longer.data(), batch.count);
        });
    report_.bytes += copy.finish();
  }

  double next_value(const Double3& p, PointDistances& distances, DeviationStatistics& statistics) {
    if (given_ == distances.count()) throw_changed();
    ++given_;
    const PointDistance distance = distances.next();
    if (is_finite(p)) statistics.add(p, distance);
    return distance.value;
  }
  void require_all(const PointDistances& distances) const {
    if (given_ != distances.count()) throw_changed();
  }
  [[noreturn]] static void throw_changed() {
    throw InputError("an input changed while it was read; run the command again");
  }

  /// Grey where there is no deviation.
  std::uint32_t colour_of(double value) const {
    constexpr std::uint32_t kGrey = 0xff606060u;
    return std::isnan(value) ? kGrey : deviation_colour(value, options_.colour_scale, true);
  }

  std::unique_ptr<DeviationFile> create_file(const std::filesystem::path& output) {
    const std::string extension = lower_extension(output);
    if (extension == ".csv") return create_deviation_csv(output);
    const bool colour = points_->attributes.colour || options_.colour_scale > 0.0;
    MeshReader* const mesh = welded_ ? welded_.get() : mesh_.get();
    if (mesh != nullptr && extension == ".ply") return create_deviation_mesh(output, *mesh, colour);
    PointFileHeader header;
    header.attributes = points_->attributes;
    header.attributes.colour = colour;
    header.double_positions = !extent_.exact_in_float;
    if (is_las_name(output)) {
      header.attributes.normals = false;
      header.las_scale = fitting_las_scale(extent_.min, extent_.max);
      for (std::size_t a = 0; a < 3; ++a) header.las_offset[a] = std::floor(extent_.min[a]);
    }
    return create_deviation_points(output, header);
  }

  std::vector<std::filesystem::path> inputs_;
  std::filesystem::path reference_path_;
  ScanDeviationOptions options_;
  std::vector<std::filesystem::path> outputs_;
  ScratchFolder scratch_;
  RunOptions run_;
  ScanDeviationReport report_;

  std::unique_ptr<MeshReader> mesh_;
  std::unique_ptr<WeldedMesh> welded_;
  std::vector<LasRecords> records_;  ///< of files that are copied with a number more
  std::unique_ptr<MeasuredPoints> points_;
  Double3 to_reference_{};  ///< added to positions: frames of meshes may be shifted
  Extent extent_;
  std::uint64_t given_ = 0;
  std::unique_ptr<DeviationFile> file_;
};

}  // namespace

bool measures_vertices(const std::filesystem::path& input) {
  return converts_as_mesh(input, "mesh.ply");
}

void require_deviation_output(const std::filesystem::path& output) {
  const std::string extension = lower_extension(output);
  if (extension != ".las" && extension != ".laz" && extension != ".ply" && extension != ".csv")
    throw UsageError(output.string() + ": unknown extension '" + extension +
                     "' for deviations; use .las, .laz, .ply or .csv");
}

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
