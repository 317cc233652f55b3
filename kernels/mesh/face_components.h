/// \file face_components.h
/// Connected components of faces over shared vertices.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

struct FaceComponents {
  std::vector<std::uint32_t> of_vertex;  ///< n; components are numbered by their first vertex
  std::vector<std::uint32_t> faces;      ///< per component; a vertex without faces is one of none
};

/// O(n) with path halving. \pre corners of faces below vertices
FaceComponents find_components(std::size_t vertices, std::span<const std::array<std::uint32_t, 3>> faces);

}  // namespace tessera
