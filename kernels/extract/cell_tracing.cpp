#include "kernels/extract/cell_tracing.h"

#include <bit>

#include "kernels/extract/cell_loops.h"
#include "kernels/extract/loop_triangulation.h"

namespace tessera {
namespace {

bool has_cell(const LeafWords& cells, const Int3& cell) {
  return (cells[static_cast<std::size_t>(cell[2] & 7)] >> ((cell[0] & 7) + 8 * (cell[1] & 7)) & 1) != 0;
}

/// \param storage  of loops that no table has
const CellLoops& loops_of(const BrickBand& band, const Int3& cell, unsigned pattern, CellLoops& storage) {
  if (!ambiguous_faces(pattern)) return unambiguous_loops(pattern);
  std::array<float, 8> value;
  for (int c = 0; c < 8; ++c) {
    const Int3 n = {cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)};
    value[static_cast<std::size_t>(c)] =
        band.at(n[0] >> 3, n[1] >> 3, n[2] >> 3)->leaf->value(BandLeaf::node(n[0], n[1], n[2]));
  }
  storage = trace_loops(pattern, joined_faces(pattern, value));
  return storage;
}

/// Bit i: the surface ends at the segment from point i of the loop to the next.
unsigned boundary_segments(const BrickBand& band, const TracedLoop& loop) {
  unsigned boundary = 0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const int face = common_face(loop.samples.edge[i], loop.samples.edge[loop.after(i)]);
    Int3 across = loop.cell;
    across[static_cast<std::size_t>(face >> 1)] += face & 1 ? 1 : -1;
    if (!band.takes_part(across)) boundary |= 1u << i;
  }
  return boundary;
}

/// \param boundary  of boundary_segments()
void emit_plain_loop(const DirectedField& field, const TracedLoop& loop, const LoopTriangles& triangles,
                     unsigned boundary, PatchBuilder& patch) {
  const auto& vertex = loop.vertex;
  for (std::size_t i = 0; i < static_cast<std::size_t>(triangles.count); ++i) {
    const auto& t = triangles.triangle[i];
    unsigned border = 0;
    for (std::size_t e = 0; boundary != 0 && e < 3; ++e)
      if (t[(e + 1) % 3] == loop.after(t[e])) border |= (boundary >> t[e] & 1u) << e;
    patch.add_face(vertex[t[0]], vertex[t[1]], vertex[t[2]], border);
  }
  if (triangles.count > 0) return;
  const std::uint32_t centre = patch.add_centre(loop.cell, loop.number, mean_point(loop),
                                                mean_colour(field, loop), VertexClass::kSmooth);
  for (std::size_t i = 0; i < loop.size(); ++i)
    patch.add_face(vertex[i], vertex[loop.after(i)], centre, boundary >> i & 1u);
}

/// Whether the fan's triangles at kinks have an area.
bool fits_kinks(const TracedLoop& loop, const LoopKinks& kinks, const Float3& centre) {
  for (std::size_t k = 0; k < kinks.all.size(); ++k) {
    const LoopKink& kink = kinks.all[k];
    if (kink.snapped != 0) continue;
    const bool last = k + 1 == kinks.all.size() || kinks.all[k + 1].segment != kink.segment ||
                      kinks.all[k + 1].snapped != 0;
    const bool first = k == 0 || kinks.all[k - 1].segment != kink.segment || kinks.all[k - 1].snapped != 0;
    if (first && is_sliver(loop.samples.point[kink.segment], kink.at, centre)) return false;
    if (is_sliver(kink.at, last ? loop.samples.point[loop.after(kink.segment)] : kinks.all[k + 1].at, centre))
      return false;
  }
  return true;
}

/// Keeps a loop that a feature passes. \returns false: it passes none, or none that can be sampled
bool keep_feature_loop(const BrickInput& brick, std::uint32_t rank, TracedLoop& loop, const LoopKinks& kinks,
                       CreaseCells& creases, PatchBuilder& patch, FeatureLoops& features,
                       ExtractReport& report) {
  FeatureSample sample = feature_of(brick, loop);
  if (sample.kind == FeatureKind::kNone) return false;
  if (sample.kind != FeatureKind::kRejected && !fits_kinks(loop, kinks, sample.position))
    sample.kind = FeatureKind::kRejected;
  const Int3& cell = loop.cell;
  const bool own = inside_brick(cell), corner = sample.kind == FeatureKind::kCorner;
  if (sample.kind == FeatureKind::kRejected) {
    report.rejected_samples += own;
    return false;
  }
  (corner ? report.corner_samples : report.crease_samples) += own;
  const VertexClass kind = !sample.on_feature ? VertexClass::kSmooth
                           : corner           ? VertexClass::kCorner
                                              : VertexClass::kCrease;
  const std::uint32_t centre =
      patch.add_centre(cell, loop.number, sample.position, mean_colour(brick.field, loop), kind);
  if (own) patch.add_safe(centre, in_owner(cell) + mean_point(loop));
  if (own && (cell[0] == kBrickCells - 1 || cell[1] == kBrickCells - 1 || cell[2] == kBrickCells - 1))
    patch.add_exported(patch.key(cell, 6 + loop.number), centre);
  features.add(loop, rank, centre, sample.position);
  // Of kinks in faces of other bricks, who emits the faces there has the vertices.
  for (const LoopKink& kink : kinks.all)
    if (kink.snapped == 0 && inside_brick(kink.above))
      features.add_kink(kink.segment, creases.vertex(kink, patch));
  return true;
}

}  // namespace

