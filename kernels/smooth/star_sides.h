/// \file star_sides.h
/// The smooth sides of the surface that meet at a vertex: one on a smooth surface, two at a crease, three at a
/// corner.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

class StarSides {
 public:
  static constexpr std::size_t kMax = 3;

  /// Groups the faces of a star by their filtered normals, with the two that differ most as the first seeds, a
  /// third one that differs from both, and three rounds of assignment to the nearest mean. The same groups in
  /// every block that holds the star.
  /// \param star      corners of the vertex, ascending (FaceCorners::at())
  /// \param normals   m, filtered, unit or zero
  /// \param position  n, whose areas weigh the means
  void find(const MeshBlock& block, std::span<const std::uint32_t> star, std::span<const Float3> normals,
            std::span<const Double3> position);

  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] const Double3& normal(std::size_t side) const { return normal_[side]; }  ///< unit
  [[nodiscard]] const std::vector<std::uint32_t>& faces(std::size_t side) const { return faces_[side]; }

 private:
  std::size_t count_ = 0;
  std::array<Double3, kMax> normal_;
  std::array<std::vector<std::uint32_t>, kMax> faces_;
  std::vector<double> area_;
  std::vector<std::uint8_t> side_;
};

}  // namespace tessera
