#include "kernels/smooth/coarse_level.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "octree/error.h"
#include "octree/lists.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoVertex = CoarseBasis::kNone;

/// Corners of the grid fall into 8 classes by the parity of their indices; the supports of the hats of one class
/// are disjoint and fill space.
constexpr std::uint32_t kClasses = kCoarseCorners;
constexpr std::uint32_t kAllClasses = 0xFF;
constexpr int kKeyBits = 61;

/// Least edge of the grid's cells in edges of the mesh.
constexpr double kNarrowest = 8.0;

/// Beyond, cells are not told apart: the spacing of doubles is an eighth of one.
constexpr double kFarthestCell = 0x1p50;

/// Where a vertex lies in the grid.
struct GridPosition {
  std::array<std::int64_t, 3> cell;
  std::array<float, 3> fraction;

  /// Of the corner of that class among the cell's eight.
  float hat(std::uint32_t parity) const {
    float w = 1.0F;
    for (std::size_t a = 0; a < 3; ++a)
      w *= ((cell[a] ^ static_cast<std::int64_t>(parity >> a)) & 1) != 0 ? fraction[a] : 1.0F - fraction[a];
    return w;
  }
};

std::vector<GridPosition> grid_positions(const MeshBlock& block, double edge) {
  std::vector<GridPosition> out(block.position.size());
  for (std::size_t v = 0; v < out.size(); ++v)
    for (std::size_t a = 0; a < 3; ++a) {
      const double x = block.position[v][a] / edge, low = std::floor(x);
      if (!(std::fabs(low) < kFarthestCell))
        throw InputError(
            "vertex " + std::to_string(block.key[v]) +
            " is too far from zero for its mesh: move the mesh towards zero before smoothing it");
      out[v].cell[a] = static_cast<std::int64_t>(low);
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

/// Whether all eight hats of a cell are surely above zero, rounded too.
bool inside(const GridPosition& position) {
  constexpr float kBoundary = 1e-6F;
  return std::all_of(position.fraction.begin(), position.fraction.end(),
                     [](float f) { return f > kBoundary && f < 1.0F - kBoundary; });
}

/// The classes whose hat is above zero here, a bit each.
std::uint32_t seen_classes(const GridPosition& position) {
  if (inside(position)) return kAllClasses;
  std::uint32_t classes = 0;
  for (std::uint32_t parity = 0; parity < kClasses; ++parity)
    if (position.hat(parity) > 0.0F) classes |= 1U << parity;
  return classes;
}

/// The classes whose corner is the same for both places, a bit each.
std::uint32_t shared_classes(const GridPosition& u, const GridPosition& v) {
  // Of an axis: the classes whose parity there is even, odd.
  constexpr std::array<std::array<std::uint32_t, 2>, 3> kClassesOf = {
      {{0b01010101, 0b10101010}, {0b00110011, 0b11001100}, {0b00001111, 0b11110000}}};
  std::uint32_t classes = kAllClasses;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int64_t low = std::min(u.cell[a], v.cell[a]), high = std::max(u.cell[a], v.cell[a]);
    if (low == high) continue;
    // Neighbours share the corner between them.
    classes &= high - low == 1 ? kClassesOf[a][static_cast<std::size_t>(high & 1)] : 0;
  }
  return classes;
}

/// Connected pieces of the mesh inside the supports of all classes, by union and find. What is connected inside one cell
/// lies in the supports of all its eight corners, so it is united once: a patch. Patches are united class by class.
class Pieces {
 public:
  Pieces(const std::vector<GridPosition>& position, const SurfaceRows& rows) {
    make_patches(position, rows);
    sets_.reset(kClasses * lowest_.size());
    std::vector<std::uint32_t> cut;  // patches and classes that go on in a star the block does not hold
    for (std::uint32_t v = 0; v < patch_.size(); ++v) {
      if (patch_[v] == kNoVertex) continue;
      for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e) {
        const std::uint32_t u = rows.neighbour[e];
        const bool open = rows.role[u] == VertexRole::kOpen;
        if (!open &&
            (u > v || patch_[u] == kNoVertex || patch_[u] == patch_[v] || rows.role[u] != rows.role[v]))
          continue;
        std::uint32_t shared = shared_classes(position[u], position[v]) & seen_classes(position[v]);
        if (!open) shared &= seen_classes(position[u]);
        for (; shared != 0; shared &= shared - 1) {
          const auto parity = static_cast<std::uint32_t>(std::countr_zero(shared));
          if (open)
            cut.push_back(kClasses * patch_[v] + parity);
          else
            sets_.unite(kClasses * patch_[v] + parity, kClasses * patch_[u] + parity);
        }
      }
    }
    sets_.roots();
    whole_.assign(sets_.size(), 1);
    for (const std::uint32_t c : cut) whole_[sets_.find(c)] = 0;
  }

  std::size_t patches() const { return lowest_.size(); }
  /// Of each vertex, kNoVertex where it does not move.
  std::vector<std::uint32_t> take_patches() { return std::move(patch_); }
  /// The vertex with the smallest number: that of the smallest key.
  std::uint32_t lowest(std::uint32_t patch) const { return lowest_[patch]; }
  /// The patch with the lowest vertex of the piece.
  std::uint32_t root(std::uint32_t patch, std::uint32_t parity) {
    return sets_.find(kClasses * patch + parity) / kClasses;
  }
  /// \param root  of a piece
  bool whole(std::uint32_t root, std::uint32_t parity) const { return whole_[kClasses * root + parity] != 0; }

 private:
  void make_patches(const std::vector<GridPosition>& position, const SurfaceRows& rows) {
    const auto n = static_cast<std::uint32_t>(position.size());
    UnionFind sets(n);
    std::vector<std::uint8_t> in(n);
    for (std::uint32_t v = 0; v < n; ++v) in[v] = inside(position[v]);
    for (std::uint32_t v = 0; v < n; ++v) {
      if (in[v] == 0 || !moves(rows.role[v])) continue;
      for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e) {
        const std::uint32_t u = rows.neighbour[e];
        if (u < v && in[u] != 0 && rows.role[u] == rows.role[v] && position[u].cell == position[v].cell)
          sets.unite(v, u);
      }
    }
    const std::vector<std::uint32_t>& root = sets.roots();
    patch_.resize(n);
    for (std::uint32_t v = 0; v < n; ++v) {
      if (!moves(rows.role[v])) {
        patch_[v] = kNoVertex;
      } else if (root[v] == v) {
        patch_[v] = static_cast<std::uint32_t>(lowest_.size());
        lowest_.push_back(v);
      } else {
        patch_[v] = patch_[root[v]];
      }
    }
  }

  std::vector<std::uint32_t> patch_;   ///< of each vertex
  std::vector<std::uint32_t> lowest_;  ///< of each patch
  UnionFind sets_;                     ///< of patches, in every class
  std::vector<std::uint8_t> whole_;    ///< by root
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

