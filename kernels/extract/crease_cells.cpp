#include "kernels/extract/crease_cells.h"

#include <algorithm>
#include <cmath>

#include "kernels/extract/crease_patch.h"
#include "kernels/field/edge_roots.h"

namespace tessera {
namespace {

/// A kink nearer than this to a root gives way to its vertex, in cells.
constexpr float kSnap = 1.0f / 96;
/// Beside a root that was moved off a node kinks must be farther away: nearer ones may lie behind its vertex, as where faces of
/// a solid lie in planes of the lattice.
constexpr float kBesideMoved = 1.0f / 32;
/// Sections of the mesh end in the very roots of the field: as they were rounded, with the same normals.
constexpr float kSameRoot = 1e-6f;
constexpr float kSameNormal = 0.999f;
/// A face between bricks has so many names for kinks (patch.h).
constexpr std::uint32_t kNamedKinks = 2;

/// Whether a section ends in a root. \param sign  +1 or -1: its normal against the root's
bool ends_in(const CreaseChain& chain, std::size_t end, const EdgeRoot& root, int& sign) {
  if (std::fabs(std::clamp(chain.t[end], kRootMargin, 1.0f - kRootMargin) - root.t) > kSameRoot) return false;
  const float cosine = dot(chain.normal[end], root.normal);
  sign = cosine > 0.0f ? 1 : -1;
  return std::fabs(cosine) > kSameNormal;
}

std::uint8_t faces_of_edge(int edge) {
  const int along = edge >> 2, u = (along + 1) % 3, v = (along + 2) % 3;
  return static_cast<std::uint8_t>(1 << (2 * u + edge_offset(edge, u)) | 1 << (2 * v + edge_offset(edge, v)));
}

/// The loop with its kinks.
/// \param place  per kink: its corner
/// \returns the number of vertices: roots, then kinks that are not snapped
std::size_t make_outline(const TracedLoop& loop, const LoopKinks& kinks, PatchOutline& outline,
                         std::vector<std::uint16_t>& place) {
  std::size_t vertices = loop.size();
  std::size_t next = 0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    outline.corners.push_back(
        {loop.samples.point[i], static_cast<std::uint8_t>(i), faces_of_edge(loop.samples.edge[i])});
    const int face = common_face(loop.samples.edge[i], loop.samples.edge[loop.after(i)]);
    for (; next < kinks.all.size() && kinks.all[next].segment == i; ++next) {
      const LoopKink& kink = kinks.all[next];
      place.push_back(static_cast<std::uint16_t>(outline.corners.size()));
      if (kink.snapped == 0) {
        outline.corners.push_back(
            {kink.at, static_cast<std::uint8_t>(vertices++), static_cast<std::uint8_t>(1 << face)});
        continue;
      }
      const std::size_t root = kink.snapped < 0 ? i : loop.after(i);
      outline.corners.push_back({loop.samples.point[root], static_cast<std::uint8_t>(root),
                                 faces_of_edge(loop.samples.edge[root])});
    }
  }
  return vertices;
}

/// Adds the pieces of the cell that hang together with the loop's kinks. \returns false where some pass its cell elsewhere too
bool add_links(const CreaseLines& lines, std::span<const CreasePiece> pieces, const Int3& cell,
               const LoopKinks& kinks, const std::vector<std::uint16_t>& place, PatchOutline& outline) {
  std::vector<std::uint8_t> joined(pieces.size(), 0);
  std::vector<std::uint32_t> vertex;  // of the mesh, reached so far
  const auto corner_of = [&](std::uint32_t crossing) {
    for (std::size_t k = 0; k < kinks.all.size(); ++k)
      if (kinks.all[k].crossing == crossing) return static_cast<std::int32_t>(place[k]);
    return std::int32_t{-1};
  };
  const auto reached = [&](std::uint32_t end) {
    if ((end & kCreaseVertex) == 0) return corner_of(end) >= 0;
    return std::find(vertex.begin(), vertex.end(), end) != vertex.end();
  };
  const auto reach = [&](std::uint32_t end) {
    if ((end & kCreaseVertex) == 0) return corner_of(end) >= 0;
    if (!reached(end)) vertex.push_back(end);
    return true;
  };
  for (bool more = true; more;) {
    more = false;
    for (std::size_t p = 0; p < pieces.size(); ++p) {
      if (joined[p] || (!reached(pieces[p].end[0]) && !reached(pieces[p].end[1]))) continue;
      joined[p] = 1;
      more = true;
      if (!reach(pieces[p].end[0]) || !reach(pieces[p].end[1])) return false;
    }
  }
  for (const std::uint32_t v : vertex) {
    Double3 at = lines.vertices[v & ~kCreaseVertex];
    for (std::size_t k = 0; k < 3; ++k) at[k] -= cell[k];
    outline.inner.push_back(narrow(at));
  }
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    if (!joined[p]) continue;
    CreaseLink link;
    for (std::size_t e = 0; e < 2; ++e) {
      const std::uint32_t end = pieces[p].end[e];
      link.rank[e] = pieces[p].rank[e];
      link.end[e] =
          (end & kCreaseVertex) == 0
              ? static_cast<std::uint16_t>(corner_of(end))
              : static_cast<std::uint16_t>(
                    outline.corners.size() +
                    static_cast<std::size_t>(std::find(vertex.begin(), vertex.end(), end) - vertex.begin()));
    }
    outline.links.push_back(link);
  }
  return true;
}

}  // namespace

