/// \file triangle_quality.h
/// How near a mesh is to equilateral triangles of one size: sums of integers, so parts add up in any order.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// The squared cosine of the smallest angle, from 1/4 to 1; 1 where two corners lie at one place.
[[nodiscard]] inline double sharpness(const Double3& a, const Double3& b, const Double3& c) {
  const double x = squared_distance(a, b), y = squared_distance(b, c), z = squared_distance(c, a);
  const double minimum = std::min({x, y, z}), sum = x + y + z - 2.0 * minimum;
  const double product = x < y ? (x < z ? y * z : x * y) : (y < z ? z * x : x * y);
  return product > 0.0 ? sum * sum / (4.0 * product) : 1.0;
}

struct TriangleQuality {
  static constexpr std::size_t kAngleBins = 180;  ///< of one degree
  /// Of 0.02 target lengths; the last one holds all that is longer.
  static constexpr std::size_t kLengthBins = 100;
  static constexpr std::size_t kValenceBins = 16;
  /// Of 0.01 of the hexagon around a vertex of equilateral triangles; the last one holds all above.
  static constexpr std::size_t kCellBins = 200;

  std::array<std::uint64_t, kAngleBins> angles{};    ///< all three of every face
  std::array<std::uint64_t, kAngleBins> minimum{};   ///< the smallest of every face
  std::array<std::uint64_t, kLengthBins> lengths{};  ///< of the edges of every face: inner edges count twice
  std::array<std::uint64_t, kValenceBins> valences{};  ///< of vertices inside with complete stars
  /// Of the same vertices: the mixed Voronoi cell (Meyer et al. 2003) by its area, and the sum of the areas of every bin in
  /// 1e-6 of that hexagon. Where triangles are regular all are alike.
  std::array<std::uint64_t, kCellBins> cells{}, cell_sums{};
  /// Of edges between vertices with complete stars, inner ones twice: the ratio of the larger to the smaller of the mean
  /// edges of both, in steps of 0.05 from 1 on; the last one holds all above.
  static constexpr std::size_t kRatioBins = 41;
  std::array<std::uint64_t, kRatioBins> ratios{};
  std::uint64_t largest_ratio = 0;  ///< in 1e-6
  std::uint64_t faces = 0;
  std::uint64_t angle_off = 0;      ///< sum of |angle - 60|, millidegrees
  std::uint64_t length_off = 0;     ///< sum of |length - target| in 1e-6 targets
  std::uint64_t area_off = 0;       ///< sum of |area - that of the target triangle| in 1e-6 of the latter
  std::uint64_t smallest = 180000;  ///< angle, millidegrees

  /// Members by name, for records of them.
  static void fields(auto& self, auto&& field) {
    field("angles", self.angles);
    field("least", self.minimum);
    field("lengths", self.lengths);
    field("valences", self.valences);
    field("faces", self.faces);
    field("angle_off", self.angle_off);
    field("length_off", self.length_off);
    field("area_off", self.area_off);
    field("smallest", self.smallest);
    field("cells", self.cells);
    field("cell_sums", self.cell_sums);
    field("ratios", self.ratios);
    field("largest_ratio", self.largest_ratio);
  }
  /// Adds all faces of a block. \param target  length of edges, > 0
  void add(const MeshBlock& block, double target);
  void merge(const TriangleQuality& other);
  /// Mean |area - mean area| of Voronoi cells in mean areas: Botsch's thesis, fig. 3.9. 0 without vertices.
  double mean_cell_deviation() const;
};

/// Per vertex the mean length of its edges; 0 where the block has not all of them.
[[nodiscard]] std::vector<double> mean_edges(const MeshBlock& block);

/// Of two means: 1 and more, 0 where one is not known.
[[nodiscard]] inline double length_ratio(double a, double b) {
  return a > 0.0 && b > 0.0 ? std::max(a, b) / std::min(a, b) : 0.0;
}

/// Edges between vertices with complete stars.
struct UnevenEdges {
  std::uint64_t edges = 0, uneven = 0;  ///< all, and those with a larger ratio
  std::vector<std::uint8_t> at_face;    ///< per face of the block: it has such an edge
};
[[nodiscard]] UnevenEdges find_uneven(const MeshBlock& block, double max_ratio);

struct SharpFaces {
  std::uint64_t faces = 0;  ///< with an angle below
  std::uint64_t between_lines =
      0;  ///< of them: those whose smallest angle lies between two creases or borders
};

/// \pre the block bears its creases (kFaceCrease01)
[[nodiscard]] SharpFaces count_sharp(const MeshBlock& block, double min_angle_deg);

}  // namespace tessera
