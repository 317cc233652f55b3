#include "kernels/solid/mesh_solid.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "kernels/solid/border_leaf.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

/// What clusters of edges leave out of a winding number at most, several times over.
constexpr double kClusterError = 0.02;
constexpr int kHalf = kLeafCells / 2;

/// Winding numbers of a leaf, cube by cube: where the border cannot bring any node of a cube to 1/2, whole turns from its
/// corner decide.
struct LeafFill {
  const BorderWinding& border;
  const BorderRegion& region;
  Int3 corner;
  const std::array<std::int32_t, 512>& n;                       ///< integer parts
  const std::array<std::array<std::int16_t, 512>, 3>& winding;  ///< on the edges from every node
  std::span<float> out;

  Int3 node(std::size_t i) const {
    return {corner[0] + static_cast<int>(i & 7), corner[1] + static_cast<int>(i >> 3 & 7),
            corner[2] + static_cast<int>(i >> 6)};
  }

  void fill() {
    const auto at_corner = [&] {
      return region.near().empty() ? region.far().at(corner) / (4.0 * kPi) : border.at(corner);
    };
    if (decide(0, kLeafCells, at_corner)) return;
    BorderLeaf leaf(border, region, corner);
    for (std::size_t child = 0; child < 8; ++child) {
      const std::size_t first = kHalf * ((child & 1) + 8 * (child >> 1 & 1) + 64 * (child >> 2));
      if (decide(first, kHalf, [&] { return leaf.at(first); })) continue;
      for (std::size_t z = 0; z < kHalf; ++z)
        for (std::size_t y = 0; y < kHalf; ++y)
          for (std::size_t x = 0; x < kHalf; ++x) {
            const std::size_t i = first + x + 8 * y + 64 * z;
            out[i] = static_cast<float>(n[i] + leaf.at(i));
          }
    }
  }

  /// Counts turns if no node of a cube can be brought to 1/2. \param first  node of its corner  \param edge  nodes
  template <class Share>
  bool decide(std::size_t first, int edge, const Share& share) {
    const Int3 at = node(first);
    const double half = 0.5 * (edge - 1), radius = 1.7321 * half;
    std::optional<double> here;
    const auto is_decided = [&](double change) {
      if (change >= 0.5 - kClusterError) return false;
      if (!here) here = n[first] + share();
      return change < std::fabs(*here - (std::floor(*here) + 0.5)) - kClusterError;
    };
    // What is known of the whole region costs nothing.
    if (!is_decided(region.change()) &&
        !is_decided(border.change({at[0] + half, at[1] + half, at[2] + half}, radius)))
      return false;
    count_windings(first, edge, *here);
    return true;
  }

  void count_windings(std::size_t first, int edge, double here) {
    const auto size = static_cast<std::size_t>(edge);
    std::array<std::int32_t, 512> from;
    from[first] = 0;
    for (std::size_t z = 0; z < size; ++z)
      for (std::size_t y = 0; y < size; ++y)
        for (std::size_t x = 0; x < size; ++x) {
          const std::size_t i = first + x + 8 * y + 64 * z;
          if (x > 0) {
            from[i] = from[i - 1] + winding[0][i - 1];
          } else if (y > 0) {
            from[i] = from[i - 8] + winding[1][i - 8];
          } else if (z > 0) {
            from[i] = from[i - 64] + winding[2][i - 64];
          }
          out[i] = static_cast<float>(here + from[i]);
        }
  }
};

}  // namespace

void MeshSolid::windings(const Int3& leaf, std::span<const SolidCrossing> crossings, std::span<float> out,
                         BorderRegions& regions) const {
  // Turns on the edges from every node, per axis.
  std::array<std::array<std::int16_t, 512>, 3> winding{};
  for (const SolidCrossing& c : crossings) {
    std::int16_t& t = winding[c.edge / 512 % 3][c.edge % 512];
    t = static_cast<std::int16_t>(t + c.winding);
  }
  const std::array<std::int16_t, 64> before = lines_.before(leaf);
  std::array<std::int32_t, 512> n;
  for (std::size_t row = 0; row < 64; ++row) {
    n[8 * row] = before[row];
    for (std::size_t x = 0; x < 7; ++x) n[8 * row + x + 1] = n[8 * row + x] + winding[0][8 * row + x];
  }
  if (border_.empty()) {
    for (std::size_t i = 0; i < 512; ++i) out[i] = static_cast<float>(n[i]);
    return;
  }
  const Int3 corner = {leaf[0] * kLeafCells, leaf[1] * kLeafCells, leaf[2] * kLeafCells};
  LeafFill fill{border_, regions.of(border_, leaf), corner, n, winding, out};
  fill.fill();
}

