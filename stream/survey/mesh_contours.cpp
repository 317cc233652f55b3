#include "stream/survey/mesh_contours.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <mutex>
#include <optional>
#include <tuple>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kernels/survey/contour_chains.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/file_extension.h"
#include "stream/files/path_text.h"
#include "stream/files/scratch_folder.h"
#include "stream/files/spill_file.h"
#include "stream/import/import_mesh.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/survey/gdal_program.h"

namespace tessera {
namespace {

constexpr double kMaxLevels = 1e6;
/// Crossings of faces and levels that are chained at a time, and what one of them takes meanwhile.
constexpr std::uint64_t kStepsAtATime = std::uint64_t{1} << 16, kBytesPerStep = 160;

/// A chain whose points lie in the file.
struct ChainRecord {
  std::int64_t level = 0;
  EdgeName begin{}, end{}, smallest{};
  std::uint64_t first_point = 0;
  std::uint32_t count = 0, smallest_at = 0;
  std::uint64_t closed = 0;
};
static_assert(sizeof(ChainRecord) == 80);

/// As tools/survey/gdal_export.cpp reads it, with the points behind it.
struct LineHeader {
  double elevation = 0.0;
  std::uint32_t index = 0, closed = 0;
  std::uint64_t count = 0;
};
static_assert(sizeof(LineHeader) == 24);

/// A line by its first chain.
struct ContourLine {
  std::int64_t level = 0;
  EdgeName name{};  ///< of its first edge
  std::size_t chain = 0;
  bool closed = false;
};

/// Chains of all patches, on disk.
class ChainFile {
 public:
  explicit ChainFile(const std::filesystem::path& folder) : points_(folder), records_(folder) {}
  void add(const std::vector<ContourChain>& chains) {
    const std::lock_guard lock(mutex_);
    for (const ContourChain& c : chains) {
      ChainRecord r{c.level,       c.begin,           c.end,
                    c.smallest,    point_count_,      static_cast<std::uint32_t>(c.points.size()),
                    c.smallest_at, c.closed ? 1u : 0u};
      points_.append(c.points.data(), c.points.size() * sizeof(Double2));
      records_.append(&r, sizeof r);
      point_count_ += c.points.size(), ++count_;
    }
  }
  std::uint64_t count() const { return count_; }
  std::vector<ChainRecord> records() const {
    std::vector<ChainRecord> all(count_);
    if (!all.empty()) records_.read_at(0, all.data(), count_ * sizeof(ChainRecord));
    return all;
  }
  void read_points(const ChainRecord& r, Double2* to, std::size_t count) const {
    if (count > 0) points_.read_at(r.first_point * sizeof(Double2), to, count * sizeof(Double2));
  }

 private:
  SpillFile points_, records_;
  std::uint64_t point_count_ = 0, count_ = 0;
  std::mutex mutex_;
};

/// Chains of the whole mesh, and which one goes on where another ends.
class ChainGraph {
 public:
  /// Of one chain, while the graph is made.
  static constexpr std::uint64_t kBytes = sizeof(ChainRecord) + sizeof(ContourLine) + 2 * sizeof(std::size_t);

  explicit ChainGraph(const ChainFile& file) : file_(file), chains_(file.records()) {
    std::sort(chains_.begin(), chains_.end(), [](const ChainRecord& a, const ChainRecord& b) {
      return std::tie(a.level, a.begin, a.end) < std::tie(b.level, b.begin, b.end);
    });
    next_.assign(chains_.size(), kNone);
    std::vector<std::uint8_t> has_previous(chains_.size()), done(chains_.size());
    for (std::size_t c = 0; c < chains_.size(); ++c) {
      if (chains_[c].closed) continue;
      const auto found = std::lower_bound(chains_.begin(), chains_.end(), chains_[c],
                                          [](const ChainRecord& a, const ChainRecord& b) {
                                            return std::tie(a.level, a.begin) < std::tie(b.level, b.end);
                                          });
      if (found == chains_.end() || found->level != chains_[c].level || found->begin != chains_[c].end)
        continue;
      next_[c] = static_cast<std::size_t>(found - chains_.begin());
      has_previous[next_[c]] = 1;
    }
    for (std::size_t c = 0; c < chains_.size(); ++c)
      if (!has_previous[c] && !chains_[c].closed) {
        lines_.push_back({chains_[c].level, chains_[c].begin, c, false});
        for (std::size_t k = c; k != kNone; k = next_[k]) done[k] = 1;
      }
    for (std::size_t c = 0; c < chains_.size(); ++c) {
      if (done[c]) continue;
      std::size_t first = c;
      for (std::size_t k = c; k != kNone && !done[k]; k = next_[k]) {
        done[k] = 1;
        if (chains_[k].smallest < chains_[first].smallest) first = k;
      }
      lines_.push_back({chains_[c].level, chains_[first].smallest, first, true});
    }
    std::sort(lines_.begin(), lines_.end(), [](const ContourLine& a, const ContourLine& b) {
      return std::tie(a.level, a.name) < std::tie(b.level, b.name);
    });
  }

  const std::vector<ContourLine>& lines() const { return lines_; }

  std::uint64_t point_count(const ContourLine& line) const {
    std::uint64_t count = 0;
    for_chains(line, [&](const ChainRecord& c) { count += c.count; });
    return count;
  }

