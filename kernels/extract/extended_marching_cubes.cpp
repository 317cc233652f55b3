#include "kernels/extract/extended_marching_cubes.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "kernels/extract/cell_tracing.h"
#include "kernels/extract/crease_cells.h"
#include "kernels/extract/level_cells.h"
#include "kernels/extract/level_faces.h"
#include "octree/morton.h"

namespace tessera {
namespace {

/// \param brick   within the block, each coordinate in [0, cells / 64)
/// \param level   of the brick   \param levels  null where all bricks are of one
/// \param band    reused from brick to brick
Patch extract_brick(const DirectedField& field, const ExtractOptions& options, const Int3& brick, int level,
                    const LevelCells* levels, const CreaseLines* creases, BrickBand& band,
                    ExtractReport& report) {
  assert((!options.bends && !creases) || !options.names);
  const bool extended = options.method == ExtractMethod::kExtendedMarchingCubes;
  Int3 in_block, corner;
  for (std::size_t a = 0; a < 3; ++a) {
    in_block[a] = brick[a] * kBrickCells;
    corner[a] = field.origin[a] + in_block[a];
  }
  band.collect(field, in_block, extended);
  BrickInput input{field, band, options.method,
                   feature_thresholds(options.feature_angle_deg, options.corner_angle_deg), levels};
  input.thresholds.exact = field.creased.empty();
  input.thresholds.in_faces = options.in_faces;
  PatchBuilder patch(corner, level, options.names, levels != nullptr);
  BorderShift border(field, band, in_block);
  emit_edge_vertices(field, band, border, patch);
  FeatureLoops features(extended ? band.active_cells() : 0);
  CreaseCells crease_cells(extended ? creases : nullptr, in_block);
  LeafEdges edges;
  for (const LeafMasks& leaf : band.leaves()) {
    const bool meets_finer = levels && leaf.own();
    if (!leaf.any_active && !meets_finer) continue;
    edges.collect(band, leaf);
    trace_leaf(input, leaf, edges, border, crease_cells, patch, features, report);
    if (meets_finer) report.loops += emit_level_faces(input, leaf, edges, patch);
  }
  crease_cells.close_flaps(patch);
  emit_feature_segments(input, features, options.bends && input.thresholds.exact, patch, report);
  return patch.finish();
}

}  // namespace

ExtractReport extract_surface(const DirectedField& field, const ExtractOptions& options,
                              const std::function<void(Patch&&)>& sink, const CreaseLines* creases) {
  Int3 bricks;
  for (std::size_t a = 0; a < 3; ++a) {
    assert(field.cells[a] % kBrickCells == 0 && field.origin[a] % kBrickCells == 0);
    bricks[a] = field.cells[a] >> kBrickBits;
  }
  std::vector<std::pair<std::uint64_t, Int3>> order;
  for (int k = 0; k < bricks[2]; ++k) {
    for (int j = 0; j < bricks[1]; ++j) {
      for (int i = 0; i < bricks[0]; ++i) {
        const Int3 global = {(field.origin[0] >> kBrickBits) + i, (field.origin[1] >> kBrickBits) + j,
                             (field.origin[2] >> kBrickBits) + k};
        order.push_back({brick_key(global), {i, j, k}});
      }
    }
  }
  std::sort(order.begin(), order.end());
  ExtractReport report;
  BrickBand band;
  for (const auto& entry : order) {
    Patch patch = extract_brick(field, options, entry.second, 0, nullptr, creases, band, report);
    if (!patch.empty()) sink(std::move(patch));
  }
  return report;
}

Patch extract_level_brick(const LevelFields& fields, const LevelSurroundings& around, int level,
                          const ExtractOptions& options, ExtractReport& report) {
  const DirectedField mixed = mix_levels(fields, around);
  const LevelCells cells(fields, around, mixed);
  BrickBand band;
  return extract_brick(mixed, options, {0, 0, 0}, level, &cells, nullptr, band, report);
}

}  // namespace tessera
