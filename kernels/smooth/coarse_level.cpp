#include "kernels/smooth/coarse_level.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "octree/error.h"
#include "octree/lists.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNone = CoarseBasis::kNone;

/// Corners of the grid fall into 8 classes by the parity of their indices; the supports of the hats of one class
/// are disjoint and fill space.
constexpr std::uint32_t kClasses = kCoarseCorners;
constexpr int kKeyBits = 61;

/// Least edge of the grid's cells in edges of the mesh.
constexpr double kNarrowest = 8.0;

constexpr double kFarthestCell = 1e9;

/// Where a vertex lies in the grid.
struct Place {
  std::array<std::int32_t, 3> cell;
  std::array<float, 3> fraction;

  /// The corner of a class whose hat is not zero here, and its hat.
  std::array<std::int32_t, 3> corner(std::uint32_t parity) const {
    std::array<std::int32_t, 3> c;
    for (std::size_t a = 0; a < 3; ++a)
      c[a] = cell[a] + ((cell[a] ^ static_cast<std::int32_t>(parity >> a)) & 1);
    return c;
  }
  float hat(std::uint32_t parity) const {
    float w = 1.0F;
    for (std::size_t a = 0; a < 3; ++a)
      w *= ((cell[a] ^ static_cast<std::int32_t>(parity >> a)) & 1) != 0 ? fraction[a] : 1.0F - fraction[a];
    return w;
  }
};

std::vector<Place> places(const MeshBlock& block, double edge) {
  std::vector<Place> out(block.position.size());
  for (std::size_t v = 0; v < out.size(); ++v)
    for (std::size_t a = 0; a < 3; ++a) {
      const double x = block.position[v][a] / edge, low = std::floor(x);
      if (!(std::fabs(low) < kFarthestCell))
        throw InputError(
            "vertex " + std::to_string(block.key[v]) +
            " is too far from zero for its mesh: move the mesh towards zero before smoothing it");
      out[v].cell[a] = static_cast<std::int32_t>(low);
      out[v].fraction[a] = static_cast<float>(x - low);
    }
  return out;
}

bool moves(VertexRole role) {
  return role == VertexRole::kFree || role == VertexRole::kLine;
}

/// A line does not see the free vertex at its end: it is held there.
bool sees(const SurfaceRows& rows, std::uint32_t v, std::uint32_t u) {
  return moves(rows.role[u]) && (rows.role[v] == VertexRole::kFree || rows.role[u] == VertexRole::kLine);
}

/// The sum of a row's weights.
double degree(const SurfaceRows& rows, std::uint32_t v) {
  double sum = 0.0;
  for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e)
    sum += static_cast<double>(rows.weight[e]);
  return sum;
}

/// Connected pieces of the mesh inside the supports of one class, by union and find; the root is the smallest number and so the smallest key.
class Pieces {
 public:
  Pieces(const std::vector<Place>& place, const SurfaceRows& rows, std::uint32_t parity)
      : sets_(place.size()), state_(place.size(), kStill) {
    const auto n = static_cast<std::uint32_t>(place.size());
    for (std::uint32_t v = 0; v < n; ++v)
      if (moves(rows.role[v]) && place[v].hat(parity) > 0.0F) state_[v] = kWhole;
    std::vector<std::uint32_t> cut;  // pieces that go on in a star the block does not hold
    for (std::uint32_t v = 0; v < n; ++v) {
      if (state_[v] == kStill) continue;
      const auto corner = place[v].corner(parity);
      for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e) {
        const std::uint32_t u = rows.neighbour[e];
        const bool open = rows.role[u] == VertexRole::kOpen;
        if (!open && (u > v || state_[u] == kStill || rows.role[u] != rows.role[v])) continue;
        if (place[u].corner(parity) != corner) continue;
        if (open)
          cut.push_back(v);
        else
          sets_.unite(v, u);
      }
    }
    for (const std::uint32_t v : cut) state_[sets_.find(v)] = kCut;
  }

  /// kNone where the vertex does not move.
  std::uint32_t root(std::uint32_t v) { return state_[v] == kStill ? kNone : sets_.find(v); }
  bool whole(std::uint32_t root) const { return state_[root] == kWhole; }

 private:
  enum State : std::uint8_t { kStill, kCut, kWhole };

  UnionFind sets_;
  std::vector<std::uint8_t> state_;
};

/// Entries of the matrices of D and D - W.
struct Value {
  double mass = 0.0, stiffness = 0.0;
};

