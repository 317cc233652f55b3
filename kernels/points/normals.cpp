#include "kernels/points/normals.h"

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <deque>
#include <limits>
#include <utility>

#include "octree/small_matrix.h"

// Points come in Morton order, so the points of one cube of 4^3 cells are consecutive. For each cube of the
// core the points of its box grown by the radius are gathered once, in canonical order; that list, and so the
// lane in which a neighbour is summed, depends on the data alone. Every point of the cube then streams over
// the list.

namespace tessera {
namespace {

constexpr int kLanes = 8;
constexpr float kLargestRadius = 4.0f;
constexpr int kCubeCells = 4;  ///< at least the largest radius, so that one cube of halo suffices
constexpr std::uint16_t kMinNeighbours = 5;  ///< a plane through fewer is chance
constexpr int kFewNeighbours = 12;           ///< from fewer the radius grows to the largest there is
constexpr std::uint32_t kCellPoints = 6;     ///< a denser cell is represented by about as many of its points
constexpr float kBent = 0.02f;               ///< surface variation from which the radius is halved
/// Ratio of the two larger eigenvalues below which the neighbours lie on a line: any plane through it fits.
constexpr double kLine = 0.0025;
constexpr float kNoPlane = 1.0f / 3.0f;  ///< the largest surface variation there is
constexpr float kSupportCosine = 0.5f;   ///< supporters' normals lie within 60 degrees

struct Box {
  Float3 low, high;
};

/// Candidates of one cube, positions relative to its corner so that sums stay small; padded to whole vectors. In Morton
/// order those of a vector lie together, so its box tells whether it can matter.
struct Candidates {
  std::vector<float> x, y, z, nx, ny, nz;
  std::array<std::vector<float>, 3> low, high;  ///< per vector of eight; padded to whole vectors too

  bool empty() const { return x.empty(); }
  void clear() {
    for (std::vector<float>* v : {&x, &y, &z, &nx, &ny, &nz}) v->clear();
  }
  /// \param most  so many at most will be added before finish()
  void begin(std::size_t most) {
    count_ = 0;
    for (std::vector<float>* v : {&x, &y, &z, &nx, &ny, &nz}) v->resize(most + kLanes);
  }
  void add(float px, float py, float pz, float ax, float ay, float az) {
    x[count_] = px, y[count_] = py, z[count_] = pz;
    nx[count_] = ax, ny[count_] = ay, nz[count_] = az;
    ++count_;
  }
  void finish() {
    const std::size_t count = count_;
    while (count_ % kLanes != 0) add(1e6f, 1e6f, 1e6f, 0, 0, 0);
    for (std::vector<float>* v : {&x, &y, &z, &nx, &ny, &nz}) v->resize(count_);
    const std::size_t boxes = (count_ / kLanes + kLanes - 1) / kLanes * kLanes;
    const std::vector<float>* axes[3] = {&x, &y, &z};
    for (std::size_t a = 0; a < 3; ++a) {
      low[a].assign(boxes, 1e6f);
      high[a].assign(boxes, -1e6f);
      for (std::size_t i = 0; i < count; ++i) {
        const float at = (*axes[a])[i];
        low[a][i / kLanes] = std::min(low[a][i / kLanes], at);
        high[a][i / kLanes] = std::max(high[a][i / kLanes], at);
      }
    }
  }

  /// First candidates of the vectors of which something may lie within `radius` of something in the box, in order.
  void select(const Box& box, float radius, std::vector<std::uint32_t>& firsts) const {
    constexpr float kRounding = 1.00001f;  // squares summed in another order stay within
    const __m256 limit = _mm256_set1_ps(radius * radius * kRounding);
    firsts.clear();
    for (std::size_t v = 0; v < low[0].size(); v += kLanes) {
      __m256 square = _mm256_setzero_ps();
      for (std::size_t a = 0; a < 3; ++a) {
        const __m256 above = _mm256_sub_ps(_mm256_loadu_ps(&low[a][v]), _mm256_set1_ps(box.high[a]));
        const __m256 below = _mm256_sub_ps(_mm256_set1_ps(box.low[a]), _mm256_loadu_ps(&high[a][v]));
        const __m256 away = _mm256_max_ps(_mm256_max_ps(above, below), _mm256_setzero_ps());
        square = _mm256_fmadd_ps(away, away, square);
      }
      auto near = static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(square, limit, _CMP_LE_OQ)));
      for (; near != 0; near &= near - 1)
        firsts.push_back(
            static_cast<std::uint32_t>((v + static_cast<std::size_t>(std::countr_zero(near))) * kLanes));
    }
  }

