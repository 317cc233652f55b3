/// \file traced_brick.h
/// The passes of the extraction over brick (0, 0, 0) of a field, one at a time.
#pragma once
#include "kernels/extract/cell_tracing.h"

namespace tessera::test {

class TracedBrick {
 public:
  explicit TracedBrick(const DirectedField& field, bool names = false)
      : input{field, band, ExtractMethod::kExtendedMarchingCubes, feature_thresholds(25.0, 45.0)},
        patch(field.origin, 0, names, false),
        border(field, band, {0, 0, 0}),
        features((band.collect(field, {0, 0, 0}, true), band.active_cells())) {
    emit_edge_vertices(field, band, border, patch);
  }
  void trace() {
    for (const LeafMasks& leaf : band.leaves()) {
      edges.collect(band, leaf);
      trace_leaf(input, leaf, edges, border, creases, patch, features, report);
    }
  }

  BrickBand band;
  BrickInput input;
  PatchBuilder patch;
  BorderShift border;
  FeatureLoops features;
  CreaseCells creases{nullptr, {0, 0, 0}};
  LeafEdges edges;
  ExtractReport report;
};

}  // namespace tessera::test
