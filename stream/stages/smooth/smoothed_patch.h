/// \file smoothed_patch.h
/// The vertices of one patch in a round of smoothing, and those that a tile could not see far enough around.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "kernels/smooth/smooth.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

/// By the numbers of the patch.
struct SmoothedPatch {
  std::vector<std::uint64_t> key;
  std::vector<Double3> from, position;  ///< where the round began, and where it says that the vertex belongs
  std::vector<Float3> laplacian;        ///< or empty
  std::vector<VertexRole> role;
  std::vector<std::uint8_t> complete;  ///< 1: the position is right
  std::vector<std::uint8_t> first;     ///< 1: no patch before it has the vertex

  /// \param near  holds the patch   \param k  its number among those asked for
  static SmoothedPatch of(const MeshHaloBlock& near, std::size_t k, std::size_t patch,
                          const SmoothedBlock& smoothed);
  bool whole() const;
};

/// Smooths patches with the faces that lie rings around them, few at first, and then those vertices again that hang on more. Where
/// that takes more than `bytes`, in parts: the same positions. \pre the round has no coarse level and is no flow
/// \param patches  ascending   \param stop  throws where the job is to end
/// \param use  of every patch, all of it right
/// \returns faces read
/// \throws ResourceError where not even the rings of one vertex fit
std::uint64_t smooth_by_rings(const MeshStore& store, const SmoothRound& rule,
                              std::span<const std::size_t> patches, std::uint64_t bytes,
                              const std::function<void()>& stop,
                              const std::function<void(std::size_t patch, const SmoothedPatch&)>& use);

/// Rings that mostly hold all that a round hangs on.
int few_rings(const SmoothRound& rule);

/// Upper bound of what smooth_by_rings() takes for rings of so many vertices and faces. \param patch_bytes  of the largest patch
std::uint64_t smooth_by_rings_bytes(const SmoothRound& rule, std::uint64_t vertices, std::uint64_t faces,
                                    std::uint64_t patch_bytes);

}  // namespace tessera
