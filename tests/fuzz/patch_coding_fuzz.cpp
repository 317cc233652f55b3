// Bytes of a compact patch: they decode to a patch with every corner in range, whose own bytes give it back, or not at all.
#include <cstring>

#include "stream/meshes/mesh_store.h"
#include "stream/meshes/patch_coding.h"
#include "tests/fuzz/text_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tessera;
  if (size < 4) return 0;
  MeshStoreInfo info;
  info.lattice.h = 0.25;
  info.double_positions = (data[0] & 1) != 0;
  info.colour = (data[0] & 2) != 0;
  const bool bounds = (data[0] & 4) != 0;
  const std::size_t vertices = data[1], faces = data[2];
  const std::string_view rest = fuzz::text_of(data + 4, size - 4);
  const std::size_t cut = rest.size() * data[3] / 256;
  MeshBlock block;
  if (!decode_vertices({rest.data(), cut}, vertices, info, block)) return 0;
  fuzz::require(block.key.size() == vertices && block.position.size() == vertices,
                "as many vertices as claimed");
  if (!decode_faces({rest.data() + cut, rest.size() - cut}, faces, bounds, block)) return 0;
  fuzz::require(block.faces.size() == faces, "as many faces as claimed");
  for (const auto& face : block.faces)
    for (const std::uint32_t corner : face)
      fuzz::require(corner < vertices, "corners are vertices of the patch");
  return 0;
}