double coarse_halo(const CoarseOptions& options) {
  // Once across the eight cells of a corner; a last bit more for rounding.
  return 2.0 * 1.7320509 * options.cell;
}

CoarseBasis make_coarse_basis(const MeshBlock& block, const SurfaceRows& rows, const CoarseOptions& options) {
  CoarseBasis basis;
  const auto n = static_cast<std::uint32_t>(block.key.size());
  const std::vector<GridPosition> position = grid_positions(block, options.cell);
  basis.right.resize(n);
  for (std::uint32_t v = 0; v < n; ++v) basis.right[v] = rows.role[v] != VertexRole::kOpen;
  Pieces pieces(position, rows);
  basis.unknown.resize(pieces.patches());
  std::vector<std::uint8_t> whole(pieces.patches(), 1);
  for (std::uint32_t parity = 0; parity < kClasses; ++parity)
    for (std::uint32_t p = 0; p < pieces.patches(); ++p) {
      const std::uint32_t v = pieces.lowest(p);
      basis.unknown[p][parity] = kNoVertex;
      if ((seen_classes(position[v]) >> parity & 1U) == 0) continue;
      const std::uint32_t root = pieces.root(p, parity);
      if (root == p) {
        basis.unknown[p][parity] = static_cast<std::uint32_t>(basis.name.size());
        basis.name.push_back(std::uint64_t{parity} << kKeyBits | block.key[v]);
        basis.seed.push_back(v);
        basis.on_line.push_back(rows.role[v] == VertexRole::kLine);
      }
      basis.unknown[p][parity] = basis.unknown[root][parity];
      if (!pieces.whole(root, parity)) whole[p] = 0;
    }
  basis.patch = pieces.take_patches();
  basis.weight.resize(n);
  for (std::uint32_t v = 0; v < n; ++v) {
    if (basis.patch[v] == kNoVertex) continue;
    for (std::uint32_t parity = 0; parity < kClasses; ++parity)
      basis.weight[v][parity] = position[v].hat(parity);
    if (whole[basis.patch[v]] == 0) basis.right[v] = 0;
  }
  return basis;
}

