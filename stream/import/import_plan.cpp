#include "stream/import/import_plan.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

/// Cells an edge of the root cube; the mesh lies in at most two root cubes an axis.
constexpr int kGridLevel = 6;
constexpr int kGrid = 2 << kGridLevel;
constexpr int kMaxBrickLevel = kMaxCellBits - kBrickBits - 1;

bool finite(const Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// Smallest power of two >= value, 1 for 0.
double power_of_two_above(double value) {
  if (!(value > 0.0)) return 1.0;
  int exponent = 0;
  const double mantissa = std::frexp(value, &exponent);
  return std::ldexp(1.0, mantissa > 0.5 ? exponent : exponent - 1);
}

/// A cell of a grid with vertices in it.
struct OccupiedCell {
  std::uint64_t code = 0;  ///< Morton
  std::uint64_t vertices = 0;
};

/// The count of the cell in which the middle vertex lies when cells are sorted by count.
std::uint64_t weighted_median(const std::vector<OccupiedCell>& cells, std::uint64_t vertices) {
  std::vector<std::uint64_t> counts;
  counts.reserve(cells.size());
  for (const OccupiedCell& cell : cells) counts.push_back(cell.vertices);
  std::sort(counts.begin(), counts.end());
  std::uint64_t below = 0;
  for (const std::uint64_t c : counts) {
    below += c;
    if (2 * below >= vertices) return c;
  }
  return 0;
}

/// Cells of the next coarser grid, ascending by code as these.
std::vector<OccupiedCell> parents_of(const std::vector<OccupiedCell>& cells) {
  std::vector<OccupiedCell> parents;
  for (const OccupiedCell& cell : cells) {
    if (parents.empty() || parents.back().code != cell.code >> 3) parents.push_back({cell.code >> 3, 0});
    parents.back().vertices += cell.vertices;
  }
  return parents;
}

}  // namespace

GridCells ImportPlan::bricks() const {
  Double3 origin;
  for (std::size_t a = 0; a < 3; ++a) origin[a] = static_cast<double>(info.lattice.origin_brick[a]);
  return {info.lattice.h * kBrickCells, origin, std::ldexp(2.0, brick_level)};
}

std::size_t ImportPlan::bucket_of_brick(std::uint64_t brick) const {
  const std::uint64_t cell = brick >> (3 * (brick_level - cell_level));
  return static_cast<std::size_t>(std::upper_bound(first_cell.begin(), first_cell.end(), cell) -
                                  first_cell.begin()) -
         1;
}

