/// \file base_surface.h
/// What volumes are counted from, window by window: an earlier mesh, or heights of a raster.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "stream/meshes/mesh_store.h"
#include "stream/volume/plan_faces.h"

namespace tessera {

class BaseSurface {
 public:
  using Use = std::function<void(std::span<const SpaceTriangle>)>;
  virtual ~BaseSurface() = default;
  /// Upper bound of what is held for a window beside what `use` makes of it, and of triangles at a time.
  virtual std::uint64_t window_bytes(const MeshBox& window) const = 0;
  /// Triangles relative to the origin, all that may meet the window in plan, in batches whose borders do not hang on memory or
  /// threads. Any thread. \param window  in the coordinates of the mesh
  virtual void for_triangles(const MeshBox& window, const Use& use) const = 0;
  virtual double low() const = 0;  ///< heights, in the coordinates of the mesh
  virtual double high() const = 0;
};

/// \param mesh  outlives it
std::unique_ptr<BaseSurface> mesh_base(const MeshStore& mesh, const Double3& origin);

}  // namespace tessera
