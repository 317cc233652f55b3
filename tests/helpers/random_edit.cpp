#include "tests/helpers/random_edit.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "stream/files/json.h"
#include "tests/helpers/random.h"

namespace tessera::test {
namespace {

using Points = std::span<const Double3>;
using Faces = std::span<const std::array<std::uint64_t, 3>>;

constexpr double kMaxMove = 0.3;  ///< of the gap between a handle and what stays
constexpr int kRings = 3;
constexpr double kThin = 0.1;  ///< height over longest side: less bends over with its chord

Double3 direction(Random& random) {
  for (;;) {
    const Double3 d = {random.in(-1, 1), random.in(-1, 1), random.in(-1, 1)};
    if (const double length = norm(d); length > 0.1 && length < 1.0) return d * (1.0 / length);
  }
}

tessera::Json list(const Double3& p) {
  return {p[0], p[1], p[2]};
}

double diagonal(Points points) {
  Double3 low = points[0], high = low;
  for (const Double3& p : points)
    for (std::size_t c = 0; c < 3; ++c) low[c] = std::min(low[c], p[c]), high[c] = std::max(high[c], p[c]);
  return norm(high - low);
}

/// How far along d points lie, ascending.
std::vector<double> heights(Points points, const Double3& d) {
  std::vector<double> out;
  for (const Double3& p : points) out.push_back(dot(p, d));
  std::sort(out.begin(), out.end());
  return out;
}
double quantile(const std::vector<double>& sorted, double share) {
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

tessera::Json half_space(const Double3& d, double at) {
  return {{"point", list(d * at)}, {"normal", list(d)}};
}

/// Turns about a centre, and moves: no point within `radius` of it goes farther than `maximum`.
tessera::Json motion(Random& random, const Double3& centre, double radius, double maximum) {
  const double rotation = random.unit(),
               degrees = std::min(40.0, rotation * maximum / radius * 180.0 / 3.14159265);
  tessera::Json steps = tessera::Json::array();
  steps.push_back(
      {{"rotate", {{"axis", list(direction(random))}, {"angle", degrees}, {"centre", list(centre)}}}});
  steps.push_back({{"move", list(direction(random) * ((1.0 - rotation) * maximum))}});
  return steps;
}

/// What is beyond a plane, against what is before another.
void bend(Random& random, Points points, tessera::Json& edit) {
  Double3 d;
  double low = 0.0, high = 0.0;
  do {
    d = direction(random);
    const std::vector<double> at = heights(points, d);
    low = quantile(at, random.in(0.15, 0.4));
    high = quantile(at, random.in(0.6, 0.85));
  } while (high - low < 0.05 * diagonal(points));
  Double3 centre = {0, 0, 0};
  double count = 0.0, radius = 0.0;
  for (const Double3& p : points)
    if (dot(p, d) >= high) centre = centre + p, count += 1.0;
  centre = centre * (1.0 / count);
  for (const Double3& p : points)
    if (dot(p, d) >= high) radius = std::max(radius, norm(p - centre));
  edit["regions"].push_back({{"role", "support"}, {"half_space", half_space(-d, -low)}});
  edit["regions"].push_back({{"role", "handle"}, {"name", "end"}, {"half_space", half_space(-d, -high)}});
  edit["handles"]["end"] = motion(random, centre, radius, kMaxMove * (high - low));
}

tessera::Json sphere(const Double3& centre, double radius) {
  return {{"centre", list(centre)}, {"radius", radius}};
}

/// A spot in the middle of a disk.
void pull(Random& random, Points points, tessera::Json& edit) {
  const Double3 centre = points[random.below(points.size())];
  const double radius = random.in(0.15, 0.3) * diagonal(points), spot = radius / 3.0;
  edit["regions"].push_back({{"role", "support"}, {"sphere", sphere(centre, radius)}});
  edit["regions"].push_back({{"role", "handle"}, {"name", "spot"}, {"sphere", sphere(centre, spot)}});
  edit["handles"]["spot"] = motion(random, centre, spot, kMaxMove * (radius - spot));
}

/// Three spots of a surface whose one end stays.
void add_random_points(Random& random, Points points, tessera::Json& edit) {
  const Double3 d = direction(random);
  const double low = quantile(heights(points, d), 0.2);
  std::array<Double3, 3> centre;
  double gap = 0.0;
  for (int trial = 0; trial < 100; ++trial) {
    std::array<Double3, 3> c;
    double minimum = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < 3; ++k) {
      c[k] = points[random.below(points.size())];
      minimum = std::min(minimum, dot(c[k], d) - low);
      for (std::size_t i = 0; i < k; ++i) minimum = std::min(minimum, norm(c[k] - c[i]));
    }
    if (minimum > gap) gap = minimum, centre = c;
  }
  edit["regions"].push_back({{"role", "support"}, {"half_space", half_space(-d, -low)}});
  for (std::size_t k = 0; k < 3; ++k) {
    const std::string name = "spot " + std::to_string(k + 1);
    edit["regions"].push_back({{"role", "handle"}, {"name", name}, {"sphere", sphere(centre[k], gap / 4)}});
    // Half of the gap is left between two spots, and both may move.
    edit["handles"][name] = motion(random, centre[k], gap / 4, kMaxMove * gap / 4);
  }
}

using Matrix = Eigen::Matrix3d;

/// Sums over faces, at vertices, spread ring by ring.
template <class Value, class Of>
std::vector<Value> spread(std::size_t vertices, Faces faces, const Value& zero, int rings, const Of& of) {
  std::vector<Value> sum(vertices, zero);
  for (std::size_t j = 0; j < faces.size(); ++j)
    for (const std::uint64_t v : faces[j]) sum[v] += of(j);
  for (int ring = 1; ring < rings; ++ring) {
    std::vector<Value> next(vertices, zero);
    for (const auto& f : faces) {
      const Value all = sum[f[0]] + sum[f[1]] + sum[f[2]];
      for (const std::uint64_t v : f) next[v] += all;
    }
    sum.swap(next);
  }
  return sum;
}

Eigen::Vector3d column(const Double3& p) {
  return {p[0], p[1], p[2]};
}

Matrix nearest_rotation(const Matrix& m) {
  const Eigen::JacobiSVD<Matrix> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix u = svd.matrixU();
  if (u.determinant() * svd.matrixV().determinant() < 0.0) u.col(2) = -u.col(2);
  return u * svd.matrixV().transpose();
}

}  // namespace

tessera::Json random_edit(Points points, std::uint64_t seed) {
  Random random(seed);
  tessera::Json edit = {{"regions", tessera::Json::array()}, {"handles", tessera::Json::object()}};
  edit["order"] = 1 + random.below(3);
  if (random.below(3) == 0) edit["details"] = "volumes";
  const std::uint64_t kind = random.below(3);
  if (kind == 0) bend(random, points, edit);
  if (kind == 1) pull(random, points, edit);
  if (kind == 2) add_random_points(random, points, edit);
  if (random.below(4) == 0) edit["regions"].back()["smoothness"] = random.in(0.0, 2.0);
  return edit;
}

FlippedFaces flipped_faces(Points before, Points after, Faces faces, double minimum) {
  FlippedFaces out;
  for (std::size_t v = 0; v < after.size(); ++v)
    if (!std::isfinite(dot(after[v], after[v])) && std::isfinite(dot(before[v], before[v]))) ++out.not_finite;
  const auto normals = [&](Points p) {
    std::vector<Eigen::Vector3d> normal;
    for (const auto& f : faces) normal.push_back(column(triangle_normal(p[f[0]], p[f[1]], p[f[2]])));
    return normal;
  };
  const std::vector<Eigen::Vector3d> was = normals(before), is = normals(after);
  const std::vector<Matrix> rotation =
      spread(before.size(), faces, Matrix(Matrix::Zero()), kRings, [&](std::size_t j) {
        Matrix sum = Matrix::Zero();
        for (std::size_t k = 0; k < 3; ++k) {
          const std::uint64_t a = faces[j][k], b = faces[j][(k + 1) % 3];
          sum += column(after[b] - after[a]) * column(before[b] - before[a]).transpose();
        }
        return sum;
      });
  for (std::size_t j = 0; j < faces.size(); ++j) {
    const auto& f = faces[j];
    double longest = 0.0;
    for (std::size_t k = 0; k < 3; ++k)
      longest = std::max(longest, norm(before[f[k]] - before[f[(k + 1) % 3]]));
    if (!(was[j].norm() > minimum * longest) || before[f[0]] == after[f[0]]) continue;
    const Matrix here = rotation[f[0]] + rotation[f[1]] + rotation[f[2]];
    if ((nearest_rotation(here) * was[j]).dot(is[j]) >= 0.0) continue;
    ++(was[j].norm() < kThin * longest * longest ? out.thin : out.count);
  }
  return out;
}

}  // namespace tessera::test
