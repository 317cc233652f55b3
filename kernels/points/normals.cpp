#include "kernels/points/normals.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "kernels/points/neighbour_list.h"
#include "kernels/points/plane_fits.h"

// Points come in Morton order, so the points of one cube of 4^3 cells are consecutive. For each cube of the
// core the points of its box grown by the radius are gathered once, in canonical order; that list, and so the
// lane in which a neighbour is summed, depends on the data alone. The points of a cell share what they may see of it.

namespace tessera {
namespace {

constexpr float kLargestRadius = 4.0f;
constexpr int kCubeCells = 4;             ///< at least the largest radius, so that one cube of halo suffices
constexpr int kMinNeighbours = 5;         ///< a plane through fewer is chance
constexpr int kFewNeighbours = 12;        ///< from fewer the radius grows to the largest there is
constexpr std::uint32_t kCellPoints = 6;  ///< a denser cell is represented by about as many of its points
constexpr float kCurved = 0.02f;          ///< surface variation from which the radius is halved
constexpr std::size_t kAtOnce = 256;      ///< points of a cube that are in work, so that scratch is bounded

using Run = std::pair<std::uint32_t, std::uint32_t>;  ///< first, last of something

int cube_of(float cells) {
  return static_cast<int>(std::floor(cells / kCubeCells));
}

bool in_one_cell(const PointBlock& points, std::uint32_t i, std::uint32_t j) {
  return std::floor(points.x[i]) == std::floor(points.x[j]) &&
         std::floor(points.y[i]) == std::floor(points.y[j]) &&
         std::floor(points.z[i]) == std::floor(points.z[j]);
}

/// End of the run of points that share the cell of point `i`; the points of one cell are consecutive.
std::uint32_t end_of_cell(const PointBlock& points, std::uint32_t i, std::uint32_t last) {
  std::uint32_t end = i + 1;
  while (end < last && in_one_cell(points, i, end)) ++end;
  return end;
}

/// The chosen points of a block, where all are its own arrays.
class ChosenPoints {
 public:
  ChosenPoints(const PointBlock& points, const std::vector<std::uint32_t>& chosen, bool normals) {
    const bool all = chosen.size() == points.size();
    const auto take = [&](const std::vector<float>& from, std::vector<float>& kept) {
      if (all) return std::span<const float>(from);
      kept.reserve(chosen.size());
      for (const std::uint32_t i : chosen) kept.push_back(from[i]);
      return std::span<const float>(kept);
    };
    source_.x = take(points.x, kept_[0]);
    source_.y = take(points.y, kept_[1]);
    source_.z = take(points.z, kept_[2]);
    if (normals) {
      source_.nx = take(points.nx, kept_[3]);
      source_.ny = take(points.ny, kept_[4]);
      source_.nz = take(points.nz, kept_[5]);
    }
    if (points.flags.empty()) return;
    ground_.reserve(chosen.size());
    for (const std::uint32_t i : chosen) ground_.push_back((points.flags[i] & kPointGround) != 0);
    source_.ground = ground_;
  }
  ChosenPoints(const ChosenPoints&) = delete;

  const NeighbourSource& source() const { return source_; }

 private:
  std::array<std::vector<float>, 6> kept_;
  std::vector<std::uint8_t> ground_;
  NeighbourSource source_;
};

/// Shapes of the points of one cube after the other.
class ShapeFinder {
 public:
  ShapeFinder(const PointBlock& points, const NeighbourSource& source, const NormalOptions& options)
      : points_(points),
        source_(source),
        estimate_(options.estimate),
        radius_(static_cast<float>(options.radius_cells)) {}

  /// \param near  runs of the source around the cube, canonical order
  void move_to(const Int3& cube, std::span<const Run> near) {
    near_ = near;
    for (std::size_t a = 0; a < 3; ++a) corner_[a] = static_cast<float>(cube[a] * kCubeCells);
    for (Lists* lists : {&all_, &ground_})
      lists->narrow.clear(), lists->wide.clear();  // filled when asked for
  }

  /// Of points of the cube, no more than kAtOnce.
  void find(std::uint32_t first, std::uint32_t last, std::vector<PointShape>& shapes) {
    shapes_ = &shapes;
    first_ = first;
    start_ = shapes.size();
    shapes.resize(start_ + (last - first));
    if (!estimate_) {
      count(first, last);
      return;
    }
    // What grows on the ground does not tilt it.
    for (const bool ground : {false, true}) {
      which_.clear();
      for (std::uint32_t i = first; i < last; ++i)
        if (is_ground(i) == ground) which_.push_back(i);
      if (!which_.empty()) estimate(ground);
    }
  }

 private:
  struct Lists {
    NeighbourList narrow, wide;  ///< at the radius, at the largest one
  };

