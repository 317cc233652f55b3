#include "stream/stages/coverage/seen_stages.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include "kernels/coverage/column_marks.h"
#include "kernels/coverage/nearest_points.h"
#include "octree/portable_math.h"
#include "stream/files/direct_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/external_sort.h"
#include "stream/files/json.h"
#include "stream/files/record_file.h"
#include "stream/files/task_files.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/serial_stage.h"

namespace tessera {
namespace {

constexpr const char* kSpacingFile = "seen/spacing.json";
constexpr std::size_t kSites = 512;  ///< places where the spacing is looked at
/// Points that are looked at, nearly: the share of them that the mesh holds comes out to less than a thousandth (one sigma).
constexpr std::uint64_t kSampled = 1u << 15;
/// Cells around what is looked at. Points farther apart than the spacing that goes with it, the support of no surface
/// reaches across.
constexpr int kMaxSeenHalo = 16;
constexpr double kMaxSpacing = (kMaxSeenHalo - 1) / kConfirmingReach;
constexpr int kMinNeighbour = 3;
constexpr int kSiteHalo = 6;               ///< a sixth neighbour of that spacing lies within
constexpr std::uint64_t kPointBytes = 52;  ///< of a block while it is loaded, and its cubes
constexpr std::uint64_t kSeenFixedBytes = std::uint64_t{6} << 20;
constexpr std::uint64_t kBrickColumnBytes = 12 * 12 * 2 * sizeof(ColumnCounts);
constexpr std::uint64_t kSeenSortBytes = std::uint64_t{4} << 20;
constexpr std::size_t kSeenBuffer = std::size_t{1} << 18;
constexpr std::size_t kSeenPage = 4096;  ///< records read at a time

std::string seen_sample_part(std::size_t task) {
  return "seen/" + task_file_stem(task) + ".sample";
}
std::string seen_columns_part(std::size_t task) {
  return "seen/" + task_file_stem(task) + ".columns";
}

PointStore scan_points(const JobState& state) {
  return PointStore(list_task_files(state.work / kScanPointFolder, kPointExtension));
}

Int3 brick_corner(std::uint64_t key) {
  const Int3 at = brick_of_key(key);
  return {at[0] * kBrickCells, at[1] * kBrickCells, at[2] * kBrickCells};
}

/// Most points that a brick is loaded with.
std::uint64_t points_with_halo(std::span<const BrickEntry> bricks, const BrickEntry& brick) {
  const Int3 at = brick_of_key(brick.key);
  std::uint64_t points = 0;
  for (int d = 0; d < 27; ++d) {
    const Int3 n = {at[0] + d % 3 - 1, at[1] + d / 3 % 3 - 1, at[2] + d / 9 - 1};
    if (n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
    // A neighbour lends at most the quarter of its blocks that lie within kMaxSeenHalo of the face.
    if (const BrickEntry* e = find_brick(bricks, brick_key(n))) points += d == 13 ? e->points : e->points / 4;
  }
  return points;
}

std::uint64_t most_points_around(std::span<const BrickEntry> bricks) {
  std::uint64_t points = 0;
  for (const BrickEntry& brick : bricks) points = std::max(points, points_with_halo(bricks, brick));
  return points;
}

/// How many places are looked at together: what they load stays within a few MiB, but of one.
std::size_t looks_at_once(std::uint64_t points) {
  constexpr std::uint64_t kBytes = std::uint64_t{4} << 20, kMost = 64;
  return static_cast<std::size_t>(
      std::clamp<std::uint64_t>(kBytes / std::max<std::uint64_t>(1, points * kPointBytes), 1, kMost));
}

class SeenSpacingStage : public SerialStage {
 public:
  explicit SeenSpacingStage(const JobState& state) : points_(scan_points(state)) {
    // Points that merged count as neighbours too: of a scan on a coarse grid each stands for several.
    const double merged = static_cast<double>(points_.point_count()) /
                          static_cast<double>(std::max<std::uint64_t>(1, Plan::of_work(state.work).points()));
    neighbour_ = std::clamp(static_cast<int>(std::floor(kSpacingNeighbour * merged + 0.5)), kMinNeighbour,
                            kSpacingNeighbour);
  }

  std::string name() const override { return "seen-spacing"; }
  std::uint64_t units() const override { return kSites; }
  std::string unit_name() const override { return "places"; }
  std::uint64_t finish_bytes() const override { return seen_spacing_bytes(points_.bricks()); }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const std::uint64_t all = points_.point_count();
    std::vector<std::pair<std::size_t, std::size_t>> places;  // brick, index of a point in it
    std::size_t brick = 0;
    std::uint64_t before = 0;  // points of bricks before it
    const std::uint64_t sites = std::min<std::uint64_t>(kSites, all);
    for (std::uint64_t site = 0; site < sites; ++site) {
      const std::uint64_t index = all / sites * site + all % sites * site / sites;
      while (index >= before + points_.bricks()[brick].points) before += points_.bricks()[brick++].points;
      places.emplace_back(brick, static_cast<std::size_t>(index - before));
    }
    std::vector<double> squares(places.size());
    const std::size_t at_once = looks_at_once(most_points_around(points_.bricks()));
    parallel_for(at_once, [&](std::size_t first) {
      for (std::size_t i = first; i < places.size(); i += at_once) {
        context.check_stop();
        squares[i] = look(places[i].first, places[i].second);
        context.advance(1);
      }
    });
    Json found = {{"points", all}, {"spacing", 0.0}};
    const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
    if (!squares.empty()) {
      std::nth_element(squares.begin(), middle, squares.end());
      if (const double spacing = spacing_by_neighbour(*middle, neighbour_); spacing <= kMaxSpacing)
        found["spacing"] = spacing;
    }
    write_text(context.create(kSpacingFile), dump_json(found));
    return found;
  }

 private:
  /// The distance of a point to the neighbour that tells spacing, from a small box around it.
  double look(std::size_t brick, std::size_t index) const {
    const PointRecord p = points_.record(brick, index);
    Int3 origin{};
    for (std::size_t a = 0; a < 3; ++a) origin[a] = (p.q[a] >> (kQuantumBits + kLeafBits)) << kLeafBits;
    const PointBlock block =
        points_.load(origin, {kLeafCells, kLeafCells, kLeafCells}, kSiteHalo, {.normals = false});
    Float3 at{};
    for (std::size_t a = 0; a < 3; ++a)
      at[a] = static_cast<float>(p.q[a] - (origin[a] << kQuantumBits)) / kQuantaPerCell;
    const NearestPoints nearest(block.x, block.y, block.z, 1.0);
    std::vector<NearestPoints::Neighbour> found;
    const auto wanted = static_cast<std::size_t>(neighbour_) + 1;  // with the point itself
    nearest.find(at, wanted, kSiteHalo, found);
    // Farther than the box shows: too sparse to count but as that.
    return found.size() == wanted ? found.back().square : kSiteHalo * kSiteHalo * 4.0;
  }

  PointStore points_;
  int neighbour_ = kSpacingNeighbour;
};

class SeenStage : public Stage {
 public:
  explicit SeenStage(const JobState& state)
      : state_(state),
        seen_(SeenScan::of_work(state.work)),
        axes_(ViewAxes::along(reconstruct_options(state).up.value_or(Double3{0, 0, 1}))),
        points_(scan_points(state)) {}

