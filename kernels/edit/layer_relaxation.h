/// \file layer_relaxation.h
/// One level of displacement volumes: a surface over its base in a pose, whose prisms go to the volumes that they had at rest while
/// its edges and heights stay like those at rest (displacement_volumes.h). Four prisms without a common free vertex are worked on
/// beside each other; which ones, and in what order, hangs on the faces alone.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "kernels/edit/vertex_rotations.h"
#include "octree/vector.h"

namespace tessera {

using PrismFaces = std::span<const std::array<std::uint32_t, 3>>;

/// A surface over its base, one point of the base for each vertex.
struct Layer {
  std::span<const Double3> base;
  std::span<const Double3> surface;
};

class LayerRelaxation {
 public:
  /// \param rest   n
  /// \param posed  its surface is what vertices that are not free keep, and where the others start from
  /// \param free   n flags
  /// \param rotation   n: how the base turns from rest to pose
  /// \param widening  n: displacements whose prisms the layer gains (base_volume.h); or empty
  LayerRelaxation(const Layer& rest, const Layer& posed, PrismFaces faces, std::span<const std::uint8_t> free,
                  std::span<const Rotation> rotation, std::span<const Double3> widening);
  ~LayerRelaxation();
  LayerRelaxation(const LayerRelaxation&) = delete;
  LayerRelaxation& operator=(const LayerRelaxation&) = delete;

  /// Those with a free vertex.
  [[nodiscard]] std::size_t prisms() const;
  /// Volumes and edges are to be those at rest with all heights times `share`.
  void aim(double share);
  /// Moves the free vertices to these positions; the others stay where they are.
  /// \param surface  n
  void set(std::span<const Double3> surface);
  /// Multiplies the displacements of free vertices from the base by `free_by`, and sets those of the others to `others_to` times
  /// what they were in the pose at first.
  void scale(double free_by, double others_to);
  /// Every prism in turn takes the shortest way to its volume, `relaxation` of it.
  void project(double relaxation);
  /// Vertex by vertex towards the edges at rest, turned as the base turns.
  void relax_edges();
  /// Heights as shares of those at rest become smooth (thesis 5.4.2): what volumes leave open.
  void relax_heights();
  /// Heights by what volumes lack around them, a mean over `rings`: what single prisms would need many sweeps for. Where a layer
  /// goes through its base, and volumes cancel, nothing changes.
  void scale_heights(int rings);
  /// Sum of what volumes are off by, and sum of all, as shares of what is aimed at.
  void measure(double& off, double& whole) const;
  [[nodiscard]] std::vector<Double3> surface() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
