#include "stream/survey/classify_scan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/scratch_folder.h"
#include "stream/formats/points/las_copy.h"
#include "stream/formats/points/point_writer.h"
#include "stream/runtime/disk_space.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/survey/copc_copy.h"
#include "stream/survey/scan_set.h"

namespace tessera {
namespace {

/// In cells of so many points some have reached the ground, in forest too; with fewer than these the raster is mostly membrane.
constexpr double kPointsPerCell = 6.0, kMinPointsPerCell = 0.1;
/// Cells are widened step by step as long as that takes more than this share of them from what stands on the ground down to
/// it. Of the samples of the ISPRS filter test, city and country, the first step takes 0.1 at most, of a forest of as many points
/// to a cell 0.2. And from what height over the lowest place around on, metres.
constexpr double kMinDrop = 0.12, kHigh = 4.0;
constexpr std::int32_t kMaxFactor = 8;
constexpr double kMaxWindowCells = 256.0;
/// Of roofs, metres.
constexpr double kRoofHeight = 2.0, kRoofResidual = 0.15;
/// Of water: cells of its square, points of its cells to those of the middle one of all, steps of height.
constexpr int kMinWaterCells = 5;
constexpr double kMaxWaterCells = 64.0, kSparseShare = 0.5, kMaxWaterRelief = 0x1p28;
constexpr double kMaxPitSlope = 1e5;  ///< steeper than anything
/// Tiles in memory at least, of either pass.
constexpr std::uint64_t kMinCache = std::uint64_t{8} << 20;

/// Lengths in units of the scan.
ClassifyOptions with_defaults(ClassifyOptions o, double metre) {
  const auto set = [&](double& length, double in_metres) {
    if (length == 0.0) length = in_metres * metre;
  };
  set(o.window, 18.0), set(o.threshold, 0.5), set(o.scalar, 1.25), set(o.noise, 200.0);
  set(o.water_width, 10.0), set(o.water_relief, 0.3);
  if (o.threads == 0) o.threads = core_count();
  return o;
}

/// \param factor  of the cells that heights were gathered in
GroundRules ground_rules(const ClassifyOptions& o, double cell, std::int32_t factor) {
  GroundRules rules;
  const double wide = cell * factor;
  const double window = std::ceil(o.window / wide);
  if (!(window <= kMaxWindowCells))
    throw UsageError(fmt::format("--window {:g}: is {:.0f} cells of {:g}, at most {:.0f} are possible",
                                 o.window, window, wide, kMaxWindowCells));
  rules.max_window = std::max(1, static_cast<int>(window));
  rules.slope = o.slope;
  rules.tolerance = o.threshold / wide;
  rules.slope_tolerance = o.scalar / wide;
  rules.low_slope = std::min(o.pit_slope, kMaxPitSlope);
  return rules;
}

/// The widest that water of so many points to a cell could need is told before these are counted.
/// \param typical  points of a cell, 0 = not known yet
WaterRules water_rules(const ClassifyOptions& o, double cell, std::int32_t factor, std::uint32_t typical) {
  WaterRules rules;
  if (!o.water || o.ground_only) return rules;
  const double wide = cell * factor, width = std::ceil(o.water_width / wide);
  if (!(width <= kMaxWaterCells))
    throw UsageError(fmt::format("--water-width {:g}: is {:.0f} cells of {:g}, at most {:.0f} are possible",
                                 o.water_width, width, wide, kMaxWaterCells));
  rules.width = std::max(kMinWaterCells, static_cast<int>(width));
  rules.max_count = kSparseShare * typical;
  rules.density = o.water_density;
  rules.relief = static_cast<std::int32_t>(
      std::min(std::ceil(o.water_relief / cell * ScanCells::kSteps), kMaxWaterRelief));
  return rules;
}

/// One call of classify_scans().
class ScanJob {
 public:
  ScanJob(const std::vector<ScanToClassify>& files, const ClassifyOptions& options)
      : files_(files), set_(open_scan_set(inputs(files))) {
    metre_ = set_.metres > 0.0 ? 1.0 / set_.metres : 1.0;
    options_ = with_defaults(options, metre_);
    cells_.cell = options_.cell > 0.0 ? options_.cell : metre_;
  }

