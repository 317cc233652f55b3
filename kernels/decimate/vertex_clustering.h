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

/// Cell of an infinite grid with a corner at zero; up to 2^20 cells from there to each side, farther counts as there.
/// \param p  finite \param cell  edge, > 0
[[nodiscard]] std::uint64_t cluster_key(const Double3& p, double cell);

/// One cell of that grid and its box: for streams whose points mostly lie in the cell of the one before, comparing is
/// cheaper than dividing.
struct ClusterCell {
  std::uint64_t key = ~std::uint64_t{0};  ///< no cell has it
  Double3 low{}, high{};                  ///< half open; none at first

  [[nodiscard]] bool holds(const Double3& p) const {
    bool in = true;  // without branches: they would be guessed wrong
    for (std::size_t a = 0; a < 3; ++a) in = in & (p[a] >= low[a]) & (p[a] < high[a]);
    return in;
  }
};
/// The cell that holds p, of the key that cluster_key() gives. \param p  finite \param cell  edge, > 0
[[nodiscard]] ClusterCell cluster_cell(const Double3& p, double cell);

/// Finds the edge of cell at which a stream of vertices occupies about as many cells as allowed.
class ClusterSize {
 public:
  explicit ClusterSize(std::size_t max_cells) : max_(max_cells) {}
  void add(const Double3& p);  ///< what is not finite is skipped
  /// The finest of the sizes tried (fourth roots of two apart) that keeps to the limit; 0 without two different points.
  double cell() const;

 private:
  struct Grid {
    double cell = 0.0;
    ClusterCell last;
    KeyTable occupied;
  };
  void insert(Grid& grid, const Double3& p) const;

  std::size_t max_;
  std::array<Grid, 4> grids_;
  Double3 first_{};
  bool has_first_ = false;
};

struct ClusteredMesh {
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;  ///< mean of the corners, as points carry colours
  std::vector<std::array<std::uint32_t, 3>> faces;
};

/// One grid of `cell`. Faces whose corners lie in three cells stay, once each; all others only shape the vertices.
class VertexClustering {
 public:
  VertexClustering(double cell, std::size_t max_faces);
  /// \param corners  counter-clockwise; a face with one that is not finite is skipped
  /// \return false once more than max_faces would stay, or 5/8 as many cells are touched: take a larger cell and begin anew
  bool add(const std::array<Double3, 3>& corners, const std::array<std::uint32_t, 3>& rgba);
  /// \post a pure function of cell and faces in their order; cells are numbered as they come
  [[nodiscard]] ClusteredMesh finish() const;
  /// Upper bound of what it holds.
  [[nodiscard]] static std::size_t bytes(std::size_t max_faces) { return 288 * max_faces; }

 private:
  struct Cluster {
    ClusterVertex vertex;  ///< relative to the first corner of the cell
    Double3 first{};
  };

  struct Recent {
    ClusterCell cell;
    std::uint32_t number = 0;
  };
  const Recent& find(const Double3& corner);

  double cell_;
  std::size_t max_faces_, max_cells_;
  std::array<Recent, 4> recent_;
  std::size_t next_recent_ = 0;
  KeyTable number_;  ///< of cells
  std::vector<Cluster> clusters_;
  KeyTable seen_;  ///< faces
  std::vector<std::array<std::uint32_t, 3>> faces_;
};

}  // namespace tessera
