/// \file feature_edges.h
/// Which vertices and edges of a block are features: corners stay, creases and borders collapse along
/// themselves.
#pragma once
#include "kernels/decimate/collapse_mesh.h"

namespace tessera {

/// Marks crease edges and sets kVertexCrease, kVertexFixed in `mesh`.
///
/// A vertex is on a feature if its vertex_class says so or if an edge at it in the reference turns by more
/// than `feature_angle_deg` (0: classes alone). The reference and not the block is asked, because a decimated
/// block turns more at every edge. An edge of the block between two feature vertices is a crease where it
/// turns by more than 10 degrees and half the feature angle; so is the rim of synthetic faces. Two crease
/// edges make a crease vertex, one or more than two a fixed one. \pre  reference vertices that are vertices
/// of the block have the same key
/// \param sharp             sharp_vertices() of the reference
/// \param reference_vertex  per vertex of the mesh the same one in the reference, or kNoCorner
void mark_features(CollapseMesh& mesh, const MeshBlock& block, const std::vector<std::uint8_t>& sharp,
                   const std::vector<std::uint32_t>& reference_vertex, double feature_angle_deg);

/// Per vertex whether a sharp edge ends there: one that turns by more than the limit and, unless it turns by
/// more than 60 degrees too, goes on at both ends with at most 45 degrees of bend. Noise is sharp too, but
/// does not go on. Empty where the angle is 0.
[[nodiscard]] std::vector<std::uint8_t> sharp_vertices(const CollapseMesh& mesh, double feature_angle_deg);

}  // namespace tessera