  ClassifyReport run() {
    MemoryBudget budget(options_.memory_bytes, resident_bytes());
    plan(budget);
    require_room();
    const ScratchFolder scratch(options_.temp, "classify");
    WorkerPool pool(options_.threads);
    LowestHeights lowest(cells_, scratch.path() / "lowest");
    gather(lowest, pool);
    const std::int32_t factor = options_.cell > 0.0 ? 1 : factor_for(lowest);
    const std::uint32_t typical = options_.water ? lowest.median_count(factor) : 0;
    GroundTiles ground(lowest, factor, ground_rules(options_, cells_.cell, factor), roof_rules(),
                       water_rules(options_, cells_.cell, factor, typical), scratch.path() / "ground");
    require_disk(std::array{DiskNeed{scratch.path(),
                                     2 * lowest.tiles().size() * GroundTiles::tile_bytes() /
                                         static_cast<std::uint64_t>(factor * factor),
                                     "the raster of the ground"}},
                 kLargerDisk);
    ground.find(lowest, pool, budget);
    ClassifyReport report;
    report.cell = cells_.cell * factor, report.metres = set_.metres;
    report.cells = ground.cells(), report.empty = ground.empty();
    ground.hold(last_cache_);
    write(ground, pool, report);
    return report;
  }

 private:
  static std::vector<std::filesystem::path> inputs(const std::vector<ScanToClassify>& files) {
    std::vector<std::filesystem::path> paths;
    for (const ScanToClassify& file : files) paths.push_back(file.input);
    return paths;
  }
  RoofRules roof_rules() const {
    if (options_.ground_only) return {};
    return {kRoofHeight * metre_ / cells_.step(), kRoofResidual * metre_ / cells_.step()};
  }
  std::int32_t factor_for(const LowestHeights& lowest) const {
    const auto wide = [&](double points) {
      const double factor = std::ceil(std::sqrt(points / lowest.density()));
      return static_cast<std::int32_t>(std::clamp(factor, 1.0, static_cast<double>(kMaxFactor)));
    };
    const std::int32_t min = wide(kMinPointsPerCell), max = wide(kPointsPerCell);
    const auto rise = static_cast<std::int32_t>(kHigh * metre_ / cells_.step());
    std::int32_t factor = 1;
    if (max > 1) {
      constexpr auto kFactors = LowestHeights::kReliefFactors;
      const auto high = lowest.high_shares(rise);
      for (std::size_t k = 1; k < kFactors.size() && kFactors[k] <= max && high[k - 1] - high[k] > kMinDrop;
           ++k)
        factor = kFactors[k];
    }
    return std::max(factor, min);
  }

  /// Of a pass over points, without its tiles.
  std::uint64_t pass_bytes(std::size_t slots, bool copies) const {
    const int busy = std::min(static_cast<int>(slots), options_.threads);
    std::uint64_t most = 0;
    for (std::size_t i = 0; i < files_.size(); ++i) {
      const LasRecords& scan = set_.scans[i];
      const std::uint64_t placed = copies ? ClassWriter::kPlacedBytes : sizeof(LowestHeights::Sample);
      std::uint64_t bytes = scan.read_bytes(slots, busy) + slots * scan.batch_records() * placed;
      if (copies)
        bytes += is_copc_name(files_[i].output)
                     ? CopcCopy::bytes(scan)
                     : LasCopy::bytes(scan, LasCopy::is_compressed(files_[i].output), options_.threads);
      most = std::max(most, bytes);
    }
    return most;
  }

  /// Shares the cap out. \throws ResourceError when it cannot suffice
  void plan(const MemoryBudget& budget) {
    const auto need = [&](std::size_t slots) {
      return std::max(pass_bytes(slots, false), pass_bytes(slots, true)) + kMinCache;
    };
    constexpr double kUnbounded = 1e9;
    const auto cells = [&](double length) { return length > 0.0 ? length / cells_.cell + 2.0 : kUnbounded; };
    const std::uint64_t block = GroundTiles::block_bytes(ground_rules(options_, cells_.cell, 1),
                                                         water_rules(options_, cells_.cell, 1, 0),
                                                         cells(set_.width), cells(set_.height));
    budget.require(std::max(block, need(1)), fmt::format("classify with cells of {:g} and a window of {:g}",
                                                         cells_.cell, options_.window));
    slots_ = 2 * static_cast<std::size_t>(options_.threads);
    while (slots_ > 1 && need(slots_) + budget.capacity() / 4 > budget.capacity()) --slots_;
    first_cache_ = budget.capacity() - pass_bytes(slots_, false);
    last_cache_ = budget.capacity() - pass_bytes(slots_, true);
  }

