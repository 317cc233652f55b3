#include "solvers/multigrid_interpolation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr double kSupport = 2.0;  // of a seed's weight, in mean distances to its neighbours
constexpr double kFlat = 1e-3;    // share of the trace added to the moment matrix: the surface may be flat
constexpr double kSmallWeight = 1e-4;  // not stored
constexpr double kLargestSum = 3.0;    // of |weights|; more would amplify errors
constexpr double kLargestMiss = 0.25;  // of the own position, in reaches
constexpr std::size_t kFewestSeeds = 4;

bool adjacent(const NodeGraph& g, std::int32_t a, std::int32_t b) {
  return std::binary_search(g.to.begin() + g.start[a], g.to.begin() + g.start[a + 1], b);
}

/// Weights of u and v for the point of the triangle (0, u, v) that is closest to d, and its squared distance.
struct InTriangle {
  double a = 0.0, b = 0.0, distance = 0.0;
};

InTriangle closest_in_triangle(const Double3& u, const Double3& v, const Double3& d) {
  const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), du = dot(d, u), dv = dot(d, v);
  const double det = uu * vv - uv * uv;
  const auto distance = [&](double a, double b) {
    const Double3 e = d - u * a - v * b;
    return dot(e, e);
  };
  if (det > 1e-10 * uu * vv) {
    const double a = (du * vv - dv * uv) / det, b = (dv * uu - du * uv) / det;
    if (a >= 0.0 && b >= 0.0 && a + b <= 1.0) return {a, b, distance(a, b)};
  }
  const auto unit = [](double t) { return std::clamp(t, 0.0, 1.0); };
  InTriangle best{0.0, 0.0, std::numeric_limits<double>::infinity()};
  const auto offer = [&](double a, double b) {
    const double s = distance(a, b);
    if (s < best.distance) best = {a, b, s};
  };
  if (uu > 0.0) offer(unit(du / uu), 0.0);
  if (vv > 0.0) offer(0.0, unit(dv / vv));
  const double ww = uu - 2.0 * uv + vv;
  if (ww > 0.0) {
    const double t = unit((dv - du + uu - uv) / ww);
    offer(1.0 - t, t);
  }
  return best;
}

struct Row {
  std::vector<std::int32_t> cluster;
  std::vector<double> weight;
};

/// Entries sorted by cluster.
void linear_row(const Clusters& c, const NodeGraph& touching, std::span<const Double3> fine,
                std::span<const Double3> coarse, std::int32_t i, Row& row) {
  const std::int32_t own = c.of[i];
  std::array<std::int32_t, 3> corner = {own, own, own};
  std::array<double, 3> weight = {1.0, 0.0, 0.0};
  if (c.seed[own] != i) {
    const Double3 d = fine[i] - coarse[own];
    // Of triangles that are as close, the smallest.
    const double slack = 1e-3 * dot(d, d);
    double best = dot(d, d), best_size = 0.0;
    bool found = false;
    for (std::int32_t e = touching.start[own]; e < touching.start[own + 1]; ++e) {
      const std::int32_t a = touching.to[e];
      const Double3 u = coarse[a] - coarse[own];
      for (std::int32_t f = e + 1; f < touching.start[own + 1]; ++f) {
        const std::int32_t b = touching.to[f];
        if (!adjacent(touching, a, b)) continue;
        const Double3 v = coarse[b] - coarse[own];
        const InTriangle t = closest_in_triangle(u, v, d);
        const double size = dot(u, u) + dot(v, v);
        if (t.distance < best - slack || (found && t.distance < best + slack && size < best_size)) {
          found = true;
          best = t.distance;
          best_size = size;
          corner = {own, a, b};
          weight = {1.0 - t.a - t.b, t.a, t.b};
        }
      }
    }
  }
  row.cluster.clear();
  row.weight.clear();
  std::array<int, 3> by_cluster = {0, 1, 2};
  std::sort(by_cluster.begin(), by_cluster.end(), [&](int x, int y) { return corner[x] < corner[y]; });
  for (const int k : by_cluster)
    if (weight[k] > 1e-6) {
      row.cluster.push_back(corner[k]);
      row.weight.push_back(weight[k]);
    }
}