bool MeshSolid::may_pass(const Int3& leaf, int edge) const {
  const double half = 0.5 * (kLeafCells * edge + 1), radius = 1.7321 * half;
  const Int3 corner = {leaf[0] * kLeafCells, leaf[1] * kLeafCells, leaf[2] * kLeafCells};
  const double at = lines_.before(leaf)[0] + border_.at(corner);
  const double free = std::fabs(at - 0.5) - kClusterError;
  if (free <= 0.0) return true;
  const Double3 middle = {corner[0] - 1 + half, corner[1] - 1 + half, corner[2] - 1 + half};
  return border_.change(middle, radius) >= free;
}

void MeshSolid::search(const SolidBlock& block, std::span<const std::uint8_t> occupied, const Int3& cube,
                       int edge, std::vector<Int3>& out) const {
  const Int3 last = {block.cells[0] / kLeafCells, block.cells[1] / kLeafCells, block.cells[2] / kLeafCells};
  // What the faces do is known within the block alone.
  bool any = true, whole = true, faces = false;
  for (std::size_t k = 0; k < 3; ++k) {
    any = any && cube[k] + edge > -1 && cube[k] <= last[k];
    whole = whole && cube[k] >= -1 && cube[k] + edge - 1 <= last[k];
  }
  if (!any) return;
  if (whole)
    for (int z = cube[2]; z < cube[2] + edge; ++z)
      for (int y = cube[1]; y < cube[1] + edge; ++y)
        for (int x = cube[0]; x < cube[0] + edge; ++x) faces = faces || occupied[block.slot({x, y, z})] != 0;
  if (faces && edge == 1) return;
  const Int3 global = {cube[0] + (block.origin[0] >> kLeafBits), cube[1] + (block.origin[1] >> kLeafBits),
                       cube[2] + (block.origin[2] >> kLeafBits)};
  if (whole && !faces && !may_pass(global, edge)) return;
  if (edge == 1) {
    out.push_back(cube);
    return;
  }
  const int half = edge / 2;
  for (int child = 0; child < 8; ++child)
    search(
        block, occupied,
        {cube[0] + (child & 1) * half, cube[1] + (child >> 1 & 1) * half, cube[2] + (child >> 2 & 1) * half},
        half, out);
}

void MeshSolid::membrane_leaves(const SolidBlock& block, std::span<const std::uint8_t> occupied,
                                std::vector<Int3>& out) const {
  if (border_.empty()) return;
  constexpr int kCube = kBrickCells / kLeafCells;
  for (int z = -kCube; z <= block.cells[2] / kLeafCells; z += kCube)
    for (int y = -kCube; y <= block.cells[1] / kLeafCells; y += kCube)
      for (int x = -kCube; x <= block.cells[0] / kLeafCells; x += kCube)
        search(block, occupied, {x, y, z}, kCube, out);
}

MeshSolid::Shares MeshSolid::shares(std::size_t maximum) const {
  const std::vector<LeafWindings>& leaves = lines_.leaves();
  const std::size_t count = std::min(maximum, leaves.size());
  std::size_t half = 0, inside = 0, turned = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Int3 leaf = leaf_of_row_key(leaves[i * leaves.size() / count].key);
    const double winding = lines_.before(leaf)[0] +
                           border_.at({leaf[0] * kLeafCells, leaf[1] * kLeafCells, leaf[2] * kLeafCells});
    half += std::fabs(winding - std::round(winding)) > 0.25;
    inside += winding > 0.5;
    turned += winding < -0.5;
  }
  const auto share = [&](std::size_t n) {
    return count > 0 ? static_cast<double>(n) / static_cast<double>(count) : 0.0;
  };
  return {share(half), share(inside), share(turned)};
}

Double3 MeshSolid::membrane_normal(const Double3& cells) const {
  return -border_.gradient(cells);  // outward: where the winding number falls
}

}  // namespace tessera