  /// Of closed lines the first point is not repeated.
  std::vector<Double2> points(const ContourLine& line) const {
    std::vector<Double2> all;
    all.reserve(point_count(line));
    for_chains(line, [&](const ChainRecord& c) {
      // Where one chain ends the next one begins.
      const bool joins = !c.closed && (line.closed || next_[index_of(c)] != kNone);
      const std::size_t count = c.count - (joins ? 1 : 0), at = all.size();
      all.resize(at + count);
      file_.read_points(c, all.data() + at, count);
    });
    if (line.closed) {
      const std::size_t turn = chains_[line.chain].smallest_at % all.size();
      std::rotate(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(turn), all.end());
    }
    remove_spikes(all, line.closed);
    return all;
  }

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  std::size_t index_of(const ChainRecord& c) const { return static_cast<std::size_t>(&c - chains_.data()); }
  template <class Use>
  void for_chains(const ContourLine& line, const Use& use) const {
    std::size_t k = line.chain;
    do {
      use(chains_[k]);
      k = next_[k];
    } while (k != kNone && k != line.chain);
  }

  const ChainFile& file_;
  std::vector<ChainRecord> chains_;
  std::vector<std::size_t> next_;
  std::vector<ContourLine> lines_;
};

void chain_patch(const MeshStore& store, std::size_t patch, const ContourLevels& levels, ChainFile& file) {
  const MeshPatchEntry& entry = store.patches()[patch];
  const std::int64_t end = levels.above(entry.box.high[2]);
  std::int64_t first = levels.above(entry.box.low[2]);
  if (first >= end) return;
  const MeshBlock block = store.load(std::array{patch});
  const auto at_a_time = static_cast<std::int64_t>(std::max<std::uint64_t>(1, kStepsAtATime / entry.faces));
  for (; first < end; first += at_a_time) {
    throw_if_stopped();
    file.add(contour_chains(block, levels, first, std::min(end, first + at_a_time)));
  }
}

std::uint64_t chain_bytes(const MeshPatchEntry& entry) {
  return MeshStore::block_bytes(entry.vertices, entry.faces) +
         kBytesPerStep * std::max<std::uint64_t>(kStepsAtATime, entry.faces);
}

}  // namespace

std::string line_format(const std::filesystem::path& output) {
  const std::string extension = lower_extension(output);
  if (extension == ".gpkg") return "GPKG";
  if (extension == ".geojson" || extension == ".json") return "GeoJSON";
  if (extension == ".dxf") return "DXF";
  throw UsageError(output.string() + ": lines are written as .gpkg, .geojson or .dxf");
}

ContourReport write_contours(const std::filesystem::path& mesh, const ContourOptions& options,
                             const std::filesystem::path& output) {
  gdal_program();  // before the work
  const ScratchFolder scratch(options.temp, "contours");
  RunOptions run;
  run.memory_bytes = options.memory_bytes;
  run.threads = options.threads > 0 ? options.threads : core_count();
  const MeshStore store = import_mesh(mesh, scratch.path(), "mesh", run, throw_if_stopped);
  const ContourLevels levels{0.0, options.interval};
  const double low = store.box().low[2], high = store.box().high[2];
  if (!((high - low) / options.interval <= kMaxLevels &&
        std::max(std::abs(low), std::abs(high)) / options.interval < 0x1p52))
    throw UsageError(
        fmt::format("--interval {:g}: makes {:.3g} levels of {:.6g} to {:.6g}, at most {:.3g} are possible",
                    options.interval, (high - low) / options.interval, low, high, kMaxLevels));

  WorkerPool pool(run.threads);
  MemoryBudget budget(options.memory_bytes, resident_bytes());
  ChainFile file(scratch.path());
  pool.run_tasks(
      store.patches().size(), [&](std::size_t p) { return chain_bytes(store.patches()[p]); }, budget,
      [&](std::size_t p) {
        throw_if_stopped();
        chain_patch(store, p, levels, file);
      });
  trim_allocator();

  const std::uint64_t graph_bytes = file.count() * ChainGraph::kBytes;
  budget.require(graph_bytes, "contours: the ends of lines");
  const ChainGraph graph(file);
  ContourReport report;
  const std::filesystem::path raw = scratch.path() / "lines.raw";
  DirectFile lines(raw);
  for (const ContourLine& line : graph.lines()) {
    throw_if_stopped();
    budget.require(graph_bytes + 2 * sizeof(Double2) * graph.point_count(line), "contours: the longest line");
    const std::vector<Double2> points = graph.points(line);
    if (points.empty()) continue;
    LineHeader header;
    header.elevation = levels.height(line.level);
    header.index = options.index > 0 && line.level % options.index == 0 ? 1 : 0;
    header.closed = line.closed ? 1 : 0;
    header.count = points.size();
    lines.write(&header, sizeof header);
    lines.write(points.data(), points.size() * sizeof(Double2));
    if (report.lines == 0) report.lowest = header.elevation;
    report.highest = header.elevation;
    ++report.lines, report.closed += header.closed, report.points += points.size();
  }
  lines.finish();
  if (report.lines == 0)
    throw EmptyError(fmt::format("{}: no multiple of {:g} lies between its heights, {:.6g} to {:.6g}",
                                 mesh.string(), options.interval, low, high));
  report.warnings =
      write_by_gdal(scratch.path(), "lines",
                    {{"raw", json_text(raw)}, {"format", line_format(output)}, {"crs", options.crs}},
                    options.memory_bytes, output);
  return report;
}

}  // namespace tessera