 private:
  std::size_t count_ = 0;
};

/// What the points of one small box may see of lists of candidates; every list is gone through once a radius.
class Reach {
 public:
  void move_to(const Box& box) { box_ = box, used_ = 0; }
  const std::vector<std::uint32_t>& of(const Candidates& list, float radius) {
    for (std::size_t k = 0; k < used_; ++k)
      if (known_[k].list == &list && known_[k].radius == radius) return known_[k].firsts;
    if (used_ == known_.size()) known_.emplace_back();
    Known& known = known_[used_++];
    known.list = &list, known.radius = radius;
    list.select(box_, radius, known.firsts);
    return known.firsts;
  }

 private:
  struct Known {
    const Candidates* list = nullptr;
    float radius = 0.0f;
    std::vector<std::uint32_t> firsts;
  };
  Box box_{};
  std::deque<Known> known_;
  std::size_t used_ = 0;
};

/// Sums in a fixed order: lanes 0..7 one after the other.
double lane_sum(__m256 v) {
  alignas(32) float f[kLanes];
  _mm256_store_ps(f, v);
  double s = 0.0;
  for (const float x : f) s += static_cast<double>(x);
  return s;
}

struct Moments {
  double w = 0.0;
  Double3 mean{};
  std::array<double, 6> covariance{};
  int count = 0;
  int supporters = 0;
};

/// Counts alone, for points that keep the normal they came with.
Moments count_at(const Candidates& c, const std::vector<std::uint32_t>& firsts, float px, float py, float pz,
                 const Float3& n, float radius) {
  const __m256 r2 = _mm256_set1_ps(radius * radius);
  const __m256 support = _mm256_set1_ps(kSupportCosine);
  const __m256 vx = _mm256_set1_ps(px), vy = _mm256_set1_ps(py), vz = _mm256_set1_ps(pz);
  const __m256 ux = _mm256_set1_ps(n[0]), uy = _mm256_set1_ps(n[1]), uz = _mm256_set1_ps(n[2]);
  Moments m;
  for (const std::uint32_t i : firsts) {
    const __m256 dx = _mm256_sub_ps(_mm256_loadu_ps(&c.x[i]), vx);
    const __m256 dy = _mm256_sub_ps(_mm256_loadu_ps(&c.y[i]), vy);
    const __m256 dz = _mm256_sub_ps(_mm256_loadu_ps(&c.z[i]), vz);
    const __m256 d2 = _mm256_fmadd_ps(dx, dx, _mm256_fmadd_ps(dy, dy, _mm256_mul_ps(dz, dz)));
    const int in = _mm256_movemask_ps(_mm256_cmp_ps(d2, r2, _CMP_LT_OQ));
    const __m256 dot = _mm256_fmadd_ps(
        ux, _mm256_loadu_ps(&c.nx[i]),
        _mm256_fmadd_ps(uy, _mm256_loadu_ps(&c.ny[i]), _mm256_mul_ps(uz, _mm256_loadu_ps(&c.nz[i]))));
    const int agree = in & _mm256_movemask_ps(_mm256_cmp_ps(dot, support, _CMP_GE_OQ));
    m.count += __builtin_popcount(static_cast<unsigned>(in));
    m.supporters += __builtin_popcount(static_cast<unsigned>(agree));
  }
  return m;
}

