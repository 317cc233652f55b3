#include "solvers/multigrid_levels.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <span>
#include <utility>

#include "octree/lists.h"
#include "solvers/multigrid_interpolation.h"

namespace tessera {
namespace {

constexpr double kShort = 2.5;      // an edge up to so many times the shortest at an end couples clusters
constexpr double kMinShrink = 0.8;  // a level that keeps more than this share of its unknowns is the last

/// A graph that somebody else holds; a node may be named among its own neighbours.
struct GraphView {
  std::span<const std::int32_t> start, to;
};

/// Tells which edges are not much longer than the shortest at one of their ends. Without positions all are.
class ShortEdges {
 public:
  ShortEdges(const GraphView& g, std::span<const Double3> positions) : positions_(positions) {
    if (positions.empty()) return;
    shortest_.assign(positions.size(), std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < shortest_.size(); ++i)
      for (std::int32_t e = g.start[i]; e < g.start[i + 1]; ++e)
        if (static_cast<std::size_t>(g.to[e]) != i)
          shortest_[i] = std::min(shortest_[i], squared(i, g.to[e]));
  }
  bool operator()(std::int32_t i, std::int32_t j) const {
    return positions_.empty() || squared(i, j) <= kShort * kShort * std::max(shortest_[i], shortest_[j]);
  }

 private:
  double squared(std::size_t i, std::int32_t j) const {
    return squared_distance(positions_[i], positions_[j]);
  }
  std::span<const Double3> positions_;
  std::vector<double> shortest_;
};

/// Seeds no nearer than three short edges to each other take their neighbours; what is left joins a cluster beside
/// it.
Clusters cluster(const GraphView& g, const ShortEdges& is_short) {
  const auto n = static_cast<std::int32_t>(g.start.size()) - 1;
  Clusters c;
  c.of.assign(static_cast<std::size_t>(n), -1);
  for (std::int32_t i = 0; i < n; ++i) {
    bool open = c.of[i] < 0;
    for (std::int32_t e = g.start[i]; open && e < g.start[i + 1]; ++e)
      open = c.of[g.to[e]] < 0 || !is_short(i, g.to[e]);
    if (!open) continue;
    const auto id = static_cast<std::int32_t>(c.seed.size());
    c.seed.push_back(i);
    for (std::int32_t e = g.start[i]; e < g.start[i + 1]; ++e)
      if (is_short(i, g.to[e])) c.of[g.to[e]] = id;
    c.of[i] = id;
  }
  std::vector<std::int32_t> joined(c.of);
  for (std::int32_t i = 0; i < n; ++i)
    for (std::int32_t e = g.start[i]; joined[i] < 0 && e < g.start[i + 1]; ++e)
      if (is_short(i, g.to[e])) joined[i] = c.of[g.to[e]];
  c.of = std::move(joined);
  return c;
}

/// Which clusters touch.
NodeGraph cluster_graph(const GraphView& g, const Clusters& c) {
  const std::size_t m = c.seed.size();
  const auto members = make_lists<std::int32_t, std::int32_t>(m, [&](const auto& put) {
    for (std::size_t i = 0; i < c.of.size(); ++i) put(c.of[i], static_cast<std::int32_t>(i));
  });
  NodeGraph out;
  out.start.assign(m + 1, 0);
  std::vector<std::int32_t> seen(m, -1);
  for (std::size_t k = 0; k < m; ++k) {
    const auto self = static_cast<std::int32_t>(k);
    const auto begin = static_cast<std::ptrdiff_t>(out.to.size());
    seen[k] = self;
    for (const std::int32_t i : members[k])
      for (std::int32_t e = g.start[i]; e < g.start[i + 1]; ++e)
        if (const std::int32_t other = c.of[g.to[e]]; seen[other] != self) {
          seen[other] = self;
          out.to.push_back(other);
        }
    std::sort(out.to.begin() + begin, out.to.end());
    out.start[k + 1] = static_cast<std::int32_t>(out.to.size());
  }
  return out;
}

/// One row of sums, by column.
class SparseRow {
 public:
  explicit SparseRow(std::int32_t columns)
      : value_(static_cast<std::size_t>(columns), 0.0), seen_(static_cast<std::size_t>(columns), 0) {}
  void add(std::int32_t j, double v) {
    if (!seen_[j]) {
      seen_[j] = 1;
      value_[j] = 0.0;
      columns_.push_back(j);
    }
    value_[j] += v;
  }
  void clear() {
    for (const std::int32_t j : columns_) seen_[j] = 0;
    columns_.clear();
  }
  void sort() { std::sort(columns_.begin(), columns_.end()); }
  const std::vector<std::int32_t>& columns() const { return columns_; }
  double operator[](std::int32_t j) const { return value_[j]; }