void trace_leaf(const BrickInput& brick, const LeafMasks& leaf, const LeafEdges& edges, BorderShift& border,
                CreaseCells& creases, PatchBuilder& patch, FeatureLoops& features, ExtractReport& report) {
  const auto inside = brick.band.corner_words(leaf, &LeafMasks::inside);
  const LeafWords at_boundary = patch.names() && leaf.own() ? brick.band.boundary_cells(leaf) : LeafWords{};
  LoopTriangles triangles;
  const LoopKinks none;
  std::vector<CreasedLoop> creased;
  const auto trace_cell = [&](const Int3& cell, unsigned pattern) {
    const bool own = inside_brick(cell), closing = has_cell(leaf.leaf->closing, cell);
    const std::size_t faces_before = patch.faces();
    CellLoops storage;
    const CellLoops& loops = loops_of(brick.band, cell, pattern, storage);
    const auto loop_of = [&](const std::uint8_t* edge, int number) {
      return edges.loop(brick.field, cell, number, edge, loops.length[static_cast<std::size_t>(number)]);
    };
    const std::uint8_t* edge = loops.edge.data();
    creased.clear();
    if (creases.pass(cell)) {
      for (int number = 0; number < loops.count; edge += loops.length[static_cast<std::size_t>(number++)])
        creased.emplace_back().loop = loop_of(edge, number);
      // Beside a border that cuts cells there are no features: their samples would lie beyond it.
      creases.settle(brick, !closing, creased);
      edge = loops.edge.data();
    }
    for (int number = 0; number < loops.count; edge += loops.length[static_cast<std::size_t>(number++)]) {
      TracedLoop loop = loop_of(edge, number);
      report.loops += own;
      const CreasedLoop* known = creased.empty() ? nullptr : &creased[static_cast<std::size_t>(number)];
      if (known && known->followed) {
        if (own) creases.emit(brick, *known, patch);
        report.crease_loops += own;
        continue;
      }
      report.unfollowed_loops += known && known->kinked && own;
      const LoopKinks& kinks = known ? known->kinks : none;
      const bool cut = edges.moving() && border.triangulate(edge, loop.root.data(), loop.size(), triangles);
      if (!cut && brick.method == ExtractMethod::kExtendedMarchingCubes && !closing &&
          keep_feature_loop(brick, leaf.cell_rank(cell[0] & 7, cell[1] & 7, cell[2] & 7), loop, kinks,
                            creases, patch, features, report))
        continue;
      if (!own) continue;
      if (!kinks.all.empty()) {
        creases.fill(brick, *known, patch);
        continue;
      }
      if (cut)
        border.triangulate_crossing(cell, edge, loop.root.data(), loop.size(), triangles);
      else
        triangulate_loop(loop.samples, triangles);
      emit_plain_loop(brick.field, loop, triangles,
                      has_cell(at_boundary, cell) ? boundary_segments(brick.band, loop) : 0, patch);
    }
    if (closing || has_cell(leaf.leaf->unseen, cell)) patch.mark_synthetic(faces_before);
  };
  for (std::size_t z = 0; z < 8; ++z)
    for (std::uint64_t left = leaf.active[z]; left; left &= left - 1) {
      const int b = std::countr_zero(left);
      unsigned pattern = 0;
      for (std::size_t c = 0; c < 8; ++c)
        pattern |= static_cast<unsigned>(inside[z + (c >> 2)][c & 3] >> b & 1) << c;
      trace_cell({leaf.at[0] * 8 + (b & 7), leaf.at[1] * 8 + (b >> 3), leaf.at[2] * 8 + static_cast<int>(z)},
                 pattern);
    }
}

}  // namespace tessera
