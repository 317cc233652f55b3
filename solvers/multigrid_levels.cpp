#include "solvers/multigrid_levels.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <utility>

#include "solvers/multigrid_interpolation.h"

namespace tessera {
namespace {

using Point = std::array<double, 3>;

constexpr double kShort = 2.5;        // an edge up to so many times the shortest at an end couples clusters
constexpr double kLeastShrink = 0.8;  // a level that keeps more than this share of its unknowns is the last
constexpr std::size_t kThinRow = 4;   // entries a row of P up to which P^T A P is formed without A P

NodeGraph pattern_of(const SparseMatrix& a) {
  NodeGraph g;
  g.start.assign(static_cast<std::size_t>(a.rows) + 1, 0);
  g.to.reserve(a.entries());
  for (std::int32_t i = 0; i < a.rows; ++i) {
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e)
      if (a.column[e] != i) g.to.push_back(a.column[e]);
    g.start[i + 1] = static_cast<std::int32_t>(g.to.size());
  }
  return g;
}

/// The edges that are not much longer than the shortest at one of their ends.
NodeGraph short_edges(const NodeGraph& g, std::span<const Point> positions) {
  const std::size_t n = g.start.size() - 1;
  const auto squared = [&](std::size_t i, std::int32_t j) {
    double s = 0.0;
    for (int d = 0; d < 3; ++d)
      s += (positions[i][d] - positions[j][d]) * (positions[i][d] - positions[j][d]);
    return s;
  };
  std::vector<double> shortest(n, std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < n; ++i)
    for (std::int32_t e = g.start[i]; e < g.start[i + 1]; ++e)
      shortest[i] = std::min(shortest[i], squared(i, g.to[e]));
  NodeGraph out;
  out.start.assign(n + 1, 0);
  out.to.reserve(g.to.size());
  for (std::size_t i = 0; i < n; ++i) {
    for (std::int32_t e = g.start[i]; e < g.start[i + 1]; ++e)
      if (squared(i, g.to[e]) <= kShort * kShort * std::max(shortest[i], shortest[g.to[e]]))
        out.to.push_back(g.to[e]);
    out.start[i + 1] = static_cast<std::int32_t>(out.to.size());
  }
  return out;
}

/// Seeds no nearer than three edges to each other take their neighbours; what is left joins a cluster beside
/// it.
Clusters cluster(const NodeGraph& g) {
  const auto n = static_cast<std::int32_t>(g.start.size()) - 1;
  Clusters c;
  c.of.assign(static_cast<std::size_t>(n), -1);
  for (std::int32_t i = 0; i < n; ++i) {
    bool open = c.of[i] < 0;
    for (std::int32_t e = g.start[i]; open && e < g.start[i + 1]; ++e) open = c.of[g.to[e]] < 0;
    if (!open) continue;
    const auto id = static_cast<std::int32_t>(c.seed.size());
    c.seed.push_back(i);
    c.of[i] = id;
    for (std::int32_t e = g.start[i]; e < g.start[i + 1]; ++e) c.of[g.to[e]] = id;
  }
  std::vector<std::int32_t> joined(c.of);
  for (std::int32_t i = 0; i < n; ++i)
    for (std::int32_t e = g.start[i]; joined[i] < 0 && e < g.start[i + 1]; ++e) joined[i] = c.of[g.to[e]];
  c.of = std::move(joined);
  return c;
}

/// Which clusters touch.
NodeGraph cluster_graph(const NodeGraph& g, const Clusters& c) {
  const std::size_t m = c.seed.size();
  std::vector<std::int32_t> first(m + 1, 0), member(c.of.size());
  for (const std::int32_t id : c.of) ++first[id + 1];
  for (std::size_t k = 0; k < m; ++k) first[k + 1] += first[k];
  {
    std::vector<std::int32_t> next(first.begin(), first.end() - 1);
    for (std::size_t i = 0; i < c.of.size(); ++i) member[next[c.of[i]]++] = static_cast<std::int32_t>(i);
  }
  NodeGraph out;
  out.start.assign(m + 1, 0);
  std::vector<std::int32_t> seen(m, -1);
  for (std::size_t k = 0; k < m; ++k) {
    const auto self = static_cast<std::int32_t>(k);
    const auto begin = static_cast<std::ptrdiff_t>(out.to.size());
    seen[k] = self;
    for (std::int32_t q = first[k]; q < first[k + 1]; ++q)
      for (std::int32_t e = g.start[member[q]]; e < g.start[member[q] + 1]; ++e)
        if (const std::int32_t other = c.of[g.to[e]]; seen[other] != self) {
          seen[other] = self;
          out.to.push_back(other);
        }
    std::sort(out.to.begin() + begin, out.to.end());
    out.start[k + 1] = static_cast<std::int32_t>(out.to.size());
  }
  return out;
}

/// P^T A P. With thin rows A P is never stored: its rows are formed where they are added, about three times
/// each.
SparseMatrix galerkin(const SparseMatrix& a, const SparseMatrix& p) {
  const SparseMatrix r = transpose(p);
  if (p.entries() > kThinRow * static_cast<std::size_t>(p.rows)) return product(r, product(a, p));
  SparseMatrix out;
  out.rows = out.columns = p.columns;
  out.start.assign(static_cast<std::size_t>(p.columns) + 1, 0);
  std::vector<std::int32_t> seen(static_cast<std::size_t>(p.columns), -1), row;
  std::vector<double> value(static_cast<std::size_t>(p.columns), 0.0);
  for (std::int32_t k = 0; k < r.rows; ++k) {
    row.clear();
    for (std::int32_t e = r.start[k]; e < r.start[k + 1]; ++e)
      for (std::int32_t f = a.start[r.column[e]]; f < a.start[r.column[e] + 1]; ++f) {
        const double ra = r.value[e] * a.value[f];
        for (std::int32_t q = p.start[a.column[f]]; q < p.start[a.column[f] + 1]; ++q) {
          const std::int32_t j = p.column[q];
          if (seen[j] != k) {
            seen[j] = k;
            row.push_back(j);
            value[j] = 0.0;
          }
          value[j] += ra * p.value[q];
        }
      }
    std::sort(row.begin(), row.end());
    for (const std::int32_t j : row) {
      out.column.push_back(j);
      out.value.push_back(value[j]);
    }
    out.start[k + 1] = static_cast<std::int32_t>(out.column.size());
  }
  return out;
}

std::vector<double> inverse_diagonal_of(const SparseMatrix& a) {
  std::vector<double> d(static_cast<std::size_t>(a.rows));
  for (std::int32_t i = 0; i < a.rows; ++i) d[i] = 1.0 / entry(a, i, i);
  return d;
}

}  // namespace

