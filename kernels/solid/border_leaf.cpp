#include "kernels/solid/border_leaf.h"

#include <cmath>

#include "kernels/solid/ribbon_angles.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr double kHalfDiagonal = 6.07;  ///< of the leaf's nodes, cells
constexpr double kSmooth = 18.0;        ///< cells
constexpr double kFarLeaf = 0.2;        ///< radius over distance from which moments stand for edges

constexpr double kFarEdge = 0.25;  ///< half its length over distance from which two points stand for an edge
constexpr double kGauss = 0.28867513459481287;  ///< of an edge, from its middle

/// Distance of a place from the ray from `r` past it in direction +x.
double ray_distance(const Double3& r) {
  return r[0] < 0.0 ? std::sqrt(r[1] * r[1] + r[2] * r[2]) : norm(r);
}

}  // namespace

const std::array<std::array<double, BorderLeaf::kPoints>, 8>& BorderLeaf::weights() {
  static const auto made = [] {
    std::array<std::array<double, kPoints>, 8> w;
    for (std::size_t n = 0; n < 8; ++n)
      for (std::size_t p = 0; p < kPoints; ++p) {
        double product = 1.0;
        for (std::size_t o = 0; o < kPoints; ++o)
          if (o != p)
            product *= static_cast<double>(static_cast<std::int64_t>(n) * kSolidQuanta - kNodes[o]) /
                       static_cast<double>(kNodes[p] - kNodes[o]);
        w[n][p] = product;
      }
    return w;
  }();
  return made;
}

BorderLeaf::BorderLeaf(const BorderWinding& border, const Int3& corner) : border_(border), corner_(corner) {
  if (border.empty()) return;
  std::vector<BoundaryStripRow<1>> rows;
  rows.reserve(kPoints * kPoints);
  for (std::size_t row = 0; row < kPoints * kPoints; ++row) {
    std::array<std::int64_t, kPoints> x;
    for (std::size_t p = 0; p < kPoints; ++p) x[p] = corner[0] * kSolidQuanta + kNodes[p];
    rows.emplace_back(x, corner[1] * kSolidQuanta + kNodes[row % kPoints],
                      corner[2] * kSolidQuanta + kNodes[row / kPoints]);
  }
  const Double3 middle = {corner[0] + 3.5, corner[1] + 3.5, corner[2] + 3.5};
  std::array<std::uint32_t, BorderWinding::kStack> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const BorderWinding::Cluster& c = border.clusters_[stack[--top]];
    const double away = ray_distance(wide(c.centre) - middle);
    if (away - c.radius >= kSmooth && c.radius < kFarLeaf * (away - kHalfDiagonal)) {
      add_cluster(c);
    } else if (c.left != 0) {
      stack[top++] = c.left + 1;
      stack[top++] = c.left;
    } else {
      for (std::uint32_t e = c.first; e < c.end; ++e) {
        const BorderEdge& edge = border.edges_[e];
        Double3 a, b;
        for (std::size_t k = 0; k < 3; ++k) {
          a[k] = static_cast<double>(edge.a[k]) * kCellsPerQuantum;
          b[k] = static_cast<double>(edge.b[k]) * kCellsPerQuantum;
        }
        const Double3 centre = (a + b) * 0.5;
        const double near = ray_distance(centre - middle), radius = 0.5 * norm(b - a);
        if (near - radius < kSmooth) {
          near_.push_back(e);
        } else if (radius < kFarEdge * (near - kHalfDiagonal)) {
          add_edge(centre, b - a, static_cast<double>(edge.count));
        } else {
          for (BoundaryStripRow<1>& row : rows) row.add(edge);
        }
      }
    }
  }
  for (std::size_t row = 0; row < rows.size(); ++row) {
    const auto half = rows[row].value();
    for (std::size_t p = 0; p < kPoints; ++p) smooth_[kPoints * row + p] += 2.0 * half[p];
  }
}

