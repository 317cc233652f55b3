// Faces at feature loops. They are emitted segment by segment, by the brick that owns the cell above the face
// in which the segment lies, because an edge flip joins the loops of both cells:
//
//        b                    b
//      / | \                / | \            loop `above` runs a -> b, loop `below` runs b -> a;
//   lo   |   hi    ->     lo --- hi          lo, hi: their feature samples; the segment a-b gives way to the
//      \ | /                \ | /            edge lo-hi, which follows the feature
//        a                    a
#include <cmath>

#include "kernels/extract/brick_extractor.h"

namespace tessera {
namespace {

/// A flip must gain at least this much in the sum of cosines between triangles and root normals.
constexpr float kFlipGain = 1e-3f;

}  // namespace

void BrickExtractor::emit_feature_segments() {
  for (FeatureLoop& loop : features_)
    for (std::size_t s = 0; s < loop.size; ++s) emit_segment(loop, s);
}

void BrickExtractor::emit_segment(FeatureLoop& loop, std::size_t s) {
  const std::size_t i = loop.first + s;
  const std::size_t j = loop.first + (s + 1 == loop.size ? 0 : s + 1);
  const int face = common_face(feature_edge_[i], feature_edge_[j]);
  const int axis = face >> 1;
  const std::uint32_t a = feature_vertex_[i];
  const std::uint32_t b = feature_vertex_[j];
  Int3 across = loop.cell;
  across[static_cast<std::size_t>(axis)] += face & 1 ? 1 : -1;
  const int mirrored = mirrored_edge(feature_edge_[i], axis);
  if (face & 1) {  // the cell above owns the segment; if its loop is a feature it emits both sides
    const bool emits = inside_brick(across) || (inside_brick(loop.cell) && other_level(across));
    if (emits && !feature_loop_at(across, mirrored)) add_face(a, b, loop.centre, ends_before(across));
    return;
  }
  if (!inside_brick(loop.cell)) return;
  FeatureLoop* below = feature_loop_at(across, mirrored);
  if (!below) {
    add_face(a, b, loop.centre, ends_before(across));
    return;
  }
  // Two flips between the same loops would join them by two edges: not a manifold.
  std::uint8_t& flipped = loop.flipped[axis];
  if (!(flipped >> below->number & 1) && should_flip(loop, *below, axis, s)) {
    flipped = static_cast<std::uint8_t>(flipped | 1 << below->number);
    add_face(loop.centre, a, below->centre);
    add_face(below->centre, b, loop.centre);
    ++report_->flips;
    return;
  }
  add_face(a, b, loop.centre);
  add_face(b, a, below->centre);
}

bool BrickExtractor::should_flip(const FeatureLoop& above, const FeatureLoop& below, int axis,
                                 std::size_t s) const {
  const std::size_t i = above.first + s;
  const std::size_t j = above.first + (s + 1 == above.size ? 0 : s + 1);
  const Float3 a = point_in_cell(feature_edge_[i], feature_root_[i]);
  const Float3 b = point_in_cell(feature_edge_[j], feature_root_[j]);
  const Float3& hi = above.position;
  Float3 lo = below.position;
  lo[static_cast<std::size_t>(axis)] -= 1.0f;
  if (is_sliver(hi, a, lo) || is_sliver(lo, b, hi)) return false;
  const Float3& na = field_.roots[feature_root_[i]].normal;
  const Float3& nb = field_.roots[feature_root_[j]].normal;
  const auto cosine = [](const Float3& up, const Float3& n) { return dot(up, n) / std::sqrt(dot(up, up)); };
  const float at_a = cosine(triangle_normal(hi, a, lo), na);
  const float at_b = cosine(triangle_normal(lo, b, hi), nb);
  if (!(at_a > 0.0f) || !(at_b > 0.0f)) return false;
  const Float3 old_hi = triangle_normal(a, b, hi);
  const Float3 old_lo = triangle_normal(b, a, lo);
  const float before = cosine(old_hi, na) + cosine(old_hi, nb) + cosine(old_lo, na) + cosine(old_lo, nb);
  return 2.0f * (at_a + at_b) > before + kFlipGain;
}

BrickExtractor::FeatureLoop* BrickExtractor::feature_loop_at(const Int3& cell, int edge) {
  const LeafMasks* m = band_.at(cell[0] >> 3, cell[1] >> 3, cell[2] >> 3);
  if (!m) return nullptr;
  const int x = cell[0] & 7, y = cell[1] & 7, z = cell[2] & 7;
  if (!(m->active[static_cast<std::size_t>(z)] >> (x + 8 * y) & 1)) return nullptr;
  const std::int32_t first = first_feature_[m->cell_rank(x, y, z)];
  if (first < 0) return nullptr;
  for (auto f = static_cast<std::size_t>(first); f < features_.size() && features_[f].cell == cell; ++f) {
    const FeatureLoop& loop = features_[f];
    for (std::size_t i = loop.first; i < loop.first + loop.size; ++i)
      if (feature_edge_[i] == edge) return &features_[f];
  }
  return nullptr;
}

}  // namespace tessera