  bool is_ground(std::uint32_t i) const {
    return !points_.flags.empty() && (points_.flags[i] & kPointGround) != 0;
  }
  PointShape& shape(std::uint32_t i) { return (*shapes_)[start_ + (i - first_)]; }
  Float3 local_position(std::uint32_t i) const {
    return {points_.x[i] - corner_[0], points_.y[i] - corner_[1], points_.z[i] - corner_[2]};
  }
  const NeighbourList& filled(NeighbourList& list, float radius, bool ground) {
    if (list.empty()) list.fill(source_, near_, corner_, radius, ground, !estimate_);
    return list;
  }

  /// Calls use(point, place, packs) for each of the points, in order; those of a cell share what they may see.
  template <typename Points, typename Use>
  void for_each_in_range(const NeighbourList& list, float radius, const Points& which, const Use& use) {
    for (std::size_t i = 0, end = 0; i < which.size(); i = end) {
      constexpr float kFar = std::numeric_limits<float>::infinity();
      Float3 low = {kFar, kFar, kFar}, high = {-kFar, -kFar, -kFar};
      for (end = i; end < which.size() && in_one_cell(points_, which[i], which[end]); ++end) {
        const Float3 at = local_position(which[end]);
        for (std::size_t a = 0; a < 3; ++a)
          low[a] = std::min(low[a], at[a]), high[a] = std::max(high[a], at[a]);
      }
      list.select(low, high, radius, packs_);
      for (std::size_t k = i; k < end; ++k) use(which[k], local_position(which[k]), packs_);
    }
  }

  /// Counts alone, for points that keep the normal they came with.
  void count(std::uint32_t first, std::uint32_t last) {
    which_.clear();
    for (std::uint32_t i = first; i < last; ++i) which_.push_back(i);
    const auto narrow = [](int n) { return static_cast<std::uint16_t>(std::clamp(n - 1, 0, 0xffff)); };
    for_each_in_range(filled(all_.narrow, radius_, false), radius_, which_,
                      [&](std::uint32_t i, const Float3& at, const std::vector<std::uint32_t>& packs) {
                        PointShape& s = shape(i);
                        s.normal = {points_.nx[i], points_.ny[i], points_.nz[i]};
                        const auto [near, agree] = all_.narrow.supported(packs, at, s.normal, radius_);
                        s.neighbours = narrow(near);
                        s.supporters = s.normal == Float3{0, 0, 0} ? s.neighbours : narrow(agree);
                      });
  }

  /// Shapes of the points of which_.
  void estimate(bool ground) {
    Lists& lists = ground ? ground_ : all_;
    estimate_at(filled(lists.narrow, radius_, ground), radius_);
    if (radius_ >= kLargestRadius) return;
    std::erase_if(which_, [&](std::uint32_t i) {
      return shape(i).neighbours >= kFewNeighbours && shape(i).variation < kNoPlane;
    });
    if (which_.empty()) return;
    counts_.clear();
    for (const std::uint32_t i : which_) counts_.push_back({shape(i).neighbours, shape(i).supporters});
    estimate_at(filled(lists.wide, kLargestRadius, ground), kLargestRadius);
    for (std::size_t k = 0; k < which_.size(); ++k)
      shape(which_[k]).neighbours = counts_[k].first, shape(which_[k]).supporters = counts_[k].second;
  }

  /// \param radius  at which the list is complete
  void estimate_at(const NeighbourList& list, float radius) {
    fit(list, radius, which_, [&](std::uint32_t i, int count, const FittedPlane* plane) {
      PointShape s;
      s.neighbours = s.supporters = static_cast<std::uint16_t>(std::clamp(count - 1, 0, 0xffff));
      s.roughness = plane ? plane->variation : kNoPlane;
      if (plane) s.normal = plane->normal, s.variation = plane->variation, s.residual = plane->residual;
      shape(i) = s;
    });
    curved_.clear();
    for (const std::uint32_t i : which_)
      if (shape(i).variation > kCurved) curved_.push_back(i);
    fit(list, 0.5f * radius, curved_, [&](std::uint32_t i, int count, const FittedPlane* plane) {
      PointShape& s = shape(i);
      if (count <= 2 * kMinNeighbours || !(plane->variation < s.variation)) return;
      s.normal = plane->normal, s.variation = plane->variation, s.residual = plane->residual;
    });
  }

