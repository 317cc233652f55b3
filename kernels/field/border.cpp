#include "kernels/field/border.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "octree/lattice.h"

namespace tessera {
namespace {

/// Vertices less deep than this lie on the border: cells that hold only such ones would be slivers.
constexpr float kSnap = 0.3f;
/// The longest way onto the contour, cells.
constexpr float kLongestMove = 1.5f;

BoundaryNode boundary_at(const LeafFit& fit, const std::vector<BoundaryNode>& boundaries, std::size_t node) {
  const std::size_t z = node >> 6;
  const std::uint64_t bit = std::uint64_t{1} << (node & 63);
  if (!(fit.at_boundary[z] & bit)) return {.depth = kBoundaryDepth};
  return boundaries[fit.first_boundary[z] +
                    static_cast<std::uint32_t>(std::popcount(fit.at_boundary[z] & (bit - 1)))];
}

bool has_boundaries(const LeafFit& fit) {
  std::uint64_t any = 0;
  for (const std::uint64_t word : fit.at_boundary) any |= word;
  return any != 0;
}

/// Way from a root onto the border along its tangent plane.
Float3 border_shift(const EdgeRoot& root, float depth, const Float3& inward) {
  Float3 d;
  const float along = dot(inward, root.normal);
  for (std::size_t c = 0; c < 3; ++c) d[c] = inward[c] - along * root.normal[c];
  const float length = norm(d);
  const float step = std::min(-depth, kLongestMove);
  for (float& c : d) c = length > 1e-3f ? c * (step / length) : 0.0f;
  return d;
}

/// Whether a root lies between two surfaces, not on one: both ends' fits fall where the values rise.
bool is_false(float slope_a, float slope_b, bool rises) {
  return rises ? slope_a <= 0.0f && slope_b <= 0.0f : slope_a >= 0.0f && slope_b >= 0.0f;
}

/// Marks the roots of a leaf that move, and their ways. \return whether there are any
bool mark_moves(const std::vector<LeafFit>& fits, const std::vector<BoundaryNode>& boundaries, std::size_t l,
                DirectedField& field) {
  BandLeaf& leaf = field.leaves[l];
  bool any = false;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const BandLeaf* other = field.leaf_after(leaf, axis);
    const LeafFit* fit_after = other ? &fits[static_cast<std::size_t>(other - field.leaves.data())] : nullptr;
    const std::size_t step = axis == 0 ? 1 : axis == 1 ? 8 : 64;
    if (!has_boundaries(fits[l]) && !(fit_after && has_boundaries(*fit_after))) continue;
    for (std::size_t z = 0; z < 8; ++z) {
      const std::uint64_t crossing = leaf.crossing[axis][z];
      for (std::uint64_t left = crossing; left; left &= left - 1) {
        const std::uint64_t mine = left & (~left + 1);
        const auto bit = static_cast<std::size_t>(std::countr_zero(left));
        const std::size_t coordinate = axis == 0 ? bit & 7 : axis == 1 ? bit >> 3 : z;
        const bool crosses = coordinate == 7;
        const LeafFit& fit_b = crosses ? *fit_after : fits[l];
        const std::size_t a = bit + 64 * z, b = crosses ? a - 7 * step : a + step;
        const BoundaryNode from = boundary_at(fits[l], boundaries, a), to = boundary_at(fit_b, boundaries, b);
        if (from.depth >= kBoundaryDepth && to.depth >= kBoundaryDepth) continue;
        const std::uint32_t index =
            leaf.first_root[axis][z] + static_cast<std::uint32_t>(std::popcount(crossing & (mine - 1)));
        const EdgeRoot& root = field.roots[index];
        const float depth = (1.0f - root.t) * from.depth + root.t * to.depth - kBorderDepth;
        const bool between =
            is_false(fits[l].gradient[axis][a], fit_b.gradient[axis][b], leaf.inside[z] & mine);
        if (!between && depth >= kSnap) continue;
        any = true;
        leaf.moving[axis][z] |= mine;
        if (between) continue;
        Float3 inward;
        for (std::size_t c = 0; c < 3; ++c)
          inward[c] = (1.0f - root.t) * from.inward[c] + root.t * to.inward[c];
        field.moves.push_back({index, border_shift(root, depth, inward)});
      }
    }
  }
  return any;
}

/// Words of a leaf and of those after it, as a cell's corners see them.
struct Around {
  std::array<const BandLeaf*, 8> leaf{};  ///< by dx + 2 dy + 4 dz

  /// Edges along `axis` from node (x + du, y + dv) that hold the surface inside the border: bits by cell.
  std::uint64_t deep(std::size_t axis, const Int3& offset, std::size_t z) const {
    const std::size_t at_z = z + static_cast<std::size_t>(offset[2]);
    const std::size_t up = at_z >> 3;
    const auto word = [&](std::size_t xy) {
      const BandLeaf* l = leaf[xy + 4 * up];
      return l ? l->crossing[axis][at_z & 7] & ~l->moving[axis][at_z & 7] : std::uint64_t{0};
    };
    const auto along_x = [&](std::size_t y) {
      return offset[0] == 0 ? word(2 * y)
                            : (word(2 * y) >> 1 & ~0x8080808080808080ULL) |
                                  (word(1 + 2 * y) & 0x0101010101010101ULL) << 7;
    };
    if (offset[1] == 0) return along_x(0);
    return along_x(0) >> 8 | along_x(1) << 56;
  }
};

void mark_ended(const Around& around, BandLeaf& leaf) {
  for (std::size_t z = 0; z < 8; ++z) {
    std::uint64_t deep = 0;
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 4; ++side) {
        Int3 offset = {0, 0, 0};
        offset[(axis + 1) % 3] = side & 1;
        offset[(axis + 2) % 3] = side >> 1;
        deep |= around.deep(axis, offset, z);
      }
    leaf.ended[z] = ~deep;
  }
}

}  // namespace

void find_border(const std::vector<LeafFit>& fits, const std::vector<BoundaryNode>& boundaries,
                 DirectedField& field) {
  if (boundaries.empty()) return;
  for (std::size_t l = 0; l < field.leaves.size(); ++l)
    field.leaves[l].any_moving = mark_moves(fits, boundaries, l, field);
  for (BandLeaf& leaf : field.leaves) {
    Around around;
    bool any = false;
    for (int d = 0; d < 8; ++d) {
      const Int3 at = {leaf.origin[0] + kLeafCells * (d & 1), leaf.origin[1] + kLeafCells * (d >> 1 & 1),
                       leaf.origin[2] + kLeafCells * (d >> 2)};
      if (at[0] > field.cells[0] || at[1] > field.cells[1] || at[2] > field.cells[2]) continue;
      const BandLeaf* l = around.leaf[static_cast<std::size_t>(d)] = field.leaf_at(at[0], at[1], at[2]);
      any = any || (l && l->any_moving);
    }
    if (any) mark_ended(around, leaf);
  }
}

}  // namespace tessera