  std::string name() const override { return "seen"; }
  std::size_t task_count() const override { return seen_.spacing > 0.0 ? points_.file_count() : 0; }
  std::uint64_t units() const override { return seen_.spacing > 0.0 ? points_.point_count() : 0; }
  std::string unit_name() const override { return "points"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = points_.file_range(task);
    return seen_task_bytes(points_.bricks(), first, last);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    std::vector<ColumnCounts> columns;
    ColumnCounter counter;
    DirectFile samples(context.create(seen_sample_part(task)), kSeenBuffer);
    std::uint64_t looked_at = 0, kept = 0;
    const auto [first, last] = points_.file_range(task);
    for (std::size_t b = first; b < last; ++b) {
      context.check_stop();
      const BrickEntry& brick = points_.bricks()[b];
      const Int3 corner = brick_corner(brick.key);
      const int halo = static_cast<int>(std::ceil(kConfirmingReach * seen_.spacing)) + 1;
      const PointBlock block =
          points_.load(corner, {kBrickCells, kBrickCells, kBrickCells}, halo, {.normals = false});
      std::vector<std::uint32_t> sample;
      for (std::uint32_t i = 0; i < block.size(); ++i) {
        if (!in_core(block, i)) continue;
        const Int3 q = quanta(block, i, corner);
        counter.add(static_cast<std::uint32_t>(q[axes_.u] / seen_.column_edge),
                    static_cast<std::uint32_t>(q[axes_.v] / seen_.column_edge), columns);
        if (in_sample(q)) sample.push_back(i);
      }
      looked_at += sample.size();
      kept += keep_confirmed(block, sample, corner, samples);
      context.count_read(block.size() * sizeof(PointRecord));
      context.advance(brick.points);
    }
    counter.flush(columns);
    combine_columns(columns);
    DirectFile file(context.create(seen_columns_part(task)), kSeenBuffer);
    file.write(columns.data(), columns.size() * sizeof(ColumnCounts));
    context.count_written(file.finish() + samples.finish());
    return {{"looked_at", looked_at}, {"confirmed", kept}};
  }

