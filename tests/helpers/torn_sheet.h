/// \file torn_sheet.h
/// A sheet that lost faces here and there, so that ways over it bend, and its store, for tests of what walks over meshes.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include "kernels/mesh/mesh_block_ops.h"
#include "stream/meshes/mesh_store.h"
#include "tests/helpers/random.h"

namespace tessera::test {

/// side^2 squares of edge 10, one in `lost` of them missing, its borders marked; bumpy, with some long edges.
inline MeshBlock torn_sheet(int side, std::uint64_t lost, std::uint64_t seed) {
  Random random(seed);
  MeshBlock block;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) {
      block.key.push_back(static_cast<std::uint64_t>((j * (side + 1) + i) * 97 % 100003));
      const double stretch = i % 11 == 5 ? 4.0 : 0.0;
      block.position.push_back({10.0 * i + stretch, 10.0 * j, 80.0 + static_cast<double>(random.below(5))});
      block.vertex_class.push_back(VertexClass::kSmooth);
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (side + 1) + i); };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      if (random.below(lost) == 0) continue;
      block.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      block.faces.push_back({at(i + 1, j + 1), at(i, j + 1), at(i, j)});
    }
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> count;
  for (const auto& f : block.faces)
    for (std::size_t k = 0; k < 3; ++k) ++count[std::minmax(f[k], f[(k + 1) % 3])];
  for (const auto& f : block.faces) {
    unsigned flags = 0;
    for (std::size_t k = 0; k < 3; ++k)
      if (count.at(std::minmax(f[k], f[(k + 1) % 3])) == 1) flags |= 1U << k;
    block.face_flags.push_back(static_cast<std::uint8_t>(flags));
  }
  canonicalise(block);
  return block;
}

/// Patches by bricks of 64.
inline MeshStore store_of(const MeshBlock& block, const std::filesystem::path& file) {
  MeshStoreInfo info;
  info.lattice.h = 1.0;
  std::vector<std::uint64_t> bricks;
  for (const auto& f : block.faces)
    bricks.push_back(
        brick_of_face(info.lattice, block.position[f[0]], block.position[f[1]], block.position[f[2]]));
  MeshFileWriter writer(file, info);
  split_faces(block, bricks, [&](std::uint64_t brick, MeshBlock&& patch) { writer.add(brick, patch); });
  writer.finish();
  return MeshStore({file});
}

}  // namespace tessera::test