/// Weights at x of the linear function that fits values at the seeds `row.cluster` best; replaces row.weight.
/// \return whether the row passes its checks
bool smooth_row(std::span<const Double3> coarse, std::span<const double> support, const Double3& x,
                Row& row) {
  row.weight.clear();
  double total = 0.0;
  Double3 mean{};
  std::size_t kept = 0;
  for (const std::int32_t j : row.cluster) {
    const Double3 d = coarse[j] - x;
    const double q = 1.0 - dot(d, d) / (support[j] * support[j]);
    if (!(q > 0.0)) continue;
    const double w = q * q * q;
    row.cluster[kept++] = j;
    row.weight.push_back(w);
    total += w;
    for (int t = 0; t < 3; ++t) mean[t] += w * d[t];
  }
  row.cluster.resize(kept);
  if (kept < kFewestSeeds) return false;
  for (double& m : mean) m /= total;
  Matrix3 moments = Matrix3::zero();
  double largest_support = 0.0;
  for (std::size_t k = 0; k < kept; ++k) {
    const Double3 d = coarse[row.cluster[k]] - x - mean;
    largest_support = std::max(largest_support, support[row.cluster[k]]);
    for (int r = 0; r < 3; ++r)
      for (int q = 0; q < 3; ++q) moments(r, q) += row.weight[k] * d[r] * d[q];
  }
  const double trace = moments(0, 0) + moments(1, 1) + moments(2, 2);
  if (!(trace > 0.0)) return false;
  for (int r = 0; r < 3; ++r) moments(r, r) += kFlat * trace;
  Double3 y = -mean;
  eliminate(moments, y);
  double absolute = 0.0;
  Double3 miss{};
  kept = 0;
  for (std::size_t k = 0; k < row.cluster.size(); ++k) {
    const Double3 d = coarse[row.cluster[k]] - x;
    const double w = row.weight[k] * (1.0 / total + dot(y, d - mean));
    absolute += std::fabs(w);
    for (int t = 0; t < 3; ++t) miss[t] += w * d[t];
    if (std::fabs(w) < kSmallWeight) continue;
    row.cluster[kept] = row.cluster[k];
    row.weight[kept++] = w;
  }
  row.cluster.resize(kept);
  row.weight.resize(kept);
  return absolute <= kLargestSum &&
         dot(miss, miss) <= kLargestMiss * kLargestMiss * largest_support * largest_support;
}

SparseMatrix empty_rows(const Clusters& c, std::size_t entries_per_row) {
  SparseMatrix p;
  p.rows = static_cast<std::int32_t>(c.of.size());
  p.columns = static_cast<std::int32_t>(c.seed.size());
  p.start.assign(c.of.size() + 1, 0);
  p.column.reserve(c.of.size() * entries_per_row);
  p.value.reserve(c.of.size() * entries_per_row);
  return p;
}

void append(SparseMatrix& p, std::int32_t i, const Row& row) {
  p.column.insert(p.column.end(), row.cluster.begin(), row.cluster.end());
  p.value.insert(p.value.end(), row.weight.begin(), row.weight.end());
  p.start[i + 1] = static_cast<std::int32_t>(p.column.size());
}

}  // namespace

SparseMatrix constant_interpolation(const Clusters& clusters) {
  SparseMatrix p = empty_rows(clusters, 1);
  for (std::int32_t i = 0; i < p.rows; ++i) append(p, i, {{clusters.of[i]}, {1.0}});
  return p;
}

SparseMatrix linear_interpolation(const Clusters& clusters, const NodeGraph& touching,
                                  std::span<const Double3> fine, std::span<const Double3> coarse) {
  SparseMatrix p = empty_rows(clusters, 3);
  Row row;
  for (std::int32_t i = 0; i < p.rows; ++i) {
    linear_row(clusters, touching, fine, coarse, i, row);
    append(p, i, row);
  }
  return p;
}

SparseMatrix smooth_interpolation(const Clusters& clusters, const NodeGraph& touching,
                                  std::span<const Double3> fine, std::span<const Double3> coarse,
                                  std::size_t& checked_out) {
  std::vector<double> support(coarse.size(), 0.0);
  for (std::size_t k = 0; k < coarse.size(); ++k) {
    for (std::int32_t e = touching.start[k]; e < touching.start[k + 1]; ++e) {
      const Double3 d = coarse[touching.to[e]] - coarse[k];
      support[k] += norm(d);
    }
    if (touching.start[k + 1] > touching.start[k])
      support[k] *= kSupport / (touching.start[k + 1] - touching.start[k]);
  }
  SparseMatrix p = empty_rows(clusters, 12);
  Row row;
  for (std::int32_t i = 0; i < p.rows; ++i) {
    const std::int32_t own = clusters.of[i];
    row.cluster.assign(1, own);
    for (std::int32_t e = touching.start[own]; e < touching.start[own + 1]; ++e) {
      const std::int32_t j = touching.to[e];
      row.cluster.push_back(j);
      row.cluster.insert(row.cluster.end(), touching.to.begin() + touching.start[j],
                         touching.to.begin() + touching.start[j + 1]);
    }
    std::sort(row.cluster.begin(), row.cluster.end());
    row.cluster.erase(std::unique(row.cluster.begin(), row.cluster.end()), row.cluster.end());
    if (!smooth_row(coarse, support, fine[i], row)) {
      ++checked_out;
      linear_row(clusters, touching, fine, coarse, i, row);
    }
    append(p, i, row);
  }
  return p;
}

}  // namespace tessera