  std::uint64_t finish_bytes() const override { return seen_finish_bytes(); }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    if (seen_.spacing == 0.0) return {{"measured", false}};
    std::uint64_t looked_at = 0, confirmed = 0;
    for (const Json& s : summaries) {
      looked_at += s.at("looked_at").get<std::uint64_t>();
      confirmed += s.at("confirmed").get<std::uint64_t>();
    }
    DirectFile samples(context.create(kSeenSampleFile), kSeenBuffer);
    for (std::size_t t = 0; t < summaries.size(); ++t)
      for_each_page<Int3>(state_.work / seen_sample_part(t), kSeenPage,
                          [&](std::span<const Int3> q) { samples.write(q.data(), q.size() * sizeof(Int3)); });
    context.count_written(samples.finish());
    const std::uint64_t columns = join_columns(summaries.size(), context);
    return {{"measured", true}, {"looked_at", looked_at}, {"confirmed", confirmed}, {"columns", columns}};
  }

  std::vector<std::string> obsolete() const override {
    std::vector<std::string> names;
    for (std::size_t t = 0; t < task_count(); ++t)
      names.push_back(seen_sample_part(t)), names.push_back(seen_columns_part(t));
    return names;
  }

 private:
  static bool in_core(const PointBlock& block, std::size_t i) {
    const auto inside = [](float x) { return x >= 0.0f && x < static_cast<float>(kBrickCells); };
    return inside(block.x[i]) && inside(block.y[i]) && inside(block.z[i]);
  }
  static Int3 quanta(const PointBlock& block, std::size_t i, const Int3& corner) {
    const auto q = [&](float x, std::size_t a) {
      return corner[a] * kQuantaPerCell + static_cast<std::int32_t>(x * kQuantaPerCell);
    };
    return {q(block.x[i], 0), q(block.y[i], 1), q(block.z[i], 2)};
  }
  bool in_sample(const Int3& q) const {
    const std::uint64_t place =
        mix(mix(static_cast<std::uint64_t>(q[0]) << 32 | static_cast<std::uint64_t>(q[1])) ^
            static_cast<std::uint64_t>(q[2]));
    return place <= ~std::uint64_t{0} / seen_.stride;
  }

