/// \file crossing_pairs.h
/// Pairs of faces of a store that meet beyond what they share, as the search leaves them for those who mend them.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

/// A face by the keys of its corners, the smallest first, in its direction.
using FaceKeys = std::array<std::uint64_t, 3>;
FaceKeys face_keys(const MeshBlock& block, std::size_t face);

struct CrossingPair {
  std::array<FaceKeys, 2> face;                   ///< ascending
  std::array<std::array<Double3, 3>, 2> corners;  ///< theirs
  std::uint64_t contact = 0;                      ///< FaceContact
  MeshBox box() const;                            ///< around both
  MeshBox shared_box() const;                     ///< what the boxes of both have in common
};

/// More are left as they are: what crosses so often is no surface with a few bad places.
inline constexpr std::uint64_t kMaxCrossingPairs = 200'000;

/// The pairs of these files, ascending by faces. \throws InputError when one cannot be read
std::vector<CrossingPair> load_crossing_pairs(const std::vector<std::filesystem::path>& files);

}  // namespace tessera