  /// Outputs must fit beside each other.
  void require_room() const {
    std::vector<DiskNeed> needs;
    for (std::size_t i = 0; i < files_.size(); ++i) {
      const LasRecords& scan = set_.scans[i];
      const bool to_laz = LasCopy::is_compressed(files_[i].output);
      const std::uint64_t records = scan.points() * scan.record_bytes();
      const std::uint64_t bytes = to_laz == scan.header().compressed ? scan.file().size()
                                  : to_laz                           ? records / 4
                                                                     : records;
      const std::uint64_t waiting = is_copc_name(files_[i].output) ? 3 * (records + 16 * scan.points()) : 0;
      needs.push_back({std::filesystem::absolute(files_[i].output).parent_path(), bytes + waiting,
                       files_[i].output.string()});
    }
    require_disk(needs, "choose a larger disk by -o");
  }

  void gather(LowestHeights& lowest, WorkerPool& pool) const {
    lowest.hold(first_cache_);
    std::vector<std::vector<LowestHeights::Sample>> samples(slots_);
    pool.run_here([&] {
      for (const LasRecords& scan : set_.scans)
        scan.read(
            slots_,
            [&](LasBatch& batch) { lowest.place(scan, batch, options_.all_points, samples[batch.slot]); },
            [&](LasBatch& batch) { lowest.add(samples[batch.slot]); });
    });
    lowest.finish();
    if (lowest.points() == 0)
      throw EmptyError(files_.front().input.string() + (files_.size() > 1 ? " and the others" : "") +
                       ": all points are withheld, synthetic or noise; --all-points takes them too");
    trim_allocator();
  }

  void write(GroundTiles& ground, WorkerPool& pool, ClassifyReport& report) const {
    HeightClasses heights;
    heights.medium *= metre_ / cells_.step(), heights.high *= metre_ / cells_.step();
    heights.noise = options_.noise / cells_.step();
    heights.ground_only = options_.ground_only;
    ClassWriter writer(cells_, ground, heights, options_.all_points);
    pool.run_here([&] {
      for (std::size_t i = 0; i < files_.size(); ++i)
        report.scans.push_back(writer.write(set_.scans[i], files_[i].output, slots_, options_.threads));
    });
  }

  const std::vector<ScanToClassify>& files_;
  ScanSet set_;
  ClassifyOptions options_;
  double metre_ = 1.0;  ///< in units of the scan
  ScanCells cells_;
  std::size_t slots_ = 1;
  std::uint64_t first_cache_ = 0, last_cache_ = 0;
};

Json counts(const ClassifiedScan& scan) {
  Json classes = Json::object();
  for (std::size_t k = 0; k < scan.classes.size(); ++k)
    if (scan.classes[k] > 0) classes[std::to_string(k)] = scan.classes[k];
  return {{"points", scan.points}, {"kept", scan.kept}, {"classes", classes}};
}

}  // namespace

ClassifiedScan ClassifyReport::total() const {
  ClassifiedScan sum;
  for (const ClassifiedScan& scan : scans) {
    sum.points += scan.points, sum.bytes += scan.bytes, sum.kept += scan.kept;
    for (std::size_t k = 0; k < sum.classes.size(); ++k) sum.classes[k] += scan.classes[k];
  }
  return sum;
}

ClassifyReport classify_scans(const std::vector<ScanToClassify>& scans, const ClassifyOptions& options) {
  return ScanJob(scans, options).run();
}

Json to_json(const ClassifyReport& report) {
  Json out = counts(report.total());
  out["cell"] = report.cell;
  if (report.metres > 0.0) out["metres_per_unit"] = report.metres;
  out["cells"] = report.cells, out["cells_empty"] = report.empty;
  out["files"] = Json::array();
  for (const ClassifiedScan& scan : report.scans) {
    Json file = counts(scan);
    file["input"] = json_text(scan.input), file["output"] = json_text(scan.output),
    file["bytes"] = scan.bytes;
    out["files"].push_back(file);
  }
  return out;
}

}  // namespace tessera
