#include "kernels/extract/border_shift.h"

#include <algorithm>

namespace tessera {
namespace {

/// Least area of a face, cells squared, or this share of what it had where that is less.
constexpr float kMinArea = 0.02f;
constexpr float kMinShare = 0.2f;
/// Shares of the way that are tried.
constexpr std::array<float, 4> kShares = {1.0f, 0.75f, 0.5f, 0.25f};

/// Loops of a cell whose corners have a value. \param cell  relative to the block
CellLoops loops_of_cell(const DirectedField& field, const Int3& cell) {
  unsigned pattern = 0;
  std::array<float, 8> value;
  for (int c = 0; c < 8; ++c) {
    const Int3 n = {cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)};
    const BandLeaf* leaf = field.leaf_at(n[0], n[1], n[2]);
    if (!leaf) return {};
    value[static_cast<std::size_t>(c)] = leaf->value(BandLeaf::node(n[0], n[1], n[2]));
    const auto word = static_cast<std::size_t>(DirectedField::word(n[2]));
    pattern |= static_cast<unsigned>(leaf->inside[word] >> DirectedField::bit(n[0], n[1]) & 1) << c;
  }
  return ambiguous_faces(pattern) ? trace_loops(pattern, joined_faces(pattern, value))
                                  : unambiguous_loops(pattern);
}

}  // namespace

Float3 BorderShift::gone(const Corner& c, float share) {
  return {c.point[0] + share * c.shift[0], c.point[1] + share * c.shift[1], c.point[2] + share * c.shift[2]};
}

/// Least signed area of a face whose corners go any part of `share`: it is affine in each corner's way alone, so it is
/// least where each has gone nowhere or all of it.
float BorderShift::min_area(const std::array<Corner, 3>& corners, float share, const Float3& normal) {
  float minimum = 1e30f;
  for (unsigned moved = 0; moved < 8; ++moved) {
    const Float3 n = triangle_normal(gone(corners[0], moved & 1 ? share : 0.0f),
                                     gone(corners[1], moved & 2 ? share : 0.0f),
                                     gone(corners[2], moved & 4 ? share : 0.0f));
    minimum = std::min(minimum, 0.5f * dot(n, normal));
  }
  return minimum;
}

float BorderShift::share_of_face(const std::array<Corner, 3>& corners, const Float3& normal) {
  const float before = min_area(corners, 0.0f, normal);
  if (before <= 0.0f) return 0.0f;  // it leans over already
  const float limit = std::min(kMinArea, kMinShare * before);
  for (const float share : kShares)
    if (min_area(corners, share, normal) >= limit) return share;
  return 0.0f;
}

Float3 BorderShift::wanted(std::uint32_t root) const {
  const auto found = std::lower_bound(field_.moves.begin(), field_.moves.end(), root,
                                      [](const BorderMove& m, std::uint32_t r) { return m.root < r; });
  return found != field_.moves.end() && found->root == root ? found->by : Float3{0, 0, 0};
}

bool BorderShift::triangulate(const std::uint8_t* edge, const std::uint32_t* root, std::size_t size,
                              LoopTriangles& out) {
  bool moves = false;
  normal_ = {0, 0, 0};
  LoopSamples samples;
  samples.size = static_cast<int>(size);
  samples.edge = edge;
  for (std::size_t i = 0; i < size; ++i) {
    Corner& corner = corners_[i];
    corner.point = point_in_cell(edge[i], field_.roots[root[i]]);
    corner.shift = wanted(root[i]);
    moves = moves || corner.shift != Float3{0, 0, 0};
    samples.point[i] = gone(corner, 1.0f);
    for (std::size_t a = 0; a < 3; ++a) normal_[a] += field_.roots[root[i]].normal[a];
  }
  if (!moves) return false;
  const float length = norm(normal_);
  for (float& c : normal_) c = length > 0.0f ? c / length : 0.0f;
  triangulate_border_loop(samples, normal_, out);
  return true;
}

