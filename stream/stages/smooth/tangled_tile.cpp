#include "stream/stages/smooth/tangled_tile.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

/// Bounds of distances are computed, not exact.
constexpr double kMoveRounding = 1.0 + 1e-9;
constexpr std::uint32_t kNotThere = ~std::uint32_t{0};

}  // namespace

TangledTile::TangledTile(const MeshStore& smoothed, const MeshStore& given, const SmoothTile& tile,
                         double move, const VerticesBack& back)
    : near_(smoothed.load_near(tile.patches, tile.margin)),
      given_(given.load_near(tile.patches, tile.margin + reach(move)).block) {
  std::vector<std::uint32_t> overlaid;
  std::vector<Double3> as_smoothed;
  if (!back.empty()) as_smoothed = near_.block.position;
  back.apply(near_.block, given_, !smoothed.info().double_positions, &overlaid);
  for (const std::uint32_t v : overlaid) before_back_.emplace_back(v, as_smoothed[v]);
  in_given_.assign(near_.block.key.size(), kNotThere);
  for (std::size_t v = 0, g = 0; v < in_given_.size(); ++v) {
    while (g < given_.key.size() && given_.key[g] < near_.block.key[v]) ++g;
    if (g < given_.key.size() && given_.key[g] == near_.block.key[v])
      in_given_[v] = static_cast<std::uint32_t>(g);
  }
}

std::uint64_t TangledTile::find(bool widely, std::vector<VertexBack>& found) const {
  const MeshBlock& block = near_.block;
  std::vector<std::uint32_t> number;
  const std::vector<ContactFace> faces = doubtful_faces(block, &number);
  std::uint64_t pairs = 0;
  // Around vertices of the tile's own faces all faces are there; the others are those of another tile, which sees the pair too.
  std::vector<std::uint8_t> in_pair(widely ? block.key.size() : 0, 0);
  const auto use = [&](std::uint32_t i, std::uint32_t j, FaceContact) {
    const std::uint32_t one = number[i], other = number[j];
    if (near_.core[one] == 0 && near_.core[other] == 0) return;
    if (!(moved(one) || moved(other)) || meet_in_copies(faces[i], faces[j]) || met_before(one, other)) return;
    // Faces are in the order of their keys in every block: the first one's tile counts the pair.
    pairs += near_.core[std::min(one, other)];
    for (const std::uint32_t f : {one, other})
      for (const std::uint32_t v : block.faces[f]) {
        if (moved_vertex(v)) found.push_back({block.key[v], smoothed(v)});
        if (widely && near_.core[f] != 0) in_pair[v] = 1;
      }
  };
  block_contacts(faces, kAllSpace, use, ContactOrder::kAny);
  for (std::uint32_t f = 0; widely && f < block.faces.size(); ++f) {
    const auto& c = block.faces[f];
    if ((in_pair[c[0]] | in_pair[c[1]] | in_pair[c[2]]) == 0) continue;
    for (const std::uint32_t v : c)
      if (moved_vertex(v)) found.push_back({block.key[v], smoothed(v)});
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

std::uint32_t TangledTile::given(std::uint32_t v) const {
  if (in_given_[v] == kNotThere)
    throw std::logic_error("untangle: vertex " + std::to_string(near_.block.key[v]) +
                           " is not near where it was given");
  return in_given_[v];
}

bool TangledTile::moved_vertex(std::uint32_t v) const {
  return near_.block.position[v] != given_.position[given(v)];
}

bool TangledTile::moved(std::uint32_t f) const {
  const auto& corners = near_.block.faces[f];
  return moved_vertex(corners[0]) || moved_vertex(corners[1]) || moved_vertex(corners[2]);
}

bool TangledTile::met_before(std::uint32_t one, std::uint32_t other) const {
  const auto as_given = [&](std::uint32_t f) {
    ContactFace out;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = near_.block.faces[f][k];
      out.corner[k] = given_.position[given(v)], out.vertex[k] = v;
    }
    return out;
  };
  const auto has_area = [](const ContactFace& f) {
    return !collinear(f.corner[0], f.corner[1], f.corner[2]);
  };
  const ContactFace a = as_given(one), b = as_given(other);
  return has_area(a) && has_area(b) && face_contact(a, b) != FaceContact::kNone && !meet_in_copies(a, b);
}

const Double3& TangledTile::smoothed(std::uint32_t v) const {
  const auto found = std::lower_bound(before_back_.begin(), before_back_.end(), v,
                                      [](const auto& entry, std::uint32_t w) { return entry.first < w; });
  return found != before_back_.end() && found->first == v ? found->second : near_.block.position[v];
}

}  // namespace tessera