/// Weighted moments of the candidates within `radius` of p, weight (1 - d^2/r^2)^2; nobody asks for supporters.
Moments moments_at(const Candidates& c, const std::vector<std::uint32_t>& firsts, float px, float py,
                   float pz, float radius) {
  const __m256 r2 = _mm256_set1_ps(radius * radius);
  const __m256 inv_r2 = _mm256_set1_ps(1.0f / (radius * radius));
  const __m256 one = _mm256_set1_ps(1.0f);
  const __m256 vx = _mm256_set1_ps(px), vy = _mm256_set1_ps(py), vz = _mm256_set1_ps(pz);
  __m256 w = _mm256_setzero_ps(), sx = w, sy = w, sz = w, xx = w, xy = w, xz = w, yy = w, yz = w, zz = w;
  Moments m;
  for (const std::uint32_t i : firsts) {
    const __m256 dx = _mm256_sub_ps(_mm256_loadu_ps(&c.x[i]), vx);
    const __m256 dy = _mm256_sub_ps(_mm256_loadu_ps(&c.y[i]), vy);
    const __m256 dz = _mm256_sub_ps(_mm256_loadu_ps(&c.z[i]), vz);
    const __m256 d2 = _mm256_fmadd_ps(dx, dx, _mm256_fmadd_ps(dy, dy, _mm256_mul_ps(dz, dz)));
    const __m256 in = _mm256_cmp_ps(d2, r2, _CMP_LT_OQ);
    const int mask = _mm256_movemask_ps(in);
    m.count += __builtin_popcount(static_cast<unsigned>(mask));
    const __m256 q = _mm256_fnmadd_ps(d2, inv_r2, one);
    const __m256 weight = _mm256_and_ps(in, _mm256_mul_ps(q, q));
    w = _mm256_add_ps(w, weight);
    const __m256 wx = _mm256_mul_ps(weight, dx);
    const __m256 wy = _mm256_mul_ps(weight, dy);
    const __m256 wz = _mm256_mul_ps(weight, dz);
    sx = _mm256_add_ps(sx, wx);
    sy = _mm256_add_ps(sy, wy);
    sz = _mm256_add_ps(sz, wz);
    xx = _mm256_fmadd_ps(wx, dx, xx);
    xy = _mm256_fmadd_ps(wx, dy, xy);
    xz = _mm256_fmadd_ps(wx, dz, xz);
    yy = _mm256_fmadd_ps(wy, dy, yy);
    yz = _mm256_fmadd_ps(wy, dz, yz);
    zz = _mm256_fmadd_ps(wz, dz, zz);
  }
  m.w = lane_sum(w);
  if (!(m.w > 0.0)) return m;
  m.mean = {lane_sum(sx) / m.w, lane_sum(sy) / m.w, lane_sum(sz) / m.w};
  const auto& a = m.mean;
  m.covariance = {lane_sum(xx) / m.w - a[0] * a[0], lane_sum(xy) / m.w - a[0] * a[1],
                  lane_sum(xz) / m.w - a[0] * a[2], lane_sum(yy) / m.w - a[1] * a[1],
                  lane_sum(yz) / m.w - a[1] * a[2], lane_sum(zz) / m.w - a[2] * a[2]};
  return m;
}

struct Plane {
  Float3 normal{};
  float variation = kNoPlane;
  float residual = 0.0f;
};

Plane fit_plane(const Moments& m) {
  const auto [values, n] = least_eigen3(m.covariance);
  Plane plane;
  const double sum = std::max(values[0], 0.0) + values[1] + values[2];
  if (!(sum > 0.0) || values[1] < kLine * values[2]) return plane;
  // A sign that every block agrees on: the component of largest magnitude is positive.
  int major = 0;
  for (int a = 1; a < 3; ++a)
    if (std::fabs(n[static_cast<std::size_t>(a)]) > std::fabs(n[static_cast<std::size_t>(major)])) major = a;
  const double sign = n[static_cast<std::size_t>(major)] < 0.0 ? -1.0 : 1.0;
  for (std::size_t a = 0; a < 3; ++a) plane.normal[a] = static_cast<float>(sign * n[a]);
  plane.variation = static_cast<float>(std::max(values[0], 0.0) / sum);
  plane.residual = static_cast<float>(std::sqrt(std::max(values[0], 0.0)));
  return plane;
}