std::uint64_t coarse_basis_bytes(std::uint64_t vertices) {
  // At the worst every vertex is a patch and a piece of its own in all eight supports.
  return vertices * (sizeof(GridPosition) + 4 + 4 + 1 + 1 + kClasses * (8 + 13 + 5));
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
      basis.for_unknowns(v, [&](std::uint32_t c, double weight) {
        row.add(c, {own * weight, own * weight});
      });
      for (std::uint32_t k = rows.first[v]; k < rows.first[v + 1]; ++k) {
        const std::uint32_t u = rows.neighbour[k];
        if (!sees(rows, v, u)) continue;
        const auto share = static_cast<double>(rows.weight[k]);
        basis.for_unknowns(u, [&](std::uint32_t c, double weight) { row.add(c, {0.0, -share * weight}); });
      }
    }
    row.drain([&](std::uint32_t c, const Value& x) {
      column.push_back(c);
      value.push_back(x);
    });
    first.push_back(static_cast<std::uint32_t>(column.size()));
  }
  struct Test {
    std::uint32_t position;  ///< of the vertex in `vertices`
    float weight;
  };
  const Lists<Test> tests = make_lists<Test>(basis.name.size(), [&](const auto& put) {
    for (std::uint32_t i = 0; i < vertices.size(); ++i)
      basis.for_unknowns(vertices[i], [&](std::uint32_t c, double weight) {
        put(c, {i, static_cast<float>(weight)});
      });
  });
  std::vector<CoarseEntry> out;
  for (std::uint32_t unknown = 0; unknown < basis.name.size(); ++unknown) {
    for (const Test& test : tests[unknown]) {
      const std::uint32_t i = test.position, v = vertices[i];
      const auto w = static_cast<double>(test.weight);
      for (std::uint32_t e = first[i]; e < first[i + 1]; ++e)
        row.add(column[e], {w * value[e].mass, w * value[e].stiffness});
      // The spread of the values that the vertex is interpolated from.
      const double spread = w * options.stiffness * degree(rows, v);
      row.add(unknown, {0.0, spread});
      basis.for_unknowns(v, [&](std::uint32_t c, double weight) { row.add(c, {0.0, -spread * weight}); });
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
  const auto& [from, now, laplacian] = state;
  const bool plate = options.order == 2;
  for (const std::uint32_t v : vertices) {
    if (!moves(rows.role[v])) continue;
    // (D - W) of where the vertices are now, as the filter sees it, and of their bend: that of the own kind.
    Double3 curved = {0, 0, 0}, laplacians = {0, 0, 0};
    for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e) {
      const std::uint32_t u = rows.neighbour[e];
      const auto w = static_cast<double>(rows.weight[e]);
      const std::span<const Double3> there = sees(rows, v, u) ? now : from;
      for (std::size_t a = 0; a < 3; ++a) curved[a] += w * (now[v][a] - there[u][a]);
      if (laplacian.empty()) continue;
      const bool own = rows.role[u] == rows.role[v];
      for (std::size_t a = 0; a < 3; ++a)
        laplacians[a] +=
            w * (static_cast<double>(laplacian[v][a]) - (own ? static_cast<double>(laplacian[u][a]) : 0.0));
    }
    const double d = degree(rows, v);
    CoarseLoad residual;
    for (std::size_t a = 0; a < 3; ++a) {
      const double moved = d * (now[v][a] - from[v][a]), curve = options.lambda * curved[a];
      residual.moved[a] = plate ? options.lambda * laplacians[a] - moved : -curve - moved;
      if (plate)
        residual.laplacian[a] = -curve - (laplacian.empty() ? 0.0 : d * static_cast<double>(laplacian[v][a]));
    }
    basis.for_unknowns(v, [&](std::uint32_t c, double weight) {
      used[c] = 1;
      for (std::size_t a = 0; a < 3; ++a) {
        sum[c].moved[a] += weight * residual.moved[a];
        sum[c].laplacian[a] += weight * residual.laplacian[a];
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
