/// \file mesh_column.h
/// The part of a mesh that lies above and below a rectangle of the plan: what surfaces are seen against each other by.
#pragma once
#include <algorithm>

#include "stream/meshes/mesh_store.h"

namespace tessera {

/// The same in plan, and as high and deep as both together.
inline MeshBox column_of(const MeshBox& box, const MeshBox& whole) {
  MeshBox out = box;
  out.low[2] = std::min(box.low[2], whole.low[2]), out.high[2] = std::max(box.high[2], whole.high[2]);
  return out;
}

}  // namespace tessera