/// \param radius  at which the candidates are complete
PointShape shape_at(const Candidates& c, Reach& reach, float px, float py, float pz, const Float3& given,
                    float radius, const NormalOptions& options) {
  const bool has_normal = !options.estimate && (given[0] != 0.0f || given[1] != 0.0f || given[2] != 0.0f);
  const Moments wide = options.estimate ? moments_at(c, reach.of(c, radius), px, py, pz, radius)
                                        : count_at(c, reach.of(c, radius), px, py, pz, given, radius);
  PointShape shape;
  shape.normal = given;
  shape.neighbours = static_cast<std::uint16_t>(std::clamp(wide.count - 1, 0, 0xffff));
  shape.supporters = has_normal
                         ? static_cast<std::uint16_t>(std::min(std::max(wide.supporters - 1, 0), 0xffff))
                         : shape.neighbours;
  if (!options.estimate) return shape;
  shape.normal = {0, 0, 0};
  shape.roughness = kNoPlane;
  if (wide.count <= kMinNeighbours) return shape;
  Plane plane = fit_plane(wide);  // zero with the largest variation on a line
  shape.roughness = plane.variation;
  if (plane.variation > kBent) {
    const Moments narrow = moments_at(c, reach.of(c, radius * 0.5f), px, py, pz, radius * 0.5f);
    if (narrow.count > 2 * kMinNeighbours) {
      const Plane closer = fit_plane(narrow);
      if (closer.variation < plane.variation) plane = closer;
    }
  }
  shape.normal = plane.normal;
  shape.variation = plane.variation;
  shape.residual = plane.residual;
  return shape;
}

/// End of the run of points that share the cell of point `i`.
std::uint32_t end_of_cell(const PointBlock& points, std::uint32_t i, std::uint32_t last) {
  const float x = std::floor(points.x[i]), y = std::floor(points.y[i]), z = std::floor(points.z[i]);
  std::uint32_t end = i + 1;
  while (end < last && std::floor(points.x[end]) == x && std::floor(points.y[end]) == y &&
         std::floor(points.z[end]) == z)
    ++end;
  return end;
}

/// Of the points of a cube those that stand for all: beside a scanner a cell may have thousands, every so many will do.
void choose_candidates(const PointBlock& points, std::uint32_t first, std::uint32_t last,
                       std::vector<std::uint32_t>& chosen) {
  for (std::uint32_t i = first; i < last;) {
    const std::uint32_t end = end_of_cell(points, i, last);  // the points of one cell are consecutive
    const std::uint32_t step = (end - i + kCellPoints - 1) / kCellPoints;
    for (; i < end; i += step) chosen.push_back(i);
    i = end;
  }
}

Box box_of(const PointBlock& points, std::uint32_t first, std::uint32_t last, const float (&corner)[3]) {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  Box box = {{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}};
  for (std::uint32_t i = first; i < last; ++i) {
    const float at[3] = {points.x[i] - corner[0], points.y[i] - corner[1], points.z[i] - corner[2]};
    for (std::size_t a = 0; a < 3; ++a) {
      box.low[a] = std::min(box.low[a], at[a]);
      box.high[a] = std::max(box.high[a], at[a]);
    }
  }
  return box;
}

