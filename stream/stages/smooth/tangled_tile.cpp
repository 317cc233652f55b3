#include "stream/stages/smooth/tangled_tile.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

/// Bounds of distances are computed, not exact.
constexpr double kMoveRounding = 1.0 + 1e-9;

}  // namespace

TangledTile::TangledTile(const MeshStore& smoothed, const MeshStore& given, const SmoothTile& tile,
                         const VerticesBack& back, const ContactRegions& regions)
    : given_store_(given) {
  std::vector<MeshBlock> pieces;
  std::vector<std::uint8_t> tags;
  std::vector<std::uint32_t> patch_of_piece;
  for (const std::size_t p : smoothed.select(grown(smoothed.box_of(tile.patches), tile.margin))) {
    if (!regions.near(smoothed.patches()[p].box)) continue;
    MeshBlock piece = smoothed.load({&p, 1});
    for (const auto& [v, at] : back.apply(piece, !smoothed.info().double_positions))
      before_back_.emplace(piece.key[v], at);
    const std::vector<std::uint8_t> keep = regions.faces(piece, smoothed.patches()[p].box);
    const auto kept = static_cast<std::size_t>(std::count(keep.begin(), keep.end(), std::uint8_t{1}));
    if (kept == 0) continue;
    pieces.push_back(kept == keep.size() ? std::move(piece) : select_faces(piece, keep));
    tags.push_back(std::binary_search(tile.patches.begin(), tile.patches.end(), p) ? 1 : 0);
    patch_of_piece.push_back(static_cast<std::uint32_t>(p));
  }
  if (std::find(tags.begin(), tags.end(), std::uint8_t{1}) == tags.end()) return;
  std::vector<const MeshBlock*> pointers;
  for (const MeshBlock& piece : pieces) pointers.push_back(&piece);
  std::vector<std::uint32_t> slot;
  block_ = merge_blocks(pointers, tags, &core_, &slot);
  patch_of_.resize(block_.key.size());
  auto at = slot.begin();
  for (std::size_t k = 0; k < pieces.size(); ++k)
    for (std::size_t v = 0; v < pieces[k].key.size(); ++v) patch_of_[*at++] = patch_of_piece[k];
}

std::uint64_t TangledTile::find(bool widely, std::vector<VertexBack>& found) {
  std::vector<std::uint32_t> number;
  const std::vector<ContactFace> faces = doubtful_faces(block_, &number);
  std::uint64_t pairs = 0;
  // Around vertices of the tile's own faces all faces are there; the others are those of another tile, which sees the pair too.
  std::vector<std::uint8_t> in_pair(widely ? block_.key.size() : 0, 0);
  const auto use = [&](std::uint32_t i, std::uint32_t j, FaceContact) {
    const std::uint32_t one = number[i], other = number[j];
    if (core_[one] == 0 && core_[other] == 0) return;
    if (meet_in_copies(faces[i], faces[j]) || !(moved(one) || moved(other)) || met_before(one, other)) return;
    // Faces are in the order of their keys in every block: the first one's tile counts the pair.
    pairs += core_[std::min(one, other)];
    for (const std::uint32_t f : {one, other})
      for (const std::uint32_t v : block_.faces[f]) {
        if (moved_vertex(v)) found.push_back(back(v));
        if (widely && core_[f] != 0) in_pair[v] = 1;
      }
  };
  block_contacts(faces, kAllSpace, use, ContactOrder::kAny);
  for (std::uint32_t f = 0; widely && f < block_.faces.size(); ++f) {
    const auto& c = block_.faces[f];
    if ((in_pair[c[0]] | in_pair[c[1]] | in_pair[c[2]]) == 0) continue;
    for (const std::uint32_t v : c)
      if (moved_vertex(v)) found.push_back(back(v));
  }
  return pairs;
}

double TangledTile::reach(double move) {
  return 2.0 * move * kMoveRounding;
}

std::uint64_t TangledTile::bytes(std::uint64_t vertices, std::uint64_t faces) {
  // Both blocks, the second loaded beside the first; then faces to compare and their tree.
  return 2 * MeshStore::block_bytes(vertices, faces) + 28 * vertices + faces * (sizeof(ContactFace) + 4) +
         block_contacts_bytes(faces);
}

const Double3& TangledTile::given(std::uint32_t v) {
  const std::uint32_t patch = patch_of_[v];
  GivenPatch& in = given_[patch];
  if (in.key.empty()) {
    const std::size_t p = patch;
    MeshBlock block = given_store_.load({&p, 1});
    in = {std::move(block.key), std::move(block.position)};
  }
  const auto found = std::lower_bound(in.key.begin(), in.key.end(), block_.key[v]);
  if (found == in.key.end() || *found != block_.key[v])
    throw std::logic_error("untangle: vertex " + std::to_string(block_.key[v]) +
                           " is not in its patch as it was given");
  return in.position[static_cast<std::size_t>(found - in.key.begin())];
}

bool TangledTile::moved_vertex(std::uint32_t v) {
  return block_.position[v] != given(v);
}

bool TangledTile::moved(std::uint32_t f) {
  const auto& corners = block_.faces[f];
  return moved_vertex(corners[0]) || moved_vertex(corners[1]) || moved_vertex(corners[2]);
}

bool TangledTile::met_before(std::uint32_t one, std::uint32_t other) {
  const auto as_given = [&](std::uint32_t f) {
    ContactFace out;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = block_.faces[f][k];
      out.corner[k] = given(v), out.vertex[k] = v;
    }
    return out;
  };
  const auto has_area = [](const ContactFace& f) {
    return !collinear(f.corner[0], f.corner[1], f.corner[2]);
  };
  const ContactFace a = as_given(one), b = as_given(other);
  return has_area(a) && has_area(b) && face_contact(a, b) != FaceContact::kNone && !meet_in_copies(a, b);
}

VertexBack TangledTile::back(std::uint32_t v) {
  const auto before = before_back_.find(block_.key[v]);
  return {block_.key[v], before == before_back_.end() ? block_.position[v] : before->second, given(v)};
}

}  // namespace tessera
