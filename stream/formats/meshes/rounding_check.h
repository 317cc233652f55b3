/// \file rounding_check.h
/// Whether a mesh is still the same mesh once its positions are rounded: vertices that come to lie on each other, faces
/// that lose their area. Under a byte limit, whatever the size of the mesh.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>

#include "stream/files/external_sort.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/vertex_store.h"

namespace tessera {

class RoundingCheck {
 public:
  /// \param temp   folder for what does not fit in memory
  /// \param round  position -> the one that a reader of the file gets
  RoundingCheck(const std::filesystem::path& temp, std::function<Double3(const Double3&)> round);

  /// All vertices in order, then all faces. \pre of a face: its corners were added
  void vertices(std::span<const Double3> positions);
  void faces(std::span<const MeshFace> faces);
  /// Once, after the last face; merged and joined vertices, flattened faces.
  MeshRounding finish();

  /// What it allocates at most.
  static std::uint64_t bytes(std::uint64_t vertices);

 private:
  /// A vertex by what rounding made of it, then by what it was. Hashes of 64 bits stand for both.
  struct HashPair {
    std::uint64_t rounded = 0, exact = 0;
    auto operator<=>(const HashPair&) const = default;
  };

  const std::function<Double3(const Double3&)> round_;
  VertexStore positions_;
  ExternalSort<HashPair> hashes_;
  std::uint64_t flattened_ = 0;
};

}  // namespace tessera