bool CreaseCells::find_kinks(const BrickInput& brick, const TracedLoop& loop, LoopKinks& kinks) const {
  kinks.all.clear();
  if (!lines_) return false;
  const Int3 in_block = {corner_[0] + loop.cell[0], corner_[1] + loop.cell[1], corner_[2] + loop.cell[2]};
  if (!lines_->passes(lines_->cell_number(in_block))) return false;
  kinks.agree = true;
  int sign = 0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const std::size_t j = loop.after(i);
    int from = loop.samples.edge[i], to = loop.samples.edge[j];
    const int face = common_face(from, to), axis = face >> 1;
    const auto a = static_cast<std::size_t>(axis);
    Int3 above = loop.cell, above_in_block = in_block;
    if (face & 1) {
      ++above[a];
      ++above_in_block[a];
      from = mirrored_edge(from, axis);
      to = mirrored_edge(to, axis);
    }
    const auto number = 3 * lines_->cell_number(above_in_block) + static_cast<std::uint32_t>(axis);
    const std::span<const CreaseChain> chains = lines_->chains_of(number);
    if (chains.empty()) continue;
    if ((above[a] & (kBrickCells - 1)) == 0 && chains.back().number + chains.back().count > kNamedKinks)
      continue;
    const bool turned = from > to;
    const std::array<int, 2> ends = {std::min(from, to), std::max(from, to)};
    const CreaseChain* chain = nullptr;
    for (const CreaseChain& c : chains)
      if (c.edge[0] == ends[0] && c.edge[1] == ends[1]) chain = &c;
    if (!chain) continue;
    const EdgeRoot &first = brick.field.roots[loop.root[turned ? j : i]],
                   &last = brick.field.roots[loop.root[turned ? i : j]];
    int at_first = 0, at_last = 0;
    if (!ends_in(*chain, 0, first, at_first) || !ends_in(*chain, 1, last, at_last) || at_first != at_last)
      continue;
    kinks.agree = kinks.agree && (sign == 0 || sign == at_first);
    sign = at_first;
    const std::size_t before = kinks.all.size();
    for (std::uint32_t n = 0; n < chain->count; ++n) {
      const std::uint32_t k = turned ? chain->count - 1 - n : n;
      const CreaseKink& kink = lines_->kinks[chain->first + k];
      LoopKink& made = kinks.all.emplace_back();
      made.segment = i;
      made.crossing = kink.crossing;
      made.face = number;
      made.number = chain->number + k;
      made.above = above;
      made.at = kink.at;
      if (face & 1) made.at[a] += 1.0f;
    }
    // Across the face alone: there both of its cells have the same numbers.
    const auto near = [&](const LoopKink& kink, std::size_t root, float distance) {
      Float3 d = kink.at - loop.samples.point[root];
      d[a] = 0.0f;
      return dot(d, d) < distance * distance;
    };
    const auto beside_moved = [&](const LoopKink& kink, std::size_t root) {
      return brick.field.roots[loop.root[root]].offset != 0.0f && near(kink, root, kBesideMoved);
    };
    if (std::any_of(kinks.all.begin() + static_cast<std::ptrdiff_t>(before), kinks.all.end(),
                    [&](const LoopKink& kink) { return beside_moved(kink, i) || beside_moved(kink, j); })) {
      kinks.all.resize(before);
      continue;
    }
    std::size_t low = before, high = kinks.all.size();
    for (; low < high && near(kinks.all[low], i, kSnap); ++low) kinks.all[low].snapped = -1;
    for (; high > low && near(kinks.all[high - 1], j, kSnap); --high) kinks.all[high - 1].snapped = 1;
  }
  kinks.inverted = sign < 0;
  return !kinks.all.empty();
}

