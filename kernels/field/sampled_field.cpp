#include "kernels/field/sampled_field.h"

#include <algorithm>
#include <cmath>

#include "kernels/field/band.h"
#include "kernels/field/edge_roots.h"

namespace tessera {
namespace {

constexpr int kMaxSteps = 12;        ///< of the root finder; a plane takes one
constexpr double kRootError = 1e-5;  ///< cells
/// Roots are multiples of it: points are then exact, wherever the block is.
constexpr double kStep = 0x1p-24;

class Builder {
 public:
  Builder(const Int3& corner, const Int3& cells, const FieldSampler& sampler, double near)
      : corner_(corner), sampler_(sampler), near_(near) {
    field_.origin = corner;
    field_.cells = cells;
  }

  DirectedField build(std::span<const Int3> leaves, const std::function<void()>& pause) {
    add_leaves(leaves);
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
  void add_leaves(std::span<const Int3> leaves) {
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
      field_.leaves.emplace_back(corner_, Int3{8 * l[0], 8 * l[1], 8 * l[2]});
    }
  }

  Int3 global(const BandLeaf& leaf, std::size_t node) const {
    return {corner_[0] + leaf.origin[0] + static_cast<int>(node & 7),
            corner_[1] + leaf.origin[1] + static_cast<int>(node >> 3 & 7),
            corner_[2] + leaf.origin[2] + static_cast<int>(node >> 6)};
  }

  void fill(BandLeaf& leaf) {
    const Int3 at = {leaf.origin[0] >> kLeafBits, leaf.origin[1] >> kLeafBits, leaf.origin[2] >> kLeafBits};
    LeafWords valid = nodes_in_block(at, field_.cells);
    for (std::size_t i = 0; i < 512; ++i) {
      const std::uint64_t bit = std::uint64_t{1} << (i & 63);
      if (!(valid[i >> 6] & bit)) continue;
      const FieldSampler::Sample s = sampler_.at(global(leaf, i), 0, 0.0);
      if (!s.there || std::fabs(s.value) > near_) {
        valid[i >> 6] &= ~bit;
        continue;
      }
      const auto cells = static_cast<float>(s.value);
      const bool inside = s.value < 0.0;
      leaf.value(i) = inside ? std::min(cells, -1e-6f) : cells;
      if (inside) leaf.inside[i >> 6] |= bit;
    }
    leaf.set_valid(valid);
  }

  void find_roots(std::size_t l, std::size_t axis) {
    BandLeaf& leaf = field_.leaves[l];
    const std::size_t step = axis == 0 ? 1 : axis == 1 ? 8 : 64;
    const BandLeaf* beyond = field_.leaf_after(leaf, axis);
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
    double a = 0.0, b = 1.0, fa = at_a, fb = at_b, t = 0.5;
    const bool starts_inside = at_a < 0.0;
    int side = 0;
    FieldSampler::Sample s;
    for (int i = 0; i < kMaxSteps; ++i) {
      t = fa == fb ? 0.5 * (a + b) : a + (b - a) * fa / (fa - fb);
      t = std::floor(t / kStep + 0.5) * kStep;
      s = sampler_.at(node, axis, t);
      if (!s.there || std::fabs(s.value) < kRootError) break;
      if ((s.value < 0.0) == starts_inside) {
        a = t, fa = s.value;
        if (side == -1) fb *= 0.5;
        side = -1;
      } else {
        b = t, fb = s.value;
        if (side == 1) fa *= 0.5;
        side = 1;
      }
    }
    Float3 normal = narrow(unit_or_zero(s.normal));
    if (normal == Float3{0, 0, 0}) normal[axis] = 1.0f;
    if (normal[axis] * (starts_inside ? 1.0f : -1.0f) < 0.0f) normal = -normal;
    EdgeRoot made;
    made.normal = normal;
    made.t = std::clamp(static_cast<float>(t), kRootMargin, 1.0f - kRootMargin);
    made.offset = (static_cast<float>(t) - made.t) * normal[axis];
    made.slides = true;
    return made;
  }

  Int3 corner_;
  const FieldSampler& sampler_;
  double near_;
  DirectedField field_;
};

}  // namespace

DirectedField build_sampled_field(const Int3& corner, const Int3& cells, std::span<const Int3> leaves,
                                  const FieldSampler& sampler, double near,
                                  const std::function<void()>& pause) {
  return Builder(corner, cells, sampler, near).build(leaves, pause);
}

}  // namespace tessera