int cube_of(float cells) {
  return static_cast<int>(std::floor(cells / kCubeCells));
}

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
  struct Run {  // of the candidates
    std::uint32_t first = 0;
    std::uint32_t last = 0;
  };
  std::vector<std::uint32_t> chosen;  // points that are candidates, in their order
  chosen.reserve(points.size());
  std::vector<Run> runs(static_cast<std::size_t>(dims[0]) * static_cast<std::size_t>(dims[1]) *
                        static_cast<std::size_t>(dims[2]));
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
  for (std::uint32_t i = 0; i < count;) {
    const Int3 cube = {cube_of(points.x[i]), cube_of(points.y[i]), cube_of(points.z[i])};
    std::uint32_t j = i + 1;
    while (j < count && cube_of(points.x[j]) == cube[0] && cube_of(points.y[j]) == cube[1] &&
           cube_of(points.z[j]) == cube[2])
      ++j;
    const auto before = static_cast<std::uint32_t>(chosen.size());
    choose_candidates(points, i, j, chosen);
    runs[slot(cube[0], cube[1], cube[2])] = {before, static_cast<std::uint32_t>(chosen.size())};
    const bool inside = cube[0] >= 0 && cube[0] < dims[0] - 2 && cube[1] >= 0 && cube[1] < dims[1] - 2 &&
                        cube[2] >= 0 && cube[2] < dims[2] - 2;
    if (inside) {
      core.push_back({cube, i, j});
      core_points += j - i;
    }
    i = j;
  }

  std::vector<PointShape> shapes;
  shapes.reserve(core_points);
  Candidates candidates, wide, ground, wide_ground;  // of all points, and of those known as ground
  Reach reach;
  std::vector<Run> near;
  for (const CubeRun& run : core) {
    const float low[3] = {static_cast<float>(run.cube[0] * kCubeCells),
                          static_cast<float>(run.cube[1] * kCubeCells),
                          static_cast<float>(run.cube[2] * kCubeCells)};
    near.clear();
    for (int d = 0; d < 27; ++d) {
      const Run r = runs[slot(run.cube[0] + d % 3 - 1, run.cube[1] + d / 3 % 3 - 1, run.cube[2] + d / 9 - 1)];
      if (r.first != r.last) near.push_back(r);
    }
    std::sort(near.begin(), near.end(), [](const Run& a, const Run& b) { return a.first < b.first; });
    const auto is_ground = [&](std::uint32_t i) {
      return !points.flags.empty() && (points.flags[i] & kPointGround) != 0;
    };
    const auto gather = [&](float radius, bool only_ground, Candidates& into) {
      std::size_t most = 0;
      for (const Run& r : near) most += r.last - r.first;
      into.begin(most);
      for (const Run& r : near)
        for (std::uint32_t k = r.first; k < r.last; ++k) {
          const std::uint32_t i = chosen[k];
          const float x = points.x[i] - low[0], y = points.y[i] - low[1], z = points.z[i] - low[2];
          const auto close = [&](float v) { return v > -radius && v < kCubeCells + radius; };
          if (only_ground && !is_ground(i)) continue;
          if (close(x) && close(y) && close(z)) into.add(x, y, z, points.nx[i], points.ny[i], points.nz[i]);
        }
      into.finish();
    };
    const auto radius = static_cast<float>(options.radius_cells);
    for (Candidates* list : {&candidates, &wide, &ground, &wide_ground})
      list->clear();  // gathered when asked for
    std::uint32_t end_of_box = run.first;
    for (std::uint32_t i = run.first; i < run.last; ++i) {
      if (i == end_of_box) {
        end_of_box = end_of_cell(points, i, run.last);
        reach.move_to(box_of(points, i, end_of_box, low));
      }
      const float x = points.x[i] - low[0], y = points.y[i] - low[1], z = points.z[i] - low[2];
      const Float3 given = {points.nx[i], points.ny[i], points.nz[i]};
      // What grows on the ground does not tilt it.
      const bool only_ground = options.estimate && is_ground(i);
      Candidates& near_by = only_ground ? ground : candidates;
      if (near_by.empty()) gather(radius, only_ground, near_by);
      shapes.push_back(shape_at(near_by, reach, x, y, z, given, radius, options));
      const bool planar = shapes.back().neighbours >= kFewNeighbours && shapes.back().variation < kNoPlane;
      if (!options.estimate || planar || radius >= kLargestRadius) continue;
      Candidates& far_too = only_ground ? wide_ground : wide;
      if (far_too.empty()) gather(kLargestRadius, only_ground, far_too);
      PointShape wider = shape_at(far_too, reach, x, y, z, given, kLargestRadius, options);
      wider.neighbours = shapes.back().neighbours, wider.supporters = shapes.back().supporters;
      shapes.back() = wider;
    }
  }
  return shapes;
}

}  // namespace tessera