void BorderShift::triangulate_crossing(const Int3& cell, const std::uint8_t* edge, const std::uint32_t* root,
                                       std::size_t size, LoopTriangles& triangles) {
  // A face leans over where its corners lie only if it did before any moved (share_of_face). Where none does, faces lie
  // side by side as seen along the normal.
  bool leans = false;
  for (std::size_t i = 0; i < static_cast<std::size_t>(triangles.count); ++i) {
    const auto& t = triangles.triangle[i];
    leans = leans || !(min_area({corners_[t[0]], corners_[t[1]], corners_[t[2]]}, 0.0f, normal_) > 0.0f);
  }
  if (!leans) return;
  LoopSamples samples;
  samples.size = static_cast<int>(size);
  samples.edge = edge;
  Float3 centre = {0, 0, 0};
  for (std::size_t i = 0; i < size; ++i) {
    samples.point[i] = corners_[i].point;
    centre = centre + corners_[i].point;
  }
  for (float& c : centre) c /= static_cast<float>(size);
  for (std::size_t i = 0; i < size; ++i) {
    const int e = edge[i];
    const Int3 node = {cell[0] + edge_offset(e, 0), cell[1] + edge_offset(e, 1), cell[2] + edge_offset(e, 2)};
    samples.point[i] = samples.point[i] + of_vertex(node, static_cast<std::size_t>(e >> 2), root[i]);
  }
  if (!loop_crosses_itself(samples, triangles, centre)) return;
  LoopTriangles other;
  triangulate_loop(samples, other);
  if (loop_crosses_itself(samples, other, centre)) other.count = 0;  // a fan
  if (!loop_crosses_itself(samples, other, centre)) triangles = other;
}

Float3 BorderShift::of_vertex(const Int3& node, std::size_t axis, std::uint32_t root) {
  Float3 shift = wanted(root);
  if (shift == Float3{0, 0, 0}) return shift;
  const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
  float share = 1.0f;
  for (unsigned side = 0; side < 4; ++side) {
    Int3 cell = node;
    cell[u] -= static_cast<int>(side & 1);
    cell[v] -= static_cast<int>(side >> 1);
    if (!band_.takes_part(cell)) continue;
    share = std::min(share, share_in_cell(cell, static_cast<std::uint8_t>(4 * axis + side)));
  }
  for (float& c : shift) c *= share;
  return shift;
}

/// Share of its way that the vertex on an edge of a cell may go.
float BorderShift::share_in_cell(const Int3& cell, std::uint8_t edge) {
  const Int3 at = {corner_[0] + cell[0], corner_[1] + cell[1], corner_[2] + cell[2]};
  const CellLoops loops = loops_of_cell(field_, at);
  std::size_t first = 0;
  for (std::size_t number = 0; number < loops.count; ++number) {
    const std::size_t size = loops.length[number];
    const std::uint8_t* edges = &loops.edge[first];
    first += size;
    const auto mine = static_cast<std::size_t>(std::find(edges, edges + size, edge) - edges);
    if (mine == size) continue;
    std::array<std::uint32_t, kCellEdges> root;
    for (std::size_t i = 0; i < size; ++i) {
      const int e = edges[i];
      const EdgeRoot* found = field_.root_at(at[0] + edge_offset(e, 0), at[1] + edge_offset(e, 1),
                                             at[2] + edge_offset(e, 2), e >> 2);
      if (!found) return 0.0f;
      root[i] = static_cast<std::uint32_t>(found - field_.roots.data());
    }
    LoopTriangles triangles;
    if (!triangulate(edges, root.data(), size, triangles)) return 1.0f;
    float share = triangles.count > 0 ? 1.0f : 0.0f;
    for (std::size_t i = 0; i < static_cast<std::size_t>(triangles.count); ++i) {
      const auto& t = triangles.triangle[i];
      if (t[0] != mine && t[1] != mine && t[2] != mine) continue;
      share = std::min(share, share_of_face({corners_[t[0]], corners_[t[1]], corners_[t[2]]}, normal_));
    }
    return share;
  }
  return 1.0f;
}

}  // namespace tessera
