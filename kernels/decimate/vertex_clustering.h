/// \file vertex_clustering.h
/// A coarse copy of a mesh that is only streamed past: the vertices of one cell of a grid become one.
/// For looking at, not for work: nothing is proven about it, and thin parts may close up.
/// Sources: Rossignac and Borrel, "Multi-resolution 3D Approximations for Rendering Complex Scenes", 1993; Lindstrom,
/// "Out-of-Core Simplification of Large Polygonal Models", 2000 (the vertex of a cell by the quadrics of its faces).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "kernels/decimate/cluster_vertex.h"
#include "octree/key_table.h"

namespace tessera {

/// An infinite grid with a corner at zero; up to 2^20 cells from there to each side, farther counts as there.
class ClusterLattice {
 public:
  /// \param cell  edge, > 0
  explicit ClusterLattice(double cell) : inverse_(1.0 / cell) {}
  /// Names the cell that holds p. \pre finite
  [[nodiscard]] std::uint64_t key(const Double3& p) const;

 private:
  double inverse_;
};

/// Vertices that follow one another mostly lie in the same cells: so many that came last are at hand.
inline constexpr std::size_t kRecentCells = 2048;

/// Finds the edge of cell at which a stream of vertices occupies about as many cells as allowed: counted on grids twice as coarse from one to
/// the next, and between two of them told from how their counts grow.
class ClusterSize {
 public:
  /// \param first_cell  the finest that is tried; 0: as far as the first two points are apart
  explicit ClusterSize(std::size_t max_cells, double first_cell = 0.0);
  void add(const Double3& p);  ///< what is not finite is skipped
  /// The finest of the sizes told (fourth roots of two apart) that keeps to the limit; 0 without two different points.
  [[nodiscard]] double cell() const;
  /// Whether the first cell was fine enough to say so: else a finer one may keep to the limit too.
  [[nodiscard]] bool is_settled() const { return is_settled_; }

 private:
  void begin(double cell);
  void coarsen();

  std::size_t max_;
  double cell_ = 0.0, farthest_ = 0.0;                ///< as far from zero as its keys reach
  std::array<std::uint64_t, kRecentCells> recent_{};  ///< keys
  KeyTable occupied_, coarse_;
  Double3 first_{};
  bool has_first_ = false, is_settled_ = false;
};

struct ClusteredMesh {
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;  ///< mean of the corners, as points carry colours
  std::vector<std::array<std::uint32_t, 3>> faces;
};

/// One grid of `cell`. Faces whose corners lie in three cells stay, once each. First come all vertices, then the faces.
class VertexClustering {
 public:
  static constexpr std::uint32_t kNoCell = 0xffffffffu;

  VertexClustering(double cell, std::size_t max_faces);
  /// \param rgba  0: has no colour
  /// \return number of its cell; kNoCell for what is not finite, or once 5/8 as many cells as faces are touched
  std::uint32_t add_vertex(const Double3& p, std::uint32_t rgba = 0);
  /// The cell of a vertex that came, found again.
  [[nodiscard]] std::uint32_t cell_of(const Double3& p) const;
  /// \param cells  of its corners; one without a cell is skipped
  void add_face(const std::array<std::uint32_t, 3>& cells);
  /// Draws the vertices of its cells towards the plane of a face. Of a fine mesh some of the faces of each cell are enough.
  void add_shape(const std::array<Double3, 3>& corners, const std::array<std::uint32_t, 3>& cells);
  /// false once more faces or cells came than may: take a larger cell and begin anew
  [[nodiscard]] bool fits() const { return fits_; }
  /// \post a pure function of cell, vertices and faces in their order; cells are numbered as they come
  [[nodiscard]] ClusteredMesh finish() const;
  /// Upper bound of what it holds.
  [[nodiscard]] static std::size_t bytes(std::size_t max_faces) { return 288 * max_faces; }

 private:
  struct Cluster {
    ClusterVertex vertex;  ///< relative to the first vertex of the cell
    Double3 first{};
  };

  struct Recent {
    std::uint64_t key = ~std::uint64_t{0};  ///< no cell has it
    std::uint32_t number = 0;
  };

  double cell_;
  ClusterLattice grid_;
  std::size_t max_faces_, max_cells_;
  bool fits_ = true;
  std::array<Recent, kRecentCells> recent_;
  KeyTable number_;  ///< of cells
  std::vector<Cluster> clusters_;
  KeyTable seen_;  ///< faces
  std::vector<std::array<std::uint32_t, 3>> faces_;
};

}  // namespace tessera