 private:
  std::vector<double> value_;
  std::vector<std::uint8_t> seen_;
  std::vector<std::int32_t> columns_;
};

/// P^T A P, one row at a time: first the row of P^T A, then that times P. Neither product is ever stored.
SparseMatrix galerkin(const SparseMatrix& a, const SparseMatrix& p) {
  const SparseMatrix r = transpose(p);
  SparseMatrix out;
  out.rows = out.columns = p.columns;
  out.start.assign(static_cast<std::size_t>(p.columns) + 1, 0);
  SparseRow ra(a.columns), row(p.columns);
  for (std::int32_t k = 0; k < r.rows; ++k) {
    ra.clear();
    row.clear();
    for (std::int32_t e = r.start[k]; e < r.start[k + 1]; ++e)
      for (std::int32_t f = a.start[r.column[e]]; f < a.start[r.column[e] + 1]; ++f)
        ra.add(a.column[f], r.value[e] * a.value[f]);
    for (const std::int32_t i : ra.columns())
      for (std::int32_t f = p.start[i]; f < p.start[i + 1]; ++f) row.add(p.column[f], ra[i] * p.value[f]);
    row.sort();
    for (const std::int32_t j : row.columns()) {
      out.column.push_back(j);
      out.value.push_back(row[j]);
    }
    out.start[k + 1] = static_cast<std::int32_t>(out.column.size());
  }
  out.column.shrink_to_fit();
  out.value.shrink_to_fit();
  return out;
}

std::vector<double> inverse_diagonal_of(const SparseMatrix& a) {
  std::vector<double> d(static_cast<std::size_t>(a.rows));
  for (std::int32_t i = 0; i < a.rows; ++i) d[i] = 1.0 / entry(a, i, i);
  return d;
}

Prolongation compact(const SparseMatrix& p) {
  return {.start = p.start,
          .column = {p.column.begin(), p.column.end()},
          .weight = {p.value.begin(), p.value.end()}};
}

}  // namespace

std::uint64_t MultigridLevels::bytes() const {
  std::uint64_t total = 0;
  for (const MultigridLevel& l : levels)
    total += l.own.bytes() + l.own_skew.bytes() + l.prolongation.column.capacity() * 8 +
             l.prolongation.start.capacity() * 4 + l.inverse_diagonal.capacity() * sizeof(double);
  return total;
}

std::size_t MultigridLevels::entries() const {
  std::size_t total = 0;
  for (const MultigridLevel& l : levels) total += l.own.entries() + l.prolongation.column.size();
  return total;
}

MultigridLevels multigrid_levels(const SparseMatrix& a, const MultigridLevelsOptions& options) {
  assert(options.positions.empty() || options.positions.size() == static_cast<std::size_t>(a.rows));
  MultigridLevels out;
  out.levels.emplace_back();
  out.levels[0].matrix = &a;
  out.levels[0].skew = options.skew;
  out.levels[0].inverse_diagonal = inverse_diagonal_of(a);
  std::span<const Double3> positions = options.positions;
  std::vector<Double3> owned;  // positions below the finest level
  const SparseMatrix& mesh = options.neighbours != nullptr ? *options.neighbours : a;
  GraphView graph{mesh.start, mesh.column};
  NodeGraph coarser;
  while (out.levels.back().matrix->rows > options.coarsest) {
    const Clusters clusters = cluster(graph, ShortEdges(graph, positions));
    if (static_cast<double>(clusters.seed.size()) > kMinShrink * static_cast<double>(clusters.of.size()))
      break;
    std::vector<Double3> coarse;
    if (!positions.empty()) {
      coarse.reserve(clusters.seed.size());
      for (const std::int32_t s : clusters.seed) coarse.push_back(positions[s]);
    }
    coarser = cluster_graph(graph, clusters);
    graph = {coarser.start, coarser.to};
    const std::size_t level = out.levels.size() - 1;
    const bool smooth =
        options.order > 1 || (level > 0 && out.levels[level].matrix->rows <=
                                               options.smooth_share * out.levels[level - 1].matrix->rows);
    SparseMatrix p = positions.empty() ? constant_interpolation(clusters)
                     : !smooth         ? linear_interpolation(clusters, coarser, positions, coarse)
                               : smooth_interpolation(clusters, coarser, positions, coarse, out.checked_out);
    // Weights are kept in single precision; the coarse matrix is made of the same weights.
    for (double& w : p.value) w = static_cast<float>(w);
    owned = std::move(coarse);
    positions = owned;
    MultigridLevel next;
    next.own = galerkin(*out.levels.back().matrix, p);
    if (options.skew != nullptr) next.own_skew = galerkin(*out.levels.back().skew, p);
    next.inverse_diagonal = inverse_diagonal_of(next.own);
    out.levels.back().prolongation = compact(p);
    out.levels.push_back(std::move(next));
    for (std::size_t k = 1; k < out.levels.size(); ++k) {
      out.levels[k].matrix = &out.levels[k].own;
      if (options.skew != nullptr) out.levels[k].skew = &out.levels[k].own_skew;
    }
  }
  return out;
}

}  // namespace tessera