/// A sparse row that is summed up in any order of columns and read in ascending order.
class RowSum {
 public:
  explicit RowSum(std::size_t columns) : sum_(columns), used_(columns, 0) {}
  void add(std::uint32_t column, const Value& value) {
    if (used_[column] == 0) {
      used_[column] = 1;
      columns_.push_back(column);
    }
    sum_[column].mass += value.mass;
    sum_[column].stiffness += value.stiffness;
  }
  /// sink(column, value), then empty again.
  template <class Sink>
  void drain(const Sink& sink) {
    std::sort(columns_.begin(), columns_.end());
    for (const std::uint32_t c : columns_) {
      sink(c, sum_[c]);
      sum_[c] = {};
      used_[c] = 0;
    }
    columns_.clear();
  }

 private:
  std::vector<Value> sum_;
  std::vector<std::uint8_t> used_;
  std::vector<std::uint32_t> columns_;
};

/// sink(unknown, weight)
template <class Sink>
void for_unknowns(const CoarseBasis& basis, std::uint32_t v, const Sink& sink) {
  for (std::size_t k = 0; k < kClasses; ++k)
    if (basis.unknown[v][k] != kNone) sink(basis.unknown[v][k], static_cast<double>(basis.weight[v][k]));
}

void require_right(const SurfaceRows& rows, const CoarseBasis& basis,
                   std::span<const std::uint32_t> vertices) {
  for (const std::uint32_t v : vertices) {
    bool right = basis.right[v] != 0;
    for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e)
      right &= basis.right[rows.neighbour[e]] != 0;
    if (!right)
      throw std::logic_error("coarse level: vertex " + std::to_string(v) + " misses its surroundings");
  }
}

}  // namespace

CoarseOptions coarse_options(double lambda, int order, double edge, std::uint64_t faces) {
  // About 150,000 unknowns for a large sheet, one for 20 vertices of a small one. The wider the cells, the longer the
  // waves that are left to the filter.
  const double wide = std::sqrt(static_cast<double>(faces) / 125000.0);
  const double cells = wide > kNarrowest ? wide : kNarrowest;
  CoarseOptions out;
  out.cell = cells * edge;
  out.order = order;
  out.lambda = order == 2 ? std::sqrt(lambda) : lambda;
  out.stiffness = 0.02 / (cells * cells);
  out.degree = static_cast<int>(std::ceil(2.5 * cells));
  out.lowest = 1.0 / (cells * cells);
  return out;
}

double coarse_reach(const CoarseOptions& options) {
  // Once across the eight cells of a corner; a last bit more for rounding.
  return 2.0 * 1.7320509 * options.cell;
}

CoarseBasis make_coarse_basis(const MeshBlock& block, const SurfaceRows& rows, const CoarseOptions& options) {
  CoarseBasis basis;
  const auto n = static_cast<std::uint32_t>(block.key.size());
  const std::vector<Place> place = places(block, options.cell);
  basis.right.resize(n);
  for (std::uint32_t v = 0; v < n; ++v) basis.right[v] = rows.role[v] != VertexRole::kOpen;
  basis.unknown.resize(n);
  basis.weight.resize(n);
  std::vector<std::uint32_t> number(n);
  for (std::uint32_t parity = 0; parity < kClasses; ++parity) {
    Pieces pieces(place, rows, parity);
    for (std::uint32_t v = 0; v < n; ++v) {
      const std::uint32_t root = pieces.root(v);
      basis.unknown[v][parity] = kNone;
      basis.weight[v][parity] = 0.0F;
      if (root == kNone) continue;
      if (root == v) {
        number[v] = static_cast<std::uint32_t>(basis.name.size());
        basis.name.push_back(std::uint64_t{parity} << kKeyBits | block.key[v]);
        basis.seed.push_back(v);
        basis.on_line.push_back(rows.role[v] == VertexRole::kLine);
      }
      basis.unknown[v][parity] = number[root];
      basis.weight[v][parity] = place[v].hat(parity);
      if (!pieces.whole(root)) basis.right[v] = 0;
    }
  }
  return basis;
}

std::uint64_t coarse_basis_bytes(std::uint64_t vertices) {
  // At the worst every vertex is a piece of its own in all eight supports.
  return vertices * (sizeof(Place) + 4 + 4 + 1 + 1 + kClasses * (8 + 13));
}

