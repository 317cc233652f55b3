/// \file mesh_frame.h
/// The grid of a raster over a mesh.
#pragma once
#include <cstdint>

#include "kernels/survey/plan_raster.h"
#include "stream/meshes/mesh_column.h"
#include "stream/meshes/mesh_store.h"
#include "stream/raster/raster_output.h"

namespace tessera {

struct MeshFrame : RasterGrid {
  MeshBox box;  ///< of the mesh

  /// \throws UsageError as CellRange and RasterGrid
  MeshFrame(const MeshBox& mesh, double edge)
      : RasterGrid(CellRange(mesh.low[0], mesh.high[0], edge), CellRange(mesh.low[1], mesh.high[1], edge),
                   edge),
        box(mesh) {}
  /// All that may have a centre of the window below or above it.
  MeshBox column(const RasterWindow& w) const {
    const auto at = [&](std::int64_t k) { return static_cast<double>(k) * cell; };
    return column_of({{west + at(w.column), north - at(w.row + w.rows), box.low[2]},
                      {west + at(w.column + w.columns), north - at(w.row), box.high[2]}},
                     box);
  }
  bool holds_centre(std::int64_t column, std::int64_t row) const {
    return inside(column, row, box.low[0], box.high[0], box.low[1], box.high[1]);
  }
};

}  // namespace tessera
