#include "kernels/coverage/nearest_points.h"

#include <algorithm>
#include <cmath>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr int kMaxCubes = 60;           ///< along an axis
constexpr double kCubeRounding = 1e-4;  ///< edges, by which floats may put a point into the wrong cube
// A surface beyond doubt: squares of distances to the plane and along it, as eigenvalues of their sums.
constexpr double kMaxOffPlane = 0.5;    ///< root mean square, spacings
constexpr double kMaxThickness = 0.15;  ///< of the smaller extent in the plane, squared
constexpr double kMinWidth = 0.2;       ///< of the larger extent in the plane, squared
constexpr double kMaxAside = 0.5;       ///< of the neighbours' middle, of the distance of the farthest one

}  // namespace

NearestPoints::NearestPoints(std::span<const float> x, std::span<const float> y, std::span<const float> z,
                             double edge)
    : x_(x), y_(y), z_(z), edge_(edge) {
  if (x.empty()) {
    start_.assign(2, 0);
    return;
  }
  double extent = 0.0;
  const std::array<std::span<const float>, 3> axes = {x, y, z};
  Float3 high{};
  for (std::size_t a = 0; a < 3; ++a) {
    low_[a] = high[a] = axes[a][0];
    for (const float at : axes[a]) low_[a] = std::min(low_[a], at), high[a] = std::max(high[a], at);
    extent = std::max(extent, double{high[a]} - double{low_[a]});
  }
  edge_ = std::max(edge_, extent / (kMaxCubes - 1));
  per_edge_ = static_cast<float>(1.0 / edge_);
  for (std::size_t a = 0; a < 3; ++a) cubes_[a] = static_cast<int>((high[a] - low_[a]) * per_edge_) + 1;
  start_.assign(static_cast<std::size_t>(cubes_[0] * cubes_[1] * cubes_[2]) + 1, 0);
  std::vector<std::uint32_t> of_point(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Int3 c = cube({x_[i], y_[i], z_[i]});
    of_point[i] = static_cast<std::uint32_t>((c[2] * cubes_[1] + c[1]) * cubes_[0] + c[0]);
    ++start_[of_point[i] + 1];
  }
  for (std::size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
  point_.resize(x.size());
  // Filled from behind, so that the starts come out as they are meant.
  for (std::size_t i = x.size(); i-- > 0;) point_[--start_[of_point[i] + 1]] = static_cast<std::uint32_t>(i);
  // Each start has moved to that of the cube before it.
  start_.erase(start_.begin());
  start_.push_back(static_cast<std::uint32_t>(x.size()));
}

Int3 NearestPoints::cube(const Float3& p) const {
  Int3 c{};
  for (std::size_t a = 0; a < 3; ++a)
    c[a] = std::clamp(static_cast<int>((p[a] - low_[a]) * per_edge_), 0, cubes_[a] - 1);
  return c;
}

void NearestPoints::find(const Float3& p, std::size_t count, double limit,
                         std::vector<Neighbour>& out) const {
  out.clear();
  const Int3 middle = cube(p);
  const int rings = static_cast<int>(limit / (edge_ * (1.0 - kCubeRounding))) + 1;
  const double limit_square = limit * limit;
  const auto less = [](const Neighbour& a, const Neighbour& b) {
    return a.square != b.square ? a.square < b.square : a.point < b.point;
  };
  for (int ring = 1; ring <= rings; ++ring) {
    out.clear();
    Int3 from{}, to{};
    for (std::size_t a = 0; a < 3; ++a) {
      from[a] = std::max(0, middle[a] - ring);
      to[a] = std::min(cubes_[a] - 1, middle[a] + ring);
    }
    for (int k = from[2]; k <= to[2]; ++k)
      for (int j = from[1]; j <= to[1]; ++j) {
        const auto row = static_cast<std::size_t>((k * cubes_[1] + j) * cubes_[0]);
        for (std::uint32_t s = start_[row + static_cast<std::size_t>(from[0])];
             s < start_[row + static_cast<std::size_t>(to[0]) + 1]; ++s) {
          const std::uint32_t i = point_[s];
          const double dx = double{x_[i]} - double{p[0]}, dy = double{y_[i]} - double{p[1]},
                       dz = double{z_[i]} - double{p[2]};
          const double square = dx * dx + dy * dy + dz * dz;
          if (square <= limit_square) out.push_back({square, i});
        }
      }
    if (out.size() < count) continue;
    std::nth_element(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(count - 1), out.end(), less);
    // What lies in none of these cubes is farther away than so many edges, but for rounding of the cubes.
    const double beyond = ring * edge_ * (1.0 - kCubeRounding);
    if (out[count - 1].square <= beyond * beyond) break;
  }
  const std::size_t found = std::min(count, out.size());
  std::partial_sort(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(found), out.end(), less);
  out.resize(found);
}

double spacing_by_neighbour(double square, int neighbour) {
  return std::sqrt(neighbour > 4 ? 0.5 * square : square);
}

bool confirmed(const Float3& p, std::span<const Float3, kConfirmingPoints> at, double spacing) {
  const Double3 middle_of = wide(p);
  Double3 mean{};
  std::array<Double3, kConfirmingPoints> from;
  for (std::size_t i = 0; i < kConfirmingPoints; ++i) {
    from[i] = wide(at[i]) - middle_of;
    mean = mean + from[i] / static_cast<double>(kConfirmingPoints);
  }
  const double farthest = dot(from.back(), from.back()), reach = kConfirmingReach * spacing;
  if (!(farthest <= reach * reach) || !(dot(mean, mean) < kMaxAside * kMaxAside * farthest)) return false;
  std::array<double, 6> sums{};
  for (const Double3& f : from) {
    const Double3 d = f - mean;
    sums[0] += d[0] * d[0], sums[1] += d[0] * d[1], sums[2] += d[0] * d[2];
    sums[3] += d[1] * d[1], sums[4] += d[1] * d[2], sums[5] += d[2] * d[2];
  }
  const Double3 extent = min_eigen3(sums).values;
  const double off_plane = kMaxOffPlane * spacing;
  return std::max(0.0, extent[0]) / static_cast<double>(kConfirmingPoints) < off_plane * off_plane &&
         extent[0] < kMaxThickness * extent[1] && extent[1] > kMinWidth * extent[2];
}

}  // namespace tessera
