/// \file charts.h
/// A mesh cut into charts, each with its place in a plane: no face flipped, none over another.
///
/// Charts grow from the largest face that has none over edges, while normals stay within a cone around their axis (mean
/// normal of a first growth), as the charts of Levy, Petitjean, Ray, Maillot 2002 and of Sander et al. 2001 do by other
/// costs; within the cone a projection along the axis flips nothing and its stretch is bounded by 1 / cos(cone). What is
/// wider, and a disk, is mapped by least squares conformal maps (parameterize.h) where these stay within the stretch that
/// is allowed; else it is cut into charts of the cone. Faces that overlap others of their chart leave it.
///
/// Stretch (L2) is that of Sander et al. 2001: root of the mean over the surface of the mean square of the singular values
/// of the map from the plane to the surface, with the plane scaled to the area of the surface; 1 is an isometry.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "octree/vector.h"
#include "solvers/laplacian.h"

namespace tessera {

struct ChartOptions {
  double cone_deg = 50.0;        ///< of charts that are projected, below 90
  double loose_cone_deg = 70.0;  ///< faces of charts of few faces join a neighbour whose axis is so near
  double unfold_cone_deg =
      80.0;                   ///< of charts that are unfolded by least squares; not above cone_deg: none are
  double max_stretch = 1.12;  ///< (L2) of charts that are unfolded
  std::size_t few_faces = 12;
  std::size_t max_unfolded_faces = 20000;  ///< larger charts are projected
  /// Units of the mesh; charts of several faces grow no wider or higher, which they may be by half once they are turned or
  /// unfolded; 0 = any.
  double max_extent = 0.0;
};

struct MeshChart {
  std::vector<std::uint32_t> faces;                   ///< of the mesh, ascending
  std::vector<std::uint32_t> vertices;                ///< of the mesh, ascending
  std::vector<std::array<std::uint32_t, 3>> corners;  ///< per face, indices into vertices
  std::vector<Double2> uv;                            ///< per vertex, units of the mesh, from 0
  Double2 extent{};                                   ///< largest uv
  bool unfolded = false;                              ///< not a projection
};

/// Sums for the stretch of many charts. L2: sqrt(stretch * plane) / surface.
struct ChartStretch {
  double surface = 0.0;  ///< area
  double plane = 0.0;    ///< area
  double stretch = 0.0;  ///< sum of area of the surface times mean square of both singular values
  double l2() const;
  void merge(const ChartStretch& other);
};

/// Every face is in one chart, every chart has a face. A function of the mesh alone: ties go by index.
/// \pre  coordinates are finite, indices below the number of vertices
[[nodiscard]] std::vector<MeshChart> make_charts(const TriangleSpan& mesh, const ChartOptions& options);

[[nodiscard]] ChartStretch measure_stretch(const TriangleSpan& mesh, const MeshChart& chart);
/// Faces of a chart that are flipped (their area below zero by more than rounding), or lie over others of it.
[[nodiscard]] std::size_t count_flipped(const MeshChart& chart);
[[nodiscard]] std::size_t count_overlapping(const MeshChart& chart);

}  // namespace tessera