std::uint32_t CreaseCells::vertex(const LoopKink& kink, PatchBuilder& patch) {
  const std::uint64_t name = static_cast<std::uint64_t>(kink.face) << 16 | kink.number;
  const auto [found, is_new] = vertex_.emplace(name, 0);
  if (!is_new) return found->second;
  const std::size_t axis = kink.face % 3;
  const int type = kFirstKinkType + static_cast<int>(kNamedKinks * axis + kink.number);
  // On the face of its own cell the coordinate is 0, whichever cell sees it.
  Float3 at = kink.at;
  at[axis] = 0.0f;
  BrickVertex made{0, in_owner(kink.above) + at, 0, VertexClass::kCrease};
  if (!inside_brick(kink.above)) {
    made.key = patch.key(kink.above, type);
    return found->second = patch.add_foreign(made);
  }
  found->second = patch.add_own(made);
  if (kink.above[axis] == 0) patch.add_exported(patch.key(kink.above, type), found->second);
  return found->second;
}

bool CreaseCells::follow(const BrickInput& brick, const TracedLoop& loop, const LoopKinks& kinks,
                         PatchBuilder& patch) {
  if (!kinks.agree) return false;
  const Int3 in_block = {corner_[0] + loop.cell[0], corner_[1] + loop.cell[1], corner_[2] + loop.cell[2]};
  PatchOutline outline;
  std::vector<std::uint16_t> place;
  const std::size_t vertices = make_outline(loop, kinks, outline, place);
  outline.clockwise = kinks.inverted;
  if (!add_links(*lines_, lines_->pieces_of(lines_->cell_number(in_block)), in_block, kinks, place, outline))
    return false;
  CreasePatch made;
  if (!triangulate_patch(outline, vertices, made)) return false;
  if (!inside_brick(loop.cell)) return true;
  std::vector<std::uint32_t> names(loop.vertex.begin(),
                                   loop.vertex.begin() + static_cast<std::ptrdiff_t>(loop.size()));
  for (const LoopKink& kink : kinks.all)
    if (kink.snapped == 0) names.push_back(vertex(kink, patch));
  const std::uint32_t colour = mean_colour(brick.field, loop);
  for (std::size_t i = 0; i < made.inner.size(); ++i)
    names.push_back(patch.add_own({0, in_owner(loop.cell) + made.inner[i], colour,
                                   made.is_corner[i] ? VertexClass::kCorner : VertexClass::kCrease}));
  for (const auto& t : made.triangles) patch.add_face(names[t[0]], names[t[1]], names[t[2]]);
  return true;
}

void CreaseCells::fill(const BrickInput& brick, const TracedLoop& loop, const LoopKinks& kinks,
                       PatchBuilder& patch) {
  PatchOutline outline;
  std::vector<std::uint16_t> place;
  const std::size_t vertices = make_outline(loop, kinks, outline, place);
  std::vector<std::uint32_t> names(loop.vertex.begin(),
                                   loop.vertex.begin() + static_cast<std::ptrdiff_t>(loop.size()));
  for (const LoopKink& kink : kinks.all)
    if (kink.snapped == 0) names.push_back(vertex(kink, patch));
  CreasePatch made;
  if (triangulate_patch(outline, vertices, made)) {
    for (const auto& t : made.triangles) patch.add_face(names[t[0]], names[t[1]], names[t[2]]);
    return;
  }
  const std::uint32_t centre = patch.add_centre(loop.cell, loop.number, mean_point(loop),
                                                mean_colour(brick.field, loop), VertexClass::kSmooth);
  for (std::size_t c = 0; c < outline.corners.size(); ++c) {
    const std::uint32_t a = names[outline.corners[c].vertex],
                        b = names[outline.corners[c + 1 == outline.corners.size() ? 0 : c + 1].vertex];
    if (a != b) patch.add_face(a, b, centre);
  }
}

}  // namespace tessera