  /// Calls use(point, neighbours with itself, plane), in any order; the plane is null where neighbours are too few.
  template <typename Use>
  void fit(const NeighbourList& list, float radius, const std::vector<std::uint32_t>& which, const Use& use) {
    NeighbourSums sums;
    struct Lane {
      std::uint32_t point;
      int count;
    };
    std::array<Lane, NeighbourSums::kLanes> lane;
    std::size_t used = 0;
    const auto flush = [&] {
      const auto planes = fit_planes(sums);
      for (std::size_t k = 0; k < used; ++k) use(lane[k].point, lane[k].count, &planes[k]);
      used = 0;
    };
    for_each_in_range(list, radius, which,
                      [&](std::uint32_t i, const Float3& at, const std::vector<std::uint32_t>& packs) {
                        const int count = list.sum(packs, at, radius, sums, used);
                        if (count <= kMinNeighbours) {
                          use(i, count, nullptr);
                          return;
                        }
                        lane[used++] = {i, count};
                        if (used == lane.size()) flush();
                      });
    if (used > 0) flush();
  }

  const PointBlock& points_;
  const NeighbourSource& source_;
  bool estimate_;
  float radius_;
  Float3 corner_{};  ///< of the cube
  std::span<const Run> near_;
  Lists all_, ground_;  ///< of all points, and of those known as ground
  std::vector<PointShape>* shapes_ = nullptr;
  std::uint32_t first_ = 0;  ///< of the points at hand
  std::size_t start_ = 0;    ///< its place in the shapes
  std::vector<std::uint32_t> which_, curved_, packs_;
  std::vector<std::pair<std::uint16_t, std::uint16_t>> counts_;
};

}  // namespace

int normal_halo_cells(const NormalOptions& options) {
  return options.estimate ? static_cast<int>(kLargestRadius)
                          : static_cast<int>(std::ceil(options.radius_cells));
}

std::vector<PointShape> estimate_shapes(const PointBlock& points, const NormalOptions& options) {
  assert(options.radius_cells >= 1.0 && options.radius_cells <= 4.0);
  // Runs of points in the same cube, in canonical order, and a dense table cube -> run (one cube of halo).
  const Int3 dims = {points.cells[0] / kCubeCells + 2, points.cells[1] / kCubeCells + 2,
                     points.cells[2] / kCubeCells + 2};
  std::vector<std::uint32_t> chosen;  // points that are candidates, in their order
  chosen.reserve(points.size());
  std::vector<Run> runs(static_cast<std::size_t>(dims[0]) * static_cast<std::size_t>(dims[1]) *
                        static_cast<std::size_t>(dims[2]));  // of these
  const auto slot = [&](int x, int y, int z) {
    return (static_cast<std::size_t>(z + 1) * static_cast<std::size_t>(dims[1]) +
            static_cast<std::size_t>(y + 1)) *
               static_cast<std::size_t>(dims[0]) +
           static_cast<std::size_t>(x + 1);
  };
  struct CubeRun {
    Int3 cube;
    std::uint32_t first, last;
  };
  std::vector<CubeRun> core;
  const auto count = static_cast<std::uint32_t>(points.size());
  std::size_t core_points = 0;
  for (std::uint32_t i = 0, end = 0; i < count; i = end) {
    end = end_of_cell(points, i, count);
    const Int3 cube = {cube_of(points.x[i]), cube_of(points.y[i]), cube_of(points.z[i])};
    Run& run = runs[slot(cube[0], cube[1], cube[2])];
    const bool inside = cube[0] >= 0 && cube[0] < dims[0] - 2 && cube[1] >= 0 && cube[1] < dims[1] - 2 &&
                        cube[2] >= 0 && cube[2] < dims[2] - 2;
    if (run.second == 0) {
      run.first = static_cast<std::uint32_t>(chosen.size());
      if (inside) core.push_back({cube, i, i});
    }
    // Of the points of a cell those that stand for all: beside a scanner it may have thousands, every so many will do.
    const std::uint32_t step = (end - i + kCellPoints - 1) / kCellPoints;
    for (std::uint32_t k = i; k < end; k += step) chosen.push_back(k);
    run.second = static_cast<std::uint32_t>(chosen.size());
    if (!inside) continue;
    core.back().last = end;
    core_points += end - i;
  }

  const ChosenPoints source(points, chosen, !options.estimate);
  ShapeFinder finder(points, source.source(), options);
  std::vector<PointShape> shapes;
  shapes.reserve(core_points);
  std::vector<Run> near;
  for (const CubeRun& run : core) {
    near.clear();
    for (int d = 0; d < 27; ++d) {
      const Run r = runs[slot(run.cube[0] + d % 3 - 1, run.cube[1] + d / 3 % 3 - 1, run.cube[2] + d / 9 - 1)];
      if (r.first != r.second) near.push_back(r);
    }
    std::sort(near.begin(), near.end());
    finder.move_to(run.cube, near);
    for (std::uint32_t i = run.first; i < run.last; i += std::min<std::uint32_t>(kAtOnce, run.last - i))
      finder.find(i, i + std::min<std::uint32_t>(kAtOnce, run.last - i), shapes);
  }
  return shapes;
}

}  // namespace tessera