/// Adds the form g (e_x x r) . dl with g = 1 / (s (s + r_x)) at all points, to second order about the cluster's centre.
void BorderLeaf::add_cluster(const BorderWinding::Cluster& c) {
  const Double4 x = points_from(c.centre[0]);
  const auto &sy = c.second[0], &sz = c.second[1];
  const double curl = c.moment[3 * 2 + 1] - c.moment[3 * 1 + 2];
  // Twice the second moments where the other factor is the derivative of v = (0, -z, y).
  const double k0 = 2.0 * (sz[3] - sy[4]), k1 = 2.0 * (sz[1] - sy[5]), k2 = 2.0 * (sz[5] - sy[2]);
  for (std::size_t row = 0; row < kPoints * kPoints; ++row) {
    const double y = c.centre[1] - row_y(row), z = c.centre[2] - row_z(row);
    std::array<double, 6> a;  // v . second
    for (std::size_t m = 0; m < 6; ++m) a[m] = y * sz[m] - z * sy[m];
    // First order: v . moment, and k, both against the slope of g.
    const double m0 = y * c.moment[6] - z * c.moment[3] + k0, m1 = y * c.moment[7] - z * c.moment[4] + k1,
                 m2 = y * c.moment[8] - z * c.moment[5] + k2;
    const double linear = a[3] * y + a[4] * z, across = a[1] * y * y + a[2] * z * z + 2.0 * a[5] * y * z;
    const double trace = a[0] + a[1] + a[2];
    const Double4 s = square_root(x * x + (y * y + z * z));
    // 1 / g = d = s^2 + s x has the slope r t + s e_x, t = 2 + x / s.
    const Double4 part = s * (s + x), inverse = 1.0 / (s * part), g = inverse * s, one = inverse * part;
    const Double4 t = 2.0 + x * one, ar = x * a[0] + linear, rar = x * (ar + linear) + across;
    const Double4 along = (x * m0 + (y * m1 + z * m2)) * t + s * m0;
    const Double4 quadratic = t * (t * rar + 2.0 * s * ar) + s * s * a[0];
    const Double4 curve = t * trace + one * (2.0 * ar - x * one * one * rar);
    const Double4 winding =
        g * ((y * c.sum[2] - z * c.sum[1] + curl) - g * (along + curve - 2.0 * g * quadratic));
    double* to = &smooth_[kPoints * row];
    store4(to, load4(to) + winding);
  }
}

/// The same form along one edge, by Gauss's rule of two points.
void BorderLeaf::add_edge(const Double3& middle, const Double3& edge, double count) {
  const Double3 a = middle - edge * kGauss, b = middle + edge * kGauss;
  const Double4 ax = points_from(a[0]), bx = points_from(b[0]);
  const double wy = 0.5 * count * edge[1], wz = 0.5 * count * edge[2];
  for (std::size_t row = 0; row < kPoints * kPoints; ++row) {
    const double ay = a[1] - row_y(row), az = a[2] - row_z(row), by = b[1] - row_y(row),
                 bz = b[2] - row_z(row);
    const Double4 sa = square_root(ax * ax + (ay * ay + az * az)),
                  sb = square_root(bx * bx + (by * by + bz * bz));
    const Double4 da = sa * (sa + ax), db = sb * (sb + bx);
    const Double4 winding = ((ay * wz - az * wy) * db + (by * wz - bz * wy) * da) / (da * db);
    double* to = &smooth_[kPoints * row];
    store4(to, load4(to) + winding);
  }
}

Double4 BorderLeaf::points_from(double x) const {
  Double4 out;
  for (std::size_t p = 0; p < kPoints; ++p) out[p] = x - corner_[0] - node(p);
  return out;
}

void BorderLeaf::sum_row(std::size_t row) {
  std::array<std::int64_t, 8> x;
  for (std::size_t n = 0; n < 8; ++n) x[n] = (corner_[0] + static_cast<std::int64_t>(n)) * kSolidQuanta;
  const std::size_t y = row % 8, z = row / 8;
  BoundaryStripRow<2> strips(x, (corner_[1] + static_cast<std::int64_t>(y)) * kSolidQuanta,
                             (corner_[2] + static_cast<std::int64_t>(z)) * kSolidQuanta);
  for (const std::uint32_t e : near_) strips.add(border_.edges_[e]);
  const std::array<double, 8> half = strips.value();
  const auto& w = weights();
  std::array<double, kPoints> line{};
  for (std::size_t k = 0; k < kPoints; ++k)
    for (std::size_t j = 0; j < kPoints; ++j) {
      const double weight = w[z][k] * w[y][j];
      for (std::size_t i = 0; i < kPoints; ++i) line[i] += weight * smooth_[kPoints * (kPoints * k + j) + i];
    }
  for (std::size_t n = 0; n < 8; ++n) {
    double far = 0.0;
    for (std::size_t i = 0; i < kPoints; ++i) far += w[n][i] * line[i];
    share_[8 * row + n] = (far + 2.0 * half[n]) / (4.0 * kPi);
  }
  summed_ |= std::uint64_t{1} << row;
}

double BorderLeaf::at(std::size_t node) {
  if (border_.empty()) return 0.0;
  if (!(summed_ >> (node / 8) & 1)) sum_row(node / 8);
  return share_[node];
}

}  // namespace tessera
