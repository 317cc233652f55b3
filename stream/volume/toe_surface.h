/// \file toe_surface.h
/// The base that the toe of each polygon spans: a constrained Delaunay triangulation of its points, as surveyors triangulate
/// "from the toe line", or the plane that fits the line best.
#pragma once
#include <filesystem>
#include <vector>

#include "stream/meshes/mesh_store.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/volume/height_noise.h"
#include "stream/volume/toe_lines.h"

namespace tessera {

enum class ToeKind { kTriangles, kPlane };

/// Of one area.
struct ToeSurface {
  SliverGrid faces;  ///< cover the polygon once
  std::vector<SpaceTriangle> triangles;
  double outline = 0.0, uncovered = 0.0;  ///< lengths of the polygon's rings, and of what has no mesh
  double low = 0.0, high = 0.0;           ///< heights
  /// By how much the volume under the base changes if the mesh is displaced by 1 to one side everywhere, to first order.
  double displaced = 0.0;
  double variance = 0.0;  ///< of that volume, by the noise of the mesh
};

/// \param widest  length of a piece of an outline without mesh over which the toe line runs straight
/// \throws InputError for an outline that leaves the mesh for longer, or crosses itself, naming the polygon; ResourceError
///   when the outlines do not fit the cap
std::vector<ToeSurface> span_toes(const MeshStore& mesh, const std::filesystem::path& file,
                                  const std::vector<VolumeArea>& areas, const Double3& origin, ToeKind kind,
                                  double widest, const HeightNoise& noise, WorkerPool& pool,
                                  MemoryBudget& budget);

}  // namespace tessera