std::vector<CoarseEntry> coarse_matrix(const SurfaceRows& rows, const CoarseBasis& basis,
                                       std::span<const std::uint32_t> vertices,
                                       const CoarseOptions& options) {
  require_right(rows, basis, vertices);
  // The system's rows of these vertices applied to the basis, and how many vertices test each unknown.
  RowSum row(basis.name.size());
  std::vector<std::uint32_t> first(1, 0), column;
  std::vector<Value> value;
  for (const std::uint32_t v : vertices) {
    if (moves(rows.role[v])) {
      const double own = degree(rows, v);
      for_unknowns(basis, v, [&](std::uint32_t c, double weight) {
        row.add(c, {own * weight, own * weight});
      });
      for (std::uint32_t k = rows.first[v]; k < rows.first[v + 1]; ++k) {
        const std::uint32_t u = rows.neighbour[k];
        if (!sees(rows, v, u)) continue;
        const auto share = static_cast<double>(rows.weight[k]);
        for_unknowns(basis, u, [&](std::uint32_t c, double weight) { row.add(c, {0.0, -share * weight}); });
      }
    }
    row.drain([&](std::uint32_t c, const Value& x) {
      column.push_back(c);
      value.push_back(x);
    });
    first.push_back(static_cast<std::uint32_t>(column.size()));
  }
  struct Test {
    std::uint32_t place;  ///< of the vertex in `vertices`
    float weight;
  };
  const Lists<Test> tests = make_lists<Test>(basis.name.size(), [&](const auto& put) {
    for (std::uint32_t i = 0; i < vertices.size(); ++i)
      for_unknowns(basis, vertices[i], [&](std::uint32_t c, double weight) {
        put(c, {i, static_cast<float>(weight)});
      });
  });
  std::vector<CoarseEntry> out;
  for (std::uint32_t unknown = 0; unknown < basis.name.size(); ++unknown) {
    for (const Test& test : tests[unknown]) {
      const std::uint32_t i = test.place, v = vertices[i];
      const auto w = static_cast<double>(test.weight);
      for (std::uint32_t e = first[i]; e < first[i + 1]; ++e)
        row.add(column[e], {w * value[e].mass, w * value[e].stiffness});
      // The spread of the values that the vertex is interpolated from.
      const double spread = w * options.stiffness * degree(rows, v);
      row.add(unknown, {0.0, spread});
      for_unknowns(basis, v, [&](std::uint32_t c, double weight) { row.add(c, {0.0, -spread * weight}); });
    }
    row.drain([&](std::uint32_t c, const Value& x) {
      out.push_back({basis.name[unknown], basis.name[c], x.mass, x.stiffness});
    });
  }
  return out;
}

std::vector<CoarseLoad> coarse_load(const SurfaceRows& rows, const CoarseBasis& basis, const StepState& state,
                                    std::span<const std::uint32_t> vertices, const CoarseOptions& options) {
  require_right(rows, basis, vertices);
  std::vector<CoarseLoad> sum(basis.name.size());
  std::vector<std::uint8_t> used(basis.name.size(), 0);
  const auto& [from, now, bend] = state;
  const bool plate = options.order == 2;
  for (const std::uint32_t v : vertices) {
    if (!moves(rows.role[v])) continue;
    // (D - W) of where the vertices are now, as the filter sees it, and of their bend: that of the own kind.
    Double3 curved = {0, 0, 0}, bent = {0, 0, 0};
    for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e) {
      const std::uint32_t u = rows.neighbour[e];
      const auto w = static_cast<double>(rows.weight[e]);
      const std::span<const Double3> there = sees(rows, v, u) ? now : from;
      for (std::size_t a = 0; a < 3; ++a) curved[a] += w * (now[v][a] - there[u][a]);
      if (bend.empty()) continue;
      const bool own = rows.role[u] == rows.role[v];
      for (std::size_t a = 0; a < 3; ++a)
        bent[a] += w * (static_cast<double>(bend[v][a]) - (own ? static_cast<double>(bend[u][a]) : 0.0));
    }
    const double d = degree(rows, v);
    CoarseLoad residual;
    for (std::size_t a = 0; a < 3; ++a) {
      const double moved = d * (now[v][a] - from[v][a]), curve = options.lambda * curved[a];
      residual.moved[a] = plate ? options.lambda * bent[a] - moved : -curve - moved;
      if (plate) residual.bend[a] = -curve - (bend.empty() ? 0.0 : d * static_cast<double>(bend[v][a]));
    }
    for_unknowns(basis, v, [&](std::uint32_t c, double weight) {
      used[c] = 1;
      for (std::size_t a = 0; a < 3; ++a) {
        sum[c].moved[a] += weight * residual.moved[a];
        sum[c].bend[a] += weight * residual.bend[a];
      }
    });
  }
  std::vector<CoarseLoad> out;
  for (std::size_t c = 0; c < sum.size(); ++c) {
    if (used[c] == 0) continue;
    sum[c].row = basis.name[c];
    out.push_back(sum[c]);
  }
  return out;
}

}  // namespace tessera
