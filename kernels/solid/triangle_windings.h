/// \file triangle_windings.h
/// Generalized winding numbers of a mesh in memory: 1 inside of a closed mesh, 0 outside, a part where it has holes; any soup of
/// triangles will do.
/// Sources: Jacobson, Kavan, Sorkine-Hornung, "Robust Inside-Outside Segmentation using Generalized Winding Numbers", 2013; Barill,
/// Dickson, Schmidt, Levin, Jacobson, "Fast Winding Numbers for Soups and Clouds", 2018: far triangles as one dipole with its first
/// moment, near ones by their solid angles.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

class TriangleWindings {
 public:
  /// \param position  n, scan units \param faces  m, counter-clockwise from outside, indices below n
  TriangleWindings(std::span<const Double3> position, std::span<const std::array<std::uint32_t, 3>> faces);

  /// Winding number at `p`, off by less than 0.005; a point on a face is half inside.
  /// \cost logarithmic in the faces
  [[nodiscard]] double at(const Double3& p) const;

 private:
  struct Node {
    Double3 centre{};  ///< of area
    double radius = 0.0;
    Double3 dipole{};                  ///< sum of area times normal
    std::array<double, 9> moment{};    ///< sum of area times normal x (centroid - centre), row by row
    std::uint32_t first = 0, end = 0;  ///< triangles
    std::uint32_t right = 0;           ///< its second child; the first one is the next node; 0: a leaf
  };
  struct Triangle {
    Double3 a, b, c;
  };
  std::uint32_t build(std::uint32_t first, std::uint32_t end);
  double sum(std::uint32_t node, const Double3& p) const;

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

}  // namespace tessera