ImportPlan ImportPlan::measure(const MeshHeader& header, const VertexSource& vertices_of_file,
                               const std::function<void()>& check_stop, std::uint64_t brick_vertices) {
  ImportPlan plan;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Double3 low = {kInfinity, kInfinity, kInfinity};
  Double3 high = {-kInfinity, -kInfinity, -kInfinity};
  std::mutex mutex;
  vertices_of_file([&](std::span<const Double3> positions, std::span<const std::uint32_t>) {
    check_stop();
    Double3 lowest = {kInfinity, kInfinity, kInfinity};
    Double3 highest = {-kInfinity, -kInfinity, -kInfinity};
    std::uint64_t nonfinite = 0;
    for (const Double3& p : positions) {
      if (!finite(p)) {
        ++nonfinite;
        continue;
      }
      for (std::size_t a = 0; a < 3; ++a) {
        lowest[a] = std::min(lowest[a], p[a]);
        highest[a] = std::max(highest[a], p[a]);
      }
    }
    const std::lock_guard lock(mutex);
    plan.file_vertices += positions.size();
    plan.nonfinite_vertices += nonfinite;
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], lowest[a]);
      high[a] = std::max(high[a], highest[a]);
    }
  });
  if (plan.file_vertices == plan.nonfinite_vertices)
    throw EmptyError("the mesh has no vertex with finite coordinates: there is nothing to work on");
  plan.info.double_positions = header.double_positions;
  plan.info.colour = header.colour;
  plan.info.shift = header.shift;

  double extent = 0.0;
  double farthest = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    extent = std::max(extent, high[a] - low[a]);
    farthest = std::max({farthest, std::fabs(low[a]), std::fabs(high[a])});
  }
  // Below this, bricks could not be told from each other so far from zero.
  double root = power_of_two_above(std::max(extent, farthest * 0x1p-40));
  // The extent was rounded; two root cubes an axis hold the mesh when their own numbers say so.
  const auto holds = [&] {
    for (std::size_t a = 0; a < 3; ++a)
      if (cell_at(high[a], root) - cell_at(low[a], root) > 1.0) return false;
    return true;
  };
  if (std::isfinite(root) && !holds()) root *= 2.0;
  if (!std::isfinite(farthest * 8.0) || !std::isfinite(root) || root < 0x1p-900)
    throw InputError("the mesh reaches " + number_text(farthest) + " from zero and is " +
                     number_text(extent) + " wide, beyond what can be computed with: scale it first");
  Double3 origin;
  for (std::size_t a = 0; a < 3; ++a) origin[a] = cell_at(low[a], root);

  const double cell = std::ldexp(root, -kGridLevel);
  std::vector<std::uint32_t> count(std::size_t{kGrid} * kGrid * kGrid, 0);
  Double3 first_cell_of_grid;
  for (std::size_t a = 0; a < 3; ++a) first_cell_of_grid[a] = std::ldexp(origin[a], kGridLevel);
  const GridCells code_of(cell, first_cell_of_grid, kGrid);
  vertices_of_file([&](std::span<const Double3> positions, std::span<const std::uint32_t>) {
    check_stop();
    std::uint64_t last = 0;
    std::uint32_t run = 0;  // vertices of one cell that follow one another
    const auto add_run = [&] {
      if (run > 0) std::atomic_ref(count[last]).fetch_add(run, std::memory_order_relaxed);
    };
    for (const Double3& p : positions) {
      if (!finite(p)) continue;
      const std::uint64_t code = code_of(p);
      if (code != last) {
        add_run();
        last = code;
        run = 0;
      }
      ++run;
    }
    add_run();
  });

  // Level by level from the finest grid upwards; below the grid a surface has a quarter of the vertices per
  // level.
  const std::uint64_t vertices = plan.file_vertices - plan.nonfinite_vertices;
  std::vector<OccupiedCell> cells;
  for (std::size_t c = 0; c < count.size(); ++c)
    if (count[c] > 0) cells.push_back({c, count[c]});
  std::uint64_t median = weighted_median(cells, vertices);
  int level = kGridLevel;
  if (median > brick_vertices) {
    for (; median > brick_vertices && level < kMaxBrickLevel; ++level) median /= 4;
  } else {
    while (level > 0) {
      std::vector<OccupiedCell> parents = parents_of(cells);
      if (weighted_median(parents, vertices) > brick_vertices) break;
      cells = std::move(parents);
      --level;
    }
  }
  plan.brick_level = level;
  plan.cell_level = std::min(level, kGridLevel);
  plan.info.lattice.h = std::ldexp(root, -level - kBrickBits);
  for (std::size_t a = 0; a < 3; ++a)
    plan.info.lattice.origin_brick[a] = static_cast<std::int64_t>(std::ldexp(origin[a], level));

  const std::uint64_t target = std::max(kBucketVertices, vertices / kMaxBuckets);
  for (const OccupiedCell& cell_of_grid : cells) {
    if (plan.first_cell.empty() || plan.bucket_vertices.back() >= target) {
      plan.first_cell.push_back(plan.first_cell.empty() ? 0 : cell_of_grid.code);
      plan.bucket_vertices.push_back(0);
    }
    plan.bucket_vertices.back() += cell_of_grid.vertices;
  }
  return plan;
}

}  // namespace tessera
