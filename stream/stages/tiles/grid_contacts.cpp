#include "stream/stages/tiles/grid_contacts.h"

#include <vector>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/orientation_sign.h"

namespace tessera {

std::uint64_t pairs_met_by_grid(const MeshBlock& block, const TileMesh& tile) {
  MeshBlock on_grid;
  on_grid.faces = block.faces;
  for (std::size_t v = 0; v < block.position.size(); ++v) {
    const auto& p = tile.position[v];
    on_grid.position.push_back({double(p[0]), double(p[1]), double(p[2])});
  }
  const auto given = [&](ContactFace f) {
    for (std::size_t k = 0; k < 3; ++k) f.corner[k] = block.position[f.vertex[k]];
    return f;
  };
  const auto has_area = [](const ContactFace& f) {
    return !collinear(f.corner[0], f.corner[1], f.corner[2]);
  };
  const std::vector<ContactFace> faces = contact_faces(on_grid);
  std::uint64_t pairs = 0;
  block_contacts(faces, kAllSpace, [&](std::uint32_t i, std::uint32_t j, FaceContact) {
    const ContactFace a = given(faces[i]), b = given(faces[j]);
    pairs += !has_area(a) || !has_area(b) || face_contact(a, b) == FaceContact::kNone;
  });
  return pairs;
}

}  // namespace tessera