std::uint64_t MultigridLevels::bytes() const {
  std::uint64_t total = 0;
  for (const MultigridLevel& l : levels)
    total += l.own.bytes() + l.prolongation.bytes() + l.inverse_diagonal.capacity() * sizeof(double);
  return total;
}

std::size_t MultigridLevels::entries() const {
  std::size_t total = 0;
  for (const MultigridLevel& l : levels) total += l.own.entries() + l.prolongation.entries();
  return total;
}

MultigridLevels multigrid_levels(const SparseMatrix& a, const MultigridLevelsOptions& options) {
  assert(options.positions.empty() || options.positions.size() == static_cast<std::size_t>(a.rows));
  MultigridLevels out;
  out.levels.emplace_back();
  out.levels[0].matrix = &a;
  out.levels[0].inverse_diagonal = inverse_diagonal_of(a);
  std::vector<Point> positions(options.positions.begin(), options.positions.end());
  NodeGraph graph = pattern_of(options.neighbours != nullptr ? *options.neighbours : a);
  while (out.levels.back().matrix->rows > options.coarsest) {
    const Clusters clusters = cluster(positions.empty() ? graph : short_edges(graph, positions));
    if (static_cast<double>(clusters.seed.size()) > kLeastShrink * static_cast<double>(clusters.of.size()))
      break;
    std::vector<Point> coarse;
    if (!positions.empty())
      for (const std::int32_t s : clusters.seed) coarse.push_back(positions[s]);
    graph = cluster_graph(graph, clusters);
    SparseMatrix p = positions.empty() ? constant_interpolation(clusters)
                     : options.order == 1
                         ? linear_interpolation(clusters, graph, positions, coarse)
                         : smooth_interpolation(clusters, graph, positions, coarse, out.checked_out);
    p.column.shrink_to_fit();
    p.value.shrink_to_fit();
    positions = std::move(coarse);
    MultigridLevel next;
    next.own = galerkin(*out.levels.back().matrix, p);
    next.inverse_diagonal = inverse_diagonal_of(next.own);
    out.levels.back().prolongation = std::move(p);
    out.levels.push_back(std::move(next));
    for (std::size_t k = 1; k < out.levels.size(); ++k) out.levels[k].matrix = &out.levels[k].own;
  }
  return out;
}

}  // namespace tessera