  std::uint64_t keep_confirmed(const PointBlock& block, const std::vector<std::uint32_t>& sample,
                               const Int3& corner, DirectFile& out) const {
    if (sample.empty()) return 0;
    std::uint64_t kept = 0;
    const NearestPoints nearest(block.x, block.y, block.z, 2.0 * seen_.spacing);
    std::vector<NearestPoints::Neighbour> found;
    std::array<Float3, kConfirmingPoints> at{};
    for (const std::uint32_t i : sample) {
      const Float3 p = {block.x[i], block.y[i], block.z[i]};
      nearest.find(p, kConfirmingPoints, kConfirmingReach * seen_.spacing, found);
      if (found.size() < kConfirmingPoints) continue;
      for (std::size_t n = 0; n < kConfirmingPoints; ++n) {
        const std::uint32_t other = found[n].point;
        at[n] = {block.x[other], block.y[other], block.z[other]};
      }
      if (!confirmed(p, at, seen_.spacing)) continue;
      const Int3 q = quanta(block, i, corner);
      out.write(q.data(), sizeof q);
      ++kept;
    }
    return kept;
  }

  /// Columns of all tasks together. \returns how many hold enough points
  std::uint64_t join_columns(std::size_t tasks, TaskContext& context) const {
    const auto less = [](const ColumnCounts& a, const ColumnCounts& b) {
      return a.key != b.key ? a.key < b.key : a.plane < b.plane;
    };
    ExternalSort<ColumnCounts, decltype(less)> sort(state_.work, kSeenSortBytes, less);
    for (std::size_t t = 0; t < tasks; ++t)
      for_each_page<ColumnCounts>(state_.work / seen_columns_part(t), kSeenPage,
                                  [&](std::span<const ColumnCounts> blocks) {
                                    context.check_stop();
                                    for (const ColumnCounts& block : blocks) sort.add(block);
                                  });
    DirectFile file(context.create(kSeenColumnsFile), kSeenBuffer);
    std::uint64_t columns = 0;
    ColumnCounts last{~std::uint64_t{0}, {}};
    const auto hand_out = [&] {
      const ColumnMask mask = {last.key, last.enough()};
      columns += static_cast<std::uint64_t>(std::popcount(mask.columns));
      if (mask.columns != 0) file.write(&mask, sizeof mask);
    };
    sort.drain([&](std::span<const ColumnCounts> blocks) {
      context.check_stop();
      for (const ColumnCounts& block : blocks) {
        if (block.key == last.key) {
          merge_columns(last, block);
          continue;
        }
        hand_out();
        last = block;
      }
    });
    hand_out();
    context.count_written(file.finish());
    return columns;
  }

  JobState state_;
  SeenScan seen_;
  ViewAxes axes_;
  PointStore points_;
};

}  // namespace

SeenScan SeenScan::of_work(const std::filesystem::path& work) {
  const Json found = parse_json(read_text(work / kSpacingFile));
  SeenScan seen;
  seen.spacing = found.at("spacing").get<double>();
  seen.points = found.at("points").get<std::uint64_t>();
  seen.stride = (seen.points + kSampled - 1) / kSampled;
  seen.column_edge = std::max(
      kQuantaPerCell, static_cast<std::int32_t>(std::floor(4.0 * seen.spacing * kQuantaPerCell + 0.5)));
  return seen;
}

std::uint64_t seen_spacing_bytes(std::span<const BrickEntry> bricks) {
  const std::uint64_t points = most_points_around(bricks);
  return looks_at_once(points) * points * kPointBytes + kSeenFixedBytes;
}

std::uint64_t seen_task_bytes(std::span<const BrickEntry> bricks, std::size_t first, std::size_t last) {
  std::uint64_t points = 0;
  for (std::size_t b = first; b < last; ++b) points = std::max(points, points_with_halo(bricks, bricks[b]));
  return points * kPointBytes + (last - first) * kBrickColumnBytes + kSeenFixedBytes;
}

std::uint64_t seen_finish_bytes() {
  return kSeenSortBytes + kSeenFixedBytes;
}

std::unique_ptr<Stage> make_seen_spacing_stage(const JobState& state) {
  return std::make_unique<SeenSpacingStage>(state);
}
std::unique_ptr<Stage> make_seen_stage(const JobState& state) {
  return std::make_unique<SeenStage>(state);
}

}  // namespace tessera
