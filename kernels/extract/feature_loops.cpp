// Faces are emitted segment by segment, because an edge flip joins the loops of both cells at a face:
//
//        b                    b
//      / | \                / | \            loop `above` runs a -> b, loop `below` runs b -> a;
//   lo   |   hi    ->     lo --- hi          lo, hi: their feature samples; the segment a-b gives way to the
//      \ | /                \ | /            edge lo-hi, which follows the feature
//        a                    a
#include "kernels/extract/feature_loops.h"

#include <algorithm>
#include <cmath>

#include "kernels/extract/bend_sample.h"
#include "kernels/extract/level_cells.h"

namespace tessera {
namespace {

/// A flip must gain at least this much in the sum of cosines between triangles and root normals.
constexpr float kFlipGain = 1e-3f;
/// Roots beside a bend whose normals open wider than this (45 degrees) against the roots in the face are of other sheets.
constexpr double kSheetCosine = 0.70710678118654752;

bool should_flip(const DirectedField& field, const FeatureLoops& features, const FeatureLoop& above,
                 const FeatureLoop& below, int axis, std::size_t s) {
  const FeatureLoop::Corner &first = features.corner(above, s), &second = features.corner(above, s + 1);
  const EdgeRoot &root_a = field.roots[first.root], &root_b = field.roots[second.root];
  const Float3 a = point_in_cell(first.edge, root_a);
  const Float3 b = point_in_cell(second.edge, root_b);
  const Float3& hi = above.position;
  Float3 lo = below.position;
  lo[static_cast<std::size_t>(axis)] -= 1.0f;
  if (is_sliver(hi, a, lo) || is_sliver(lo, b, hi)) return false;
  const Float3 &na = root_a.normal, &nb = root_b.normal;
  const auto cosine = [](const Float3& up, const Float3& n) { return dot(up, n) / std::sqrt(dot(up, up)); };
  const float at_a = cosine(triangle_normal(hi, a, lo), na);
  const float at_b = cosine(triangle_normal(lo, b, hi), nb);
  if (!(at_a > 0.0f) || !(at_b > 0.0f)) return false;
  const Float3 old_hi = triangle_normal(a, b, hi);
  const Float3 old_lo = triangle_normal(b, a, lo);
  const float before = cosine(old_hi, na) + cosine(old_hi, nb) + cosine(old_lo, na) + cosine(old_lo, nb);
  return 2.0f * (at_a + at_b) > before + kFlipGain;
}

/// The roots of a loop, `shift` cells below along the axis.
void add_planes(const DirectedField& field, const FeatureLoops& features, const FeatureLoop& loop, int axis,
                float shift, std::size_t skipped, TangentPlanes& planes) {
  for (std::size_t s = 0; s < loop.size; ++s) {
    const FeatureLoop::Corner& corner = features.corner(loop, s);
    if (s == skipped || s == skipped + 1 || (s == 0 && skipped + 1 == loop.size)) continue;
    const EdgeRoot& root = field.roots[corner.root];
    Float3 at = point_in_cell(corner.edge, root);
    at[static_cast<std::size_t>(axis)] -= shift;
    planes.point[planes.size] = wide(at);
    planes.normal[planes.size] = wide(root.normal);
    planes.offset[planes.size++] = root.slides ? 0.0 : static_cast<double>(root.offset);
  }
}

/// A vertex between the samples of two loops whose segment was flipped, if the crease bends there.
/// \param a, b  ends of the segment
bool find_bend(const BrickInput& brick, const FeatureLoops& features, const FeatureLoop& above,
               const FeatureLoop& below, int axis, std::size_t s, Float3& x) {
  CreaseSpan span;
  span.planes.size = 0;
  add_planes(brick.field, features, above, axis, 0.0f, above.size, span.planes);
  span.beside = {s, s + 1 == above.size ? 0 : s + 1};
  const FeatureLoop::Corner &first = features.corner(above, s), &second = features.corner(above, s + 1);
  // The loop below has the same segment the other way round.
  std::size_t shared = 0;
  while (features.corner(below, shared).root != second.root) ++shared;
  add_planes(brick.field, features, below, axis, 1.0f, shared, span.planes);
  Float3 lo = below.position;
  lo[static_cast<std::size_t>(axis)] -= 1.0f;
  const Float3& hi = above.position;
  span.end = {wide(lo), wide(hi)};
  Double3 found;
  if (!sample_bend(span, kSheetCosine, found)) return false;
  x = narrow(found);
  const EdgeRoot &root_a = brick.field.roots[first.root], &root_b = brick.field.roots[second.root];
  const Float3 a = point_in_cell(first.edge, root_a), b = point_in_cell(second.edge, root_b);
  const auto sound = [](const Float3& p, const Float3& q, const Float3& r, const Float3& normal) {
    return !is_sliver(p, q, r) && dot(triangle_normal(p, q, r), normal) > 0.0f;
  };
  return sound(hi, a, x, root_a.normal) && sound(x, a, lo, root_a.normal) && sound(lo, b, x, root_b.normal) &&
         sound(x, b, hi, root_b.normal);
}

/// Four faces around the vertex. Taken back it lies on the segment, where those of each cell stay in it.
void add_bend(const BrickInput& brick, const FeatureLoop& loop, const FeatureLoop::Corner& a,
              const FeatureLoop::Corner& b, const Float3& x, std::uint32_t below, PatchBuilder& patch) {
  const EdgeRoot &root_a = brick.field.roots[a.root], &root_b = brick.field.roots[b.root];
  ColourMean colour;
  colour.add(root_a.rgba);
  colour.add(root_b.rgba);
  const std::uint32_t middle =
      patch.add_own({0, in_owner(loop.cell) + x, colour.value(), VertexClass::kCrease});
  patch.add_safe(
      middle, in_owner(loop.cell) + (point_in_cell(a.edge, root_a) + point_in_cell(b.edge, root_b)) * 0.5f);
  patch.add_face(loop.centre, a.vertex, middle);
  patch.add_face(middle, a.vertex, below);
  patch.add_face(below, b.vertex, middle);
  patch.add_face(middle, b.vertex, loop.centre);
}

/// Faces from the segment, kink by kink, to the centre. \param first  where it begins  \param last  vertex where it ends
void emit_kinked(const FeatureLoops& features, const FeatureLoop& loop, const FeatureLoop::Corner& first,
                 std::uint32_t last, PatchBuilder& patch) {
  std::uint32_t from = first.vertex;
  for (std::size_t k = 0; k <= first.kinks; ++k) {
    const std::uint32_t to = k == first.kinks ? last : features.kink(first.first_kink + k);
    patch.add_face(from, to, loop.centre);
    from = to;
  }
}

/// The corner of the loop across at which the segment begins, that is ends.
const FeatureLoop::Corner& corner_across(const FeatureLoops& features, const FeatureLoop& beyond,
                                         const FeatureLoop::Corner& second) {
  std::size_t s = 0;
  while (features.corner(beyond, s).root != second.root) ++s;
  return features.corner(beyond, s);
}

void emit_segment(const BrickInput& brick, FeatureLoops& features, FeatureLoop& loop, std::size_t s,
                  bool bends, PatchBuilder& patch, ExtractReport& report) {
  const FeatureLoop::Corner &first = features.corner(loop, s), &second = features.corner(loop, s + 1);
  const int face = common_face(first.edge, second.edge);
  const int axis = face >> 1;
  const std::uint32_t a = first.vertex, b = second.vertex;
  Int3 across = loop.cell;
  across[static_cast<std::size_t>(axis)] += face & 1 ? 1 : -1;
  // A cell across the face of the brick that belongs to a brick of another level: each side emits its own faces.
  const auto other_level = [&] { return brick.levels && brick.levels->step_of(across) != 0; };
  const bool own = inside_brick(loop.cell);
  const bool emits = face & 1 ? inside_brick(across) || (own && other_level()) : own;
  if (!emits) return;
  FeatureLoop* beyond = features.find(brick.band, across, mirrored_edge(first.edge, axis));
  // One of the two may go without the kinks: then a flap lies between (crease_cells.h).
  const FeatureLoop::Corner* across_at = beyond ? &corner_across(features, *beyond, second) : nullptr;
  if (first.kinks > 0 || (across_at && across_at->kinks > 0)) {
    if (beyond && (face & 1)) return;
    emit_kinked(features, loop, first, b, patch);
    if (beyond) emit_kinked(features, *beyond, *across_at, a, patch);
    return;
  }
  if (!beyond) {
    patch.add_face(a, b, loop.centre, brick.band.takes_part(across) ? 0u : 1u);
    return;
  }
  if (face & 1) return;  // the loop above emits both sides
  // Two flips between the same loops would join them by two edges: not a manifold.
  std::uint8_t& flipped = loop.flipped[axis];
  if (!(flipped >> beyond->number & 1) && should_flip(brick.field, features, loop, *beyond, axis, s)) {
    flipped = static_cast<std::uint8_t>(flipped | 1 << beyond->number);
    ++report.flips;
    Float3 x;
    if (bends && find_bend(brick, features, loop, *beyond, axis, s, x)) {
      ++report.bend_samples;
      add_bend(brick, loop, first, second, x, beyond->centre, patch);
      return;
    }
    patch.add_face(loop.centre, a, beyond->centre);
    patch.add_face(beyond->centre, b, loop.centre);
    return;
  }
  patch.add_face(a, b, loop.centre);
  patch.add_face(b, a, beyond->centre);
}

}  // namespace

void FeatureLoops::add(const TracedLoop& loop, std::uint32_t rank, std::uint32_t centre,
                       const Float3& position) {
  if (first_of_cell_[rank] < 0) first_of_cell_[rank] = static_cast<std::int32_t>(loops_.size());
  FeatureLoop added;
  added.cell = loop.cell;
  added.number = static_cast<std::uint8_t>(loop.number);
  added.size = static_cast<std::uint8_t>(loop.size());
  added.first = static_cast<std::uint32_t>(corners_.size());
  added.centre = centre;
  added.position = position;
  for (std::size_t i = 0; i < loop.size(); ++i)
    corners_.push_back({.vertex = loop.vertex[i], .root = loop.root[i], .edge = loop.samples.edge[i]});
  loops_.push_back(added);
}

void FeatureLoops::add_kink(std::size_t segment, std::uint32_t vertex) {
  FeatureLoop::Corner& corner = corners_[loops_.back().first + segment];
  if (corner.kinks++ == 0) corner.first_kink = static_cast<std::uint32_t>(kinks_.size());
  kinks_.push_back(vertex);
}

FeatureLoop* FeatureLoops::find(const BrickBand& band, const Int3& cell, int edge) {
  const LeafMasks* m = band.at(cell[0] >> 3, cell[1] >> 3, cell[2] >> 3);
  if (!m) return nullptr;
  const int x = cell[0] & 7, y = cell[1] & 7, z = cell[2] & 7;
  if (!(m->active[static_cast<std::size_t>(z)] >> (x + 8 * y) & 1)) return nullptr;
  const std::int32_t first = first_of_cell_[m->cell_rank(x, y, z)];
  if (first < 0) return nullptr;
  for (auto f = static_cast<std::size_t>(first); f < loops_.size() && loops_[f].cell == cell; ++f)
    for (std::size_t s = 0; s < loops_[f].size; ++s)
      if (corner(loops_[f], s).edge == edge) return &loops_[f];
  return nullptr;
}

FeatureSample feature_of(const BrickInput& brick, TracedLoop& loop) {
  const std::vector<EdgeRoot>& roots = brick.field.roots;
  const std::vector<std::uint8_t>& creased = brick.field.creased;
  bool close = true;  // the common case, without copying anything
  for (std::size_t i = 1; i < loop.size(); ++i)
    close &= dot(roots[loop.root[0]].normal, roots[loop.root[i]].normal) > brick.thresholds.quick_dot;
  if (close) return {};
  if (!creased.empty() && std::none_of(loop.root.data(), loop.root.data() + loop.size(),
                                       [&](std::uint32_t r) { return creased[r] != 0; }))
    return {};
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const EdgeRoot& r = roots[loop.root[i]];
    loop.samples.normal[i] = r.normal;
    loop.samples.offset[i] = r.slides ? 0.0f : r.offset;
  }
  return sample_feature(loop.samples, brick.thresholds);
}

void emit_feature_segments(const BrickInput& brick, FeatureLoops& features, bool bends, PatchBuilder& patch,
                           ExtractReport& report) {
  for (FeatureLoop& loop : features.all())
    for (std::size_t s = 0; s < loop.size; ++s) emit_segment(brick, features, loop, s, bends, patch, report);
}

}  // namespace tessera
