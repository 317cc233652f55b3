#include "kernels/mesh/patch_mesh.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/morton.h"

namespace tessera {
namespace {

constexpr int kSlotBits = 22;  ///< of a vertex in its brick; bricks take 3 * 14
static_assert(3 * (kMaxCellBits - kBrickBits) + kSlotBits == 64);

constexpr std::uint64_t kLocal = kLeafCells - 1;

/// Of the leaves of a brick by their Morton codes: the min corner, cells.
using LeafCorner = std::array<std::uint8_t, 3>;
constexpr std::array<LeafCorner, 512> kLeafCorners = [] {
  std::array<LeafCorner, 512> corners{};
  for (std::uint64_t code = 0; code < corners.size(); ++code) {
    const std::array<std::uint32_t, 3> leaf = morton_decode(code);
    for (std::size_t a = 0; a < 3; ++a) corners[code][a] = static_cast<std::uint8_t>(leaf[a] << kLeafBits);
  }
  return corners;
}();
static_assert(kBrickBits - kLeafBits == 3);

/// \param local  cells of so many finest ones, from the min corner of the brick
Double3 in_frame(const MeshFrame& frame, const Int3& brick, const Float3& local, double cell) {
  Double3 at;
  for (std::size_t a = 0; a < 3; ++a) {
    const double cells = (brick[a] * double{kBrickCells} + double{local[a]}) * cell;
    const double world = frame.lattice.world(static_cast<int>(a), cells) - frame.shift[a];
    at[a] = frame.double_positions ? world : double{static_cast<float>(world)};
  }
  return at;
}

}  // namespace

std::uint64_t mesh_key(VertexKey name) {
  const VertexName v = vertex_name(name);
  std::array<std::uint32_t, 3> leaf;
  std::array<std::uint64_t, 3> local;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto in_brick = static_cast<std::uint32_t>(v.at[a]) & (kBrickCells - 1);
    leaf[a] = in_brick >> kLeafBits;
    local[a] = in_brick & kLocal;
  }
  const std::uint64_t in_leaf = local[2] << 6 | local[1] << 3 | local[0];
  // Points on edges come leaf by leaf: axis by axis, then the second ones; after them centres, leaf by leaf.
  const std::uint64_t where = morton_encode(leaf[0], leaf[1], leaf[2]);
  const auto type = static_cast<std::uint64_t>(v.type);
  const std::uint64_t slot =
      v.type < 6 ? (where << 3 | type) << 9 | in_leaf
                 : std::uint64_t{1} << (kSlotBits - 1) | where << 11 | in_leaf << 2 | (type - 6);
  return brick_key(vertex_brick(name)) << kSlotBits | slot;
}

MeshName mesh_name(std::uint64_t key) {
  MeshNames names;
  return names(key);
}

MeshName MeshNames::operator()(std::uint64_t key) {
  if (key >> kSlotBits != code_) {
    code_ = key >> kSlotBits;
    brick_ = brick_of_key(code_);
  }
  const bool centre = (key >> (kSlotBits - 1) & 1) != 0;
  const LeafCorner& where = kLeafCorners[key >> (centre ? 11 : 12) & 0x1ff];
  const std::uint64_t in_leaf = key >> (centre ? 2 : 0) & 0x1ff;
  MeshName name;
  name.brick = brick_;
  for (std::size_t a = 0; a < 3; ++a)
    name.in_brick[a] = static_cast<std::int32_t>(where[a] | (in_leaf >> 3 * a & kLocal));
  name.axis = centre ? MeshName::kCentre : static_cast<int>(key >> 9 & 7) % 3;
  return name;
}

MeshBlock make_mesh_block(const Patch& patch, const MeshFrame& frame) {
  const std::size_t own = patch.position.size();
  const std::size_t all = own + patch.foreign.size();
  assert(patch.name.size() == own && patch.foreign_position.size() == patch.foreign.size());
  MeshBlock block;
  block.key.resize(all);
  block.position.resize(all);
  block.vertex_class.resize(all);
  if (frame.colour) block.rgba.assign(all, 0);
  for (std::size_t v = 0; v < all; ++v) {
    const bool is_own = v < own;
    const std::size_t f = v - own;
    const VertexKey name = is_own ? patch.name[v] : patch.foreign[f];
    const Float3& local = is_own ? patch.position[v] : patch.foreign_position[f];
    const bool finer = !is_own && !patch.foreign_finer.empty() && patch.foreign_finer[f] != 0;
    const int level = patch.level - (finer ? 1 : 0);
    Int3 brick = is_own ? patch.brick : vertex_brick(name);
    for (std::size_t a = 0; !is_own && a < 3; ++a) brick[a] >>= level;
    block.key[v] = mesh_key(name);
    block.vertex_class[v] = is_own ? patch.vertex_class[v] : patch.foreign_class[f];
    if (frame.colour) {
      if (is_own && !patch.rgba.empty()) block.rgba[v] = patch.rgba[v];
      if (!is_own) block.rgba[v] = patch.foreign_rgba[f];
    }
    block.position[v] = in_frame(frame, brick, local, static_cast<double>(1 << level));
  }
  block.faces = patch.faces;
  block.face_flags.assign(patch.faces.size(), 0);
  for (std::size_t f = 0; f < patch.border.size(); ++f) block.face_flags[f] = patch.border[f];
  for (std::size_t f = 0; f < patch.synthetic.size(); ++f)
    if (patch.synthetic[f])
      block.face_flags[f] = static_cast<std::uint8_t>(block.face_flags[f] | kFaceSynthetic);
  canonicalise(block);
  return block;
}

std::vector<SafePlace> safe_places(const Patch& patch, const MeshFrame& frame) {
  std::vector<SafePlace> places;
  places.reserve(patch.safe.size());
  for (const SafeVertex& v : patch.safe)
    places.push_back({mesh_key(patch.name[v.vertex]),
                      in_frame(frame, patch.brick, v.at, static_cast<double>(1 << patch.level))});
  std::sort(places.begin(), places.end(),
            [](const SafePlace& a, const SafePlace& b) { return a.key < b.key; });
  return places;
}

}  // namespace tessera
