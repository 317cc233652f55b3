#include "kernels/merge/blend_field.h"

#include <algorithm>
#include <cmath>

#include "kernels/field/band.h"
#include "kernels/field/edge_roots.h"

namespace tessera {
namespace {

constexpr double kNearCells =
    3.0;  ///< how far from the surface nodes get a value: a cell and a half would do for roots
constexpr int kMostSteps = 12;       ///< of the root finder; a plane takes one
constexpr double kRootError = 1e-5;  ///< cells

class Builder {
 public:
  Builder(const BlendBlock& block, const MergeBlend& blend) : block_(block), blend_(blend) {
    field_.origin = block.corner;
    field_.cells = block.cells;
  }

  DirectedField build(std::span<const Int3> leaves, const std::function<void()>& pause) {
    place(leaves);
    for (BandLeaf& leaf : field_.leaves) {
      if (pause) pause();
      fill(leaf);
    }
    for (std::size_t l = 0; l < field_.leaves.size(); ++l) {
      if (pause) pause();
      for (std::size_t axis = 0; axis < 3; ++axis) find_roots(l, axis);
    }
    return std::move(field_);
  }

 private:
  void place(std::span<const Int3> leaves) {
    const Int3 d = field_.leaf_dims();
    const auto at = [&](const Int3& l) {
      return static_cast<std::size_t>(l[0] + 1) +
             static_cast<std::size_t>(d[0]) *
                 (static_cast<std::size_t>(l[1] + 1) +
                  static_cast<std::size_t>(d[1]) * static_cast<std::size_t>(l[2] + 1));
    };
    std::vector<Int3> sorted(leaves.begin(), leaves.end());
    std::sort(sorted.begin(), sorted.end(), [&](const Int3& l, const Int3& r) { return at(l) < at(r); });
    field_.leaf_index.assign(
        static_cast<std::size_t>(d[0]) * static_cast<std::size_t>(d[1]) * static_cast<std::size_t>(d[2]), -1);
    for (const Int3& l : sorted) {
      field_.leaf_index[at(l)] = static_cast<std::int32_t>(field_.leaves.size());
      field_.leaves.emplace_back(block_.corner, Int3{8 * l[0], 8 * l[1], 8 * l[2]});
    }
  }

  Int3 global(const BandLeaf& leaf, std::size_t node) const {
    return {block_.corner[0] + leaf.origin[0] + static_cast<int>(node & 7),
            block_.corner[1] + leaf.origin[1] + static_cast<int>(node >> 3 & 7),
            block_.corner[2] + leaf.origin[2] + static_cast<int>(node >> 6)};
  }

  void fill(BandLeaf& leaf) {
    const double h = block_.lattice.h;
    const Int3 at = {leaf.origin[0] >> kLeafBits, leaf.origin[1] >> kLeafBits, leaf.origin[2] >> kLeafBits};
    LeafWords valid = nodes_in_block(at, block_.cells);
    for (std::size_t i = 0; i < 512; ++i) {
      const std::uint64_t bit = std::uint64_t{1} << (i & 63);
      if (!(valid[i >> 6] & bit)) continue;
      const MergeBlend::Value v = blend_.at(block_.at(global(leaf, i)), kNearCells * h);
      if (!(v.share > 0.0) || std::fabs(v.distance) > kNearCells * h) {
        valid[i >> 6] &= ~bit;
        continue;
      }
      const auto cells = static_cast<float>(v.distance / h);
      const bool inside = v.distance < 0.0;
      leaf.value(i) = inside ? std::min(cells, -1e-6f) : cells;
      if (inside) leaf.inside[i >> 6] |= bit;
    }
    leaf.set_valid(valid);
  }

  void find_roots(std::size_t l, std::size_t axis) {
    BandLeaf& leaf = field_.leaves[l];
    const std::size_t step = axis == 0 ? 1 : axis == 1 ? 8 : 64;
    Int3 after = leaf.origin;
    after[axis] += kLeafCells;
    const BandLeaf* beyond =
        after[axis] <= field_.cells[axis] ? field_.leaf_at(after[0], after[1], after[2]) : nullptr;
    const LeafWords valid = leaf.valid();
    for (std::size_t z = 0; z < 8; ++z) {
      leaf.first_root[axis][z] = static_cast<std::uint32_t>(field_.roots.size());
      std::uint64_t crossing = 0;
      for (std::size_t b = 0; b < 64; ++b) {
        if (!(valid[z] >> b & 1)) continue;
        const std::size_t a = b + 64 * z;
        const bool last = (axis == 0 ? b & 7 : axis == 1 ? b >> 3 : z) == 7;
        if (last && !beyond) continue;
        const BandLeaf& end = last ? *beyond : leaf;
        const std::size_t e = last ? a - 7 * step : a + step;
        if (!end.is_valid(e)) continue;
        const bool from = leaf.inside[z] >> b & 1, to = end.inside[e >> 6] >> (e & 63) & 1;
        if (from == to) continue;
        crossing |= std::uint64_t{1} << b;
        field_.roots.push_back(root(global(leaf, a), axis, double{leaf.value(a)}, double{end.value(e)}));
      }
      leaf.crossing[axis][z] = crossing;
    }
  }

  /// Regula falsi that halves the value of an end which stays (the Illinois rule).
  EdgeRoot root(const Int3& node, std::size_t axis, double at_a, double at_b) const {
    const double h = block_.lattice.h;
    double a = 0.0, b = 1.0, fa = at_a, fb = at_b, t = 0.5;
    const bool starts_inside = at_a < 0.0;
    int side = 0;
    MergeBlend::Value v;
    for (int i = 0; i < kMostSteps; ++i) {
      t = fa == fb ? 0.5 * (a + b) : a + (b - a) * fa / (fa - fb);
      v = blend_.at(block_.at(node, axis, t), kNearCells * h);
      const double f = v.distance / h;
      if (!(v.share > 0.0) || std::fabs(f) < kRootError) break;
      if ((f < 0.0) == starts_inside) {
        a = t, fa = f;
        if (side == -1) fb *= 0.5;
        side = -1;
      } else {
        b = t, fb = f;
        if (side == 1) fa *= 0.5;
        side = 1;
      }
    }
    Float3 normal = narrow(v.normal);
    if (normal == Float3{0, 0, 0}) normal[axis] = 1.0f;
    if (normal[axis] * (starts_inside ? 1.0f : -1.0f) < 0.0f) normal = -normal;
    EdgeRoot made;
    made.normal = normal;
    made.t = std::clamp(static_cast<float>(t), kRootMargin, 1.0f - kRootMargin);
    made.offset = (static_cast<float>(t) - made.t) * normal[axis];
    made.slides = true;
    return made;
  }

  const BlendBlock& block_;
  const MergeBlend& blend_;
  DirectedField field_;
};

}  // namespace

Double3 BlendBlock::at(const Int3& node, std::size_t axis, double t) const {
  Double3 p;
  for (std::size_t k = 0; k < 3; ++k)
    p[k] = lattice.world(static_cast<int>(k), node[k] + (k == axis ? t : 0.0)) - origin[k];
  return p;
}

DirectedField build_blend_field(const BlendBlock& block, std::span<const Int3> leaves,
                                const MergeBlend& blend, const std::function<void()>& pause) {
  return Builder(block, blend).build(leaves, pause);
}

}  // namespace tessera
