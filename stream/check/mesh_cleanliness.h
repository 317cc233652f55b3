/// \file mesh_cleanliness.h
/// How smooth a mesh is to look at: inner edges that fold sharply, and how ragged its borders run. Streaming: edges are sorted
/// through the disk; no number depends on the cap.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/vertex_store.h"

namespace tessera {

/// Degrees between the normals of two faces from which the edge between them is sharp.
inline constexpr double kSharpEdgeAngle = 70.0;
/// Steps of smoothing that a border is compared with: they take out waves of a few edges.
inline constexpr int kBorderSmoothing = 20;

struct MeshCleanliness {
  std::uint64_t inner_edges = 0;  ///< of two faces that have an area
  std::uint64_t sharp_edges = 0;  ///< of those, with at least kSharpEdgeAngle
  std::uint64_t border_edges = 0;
  double border_length = 0.0;
  /// Length of the border over its length after kBorderSmoothing steps, each of which takes every vertex of two border edges
  /// halfway to the middle of its neighbours; 1 without a border. Empty where the cap cannot hold the border.
  std::optional<double> border_jaggedness;
  std::uint64_t border_bytes = 0;  ///< that the border takes

  double sharp_edges_per_1000() const {
    return inner_edges == 0 ? 0.0 : 1e3 * static_cast<double>(sharp_edges) / static_cast<double>(inner_edges);
  }
};

struct MeshCleanlinessOptions {
  std::uint64_t memory_bytes = std::uint64_t{1}
                               << 30;  ///< all that is allocated, the reader and the store excluded
  std::filesystem::path temp;          ///< as VertexStore's
  std::function<void()> check_stop;    ///< may throw StoppedError; may be empty
};

/// Reads the faces of the mesh once. Faces that name no vertex, repeat one, have no area or a corner that is not finite take no
/// part.
/// \param positions  of the vertices of `mesh`
/// \throws ResourceError where the disk is full
MeshCleanliness measure_cleanliness(MeshReader& mesh, VertexStore& positions,
                                    const MeshCleanlinessOptions& options);

Json to_json(const MeshCleanliness& cleanliness);
std::string describe(const MeshCleanliness& cleanliness);  ///< lines for people

}  // namespace tessera
