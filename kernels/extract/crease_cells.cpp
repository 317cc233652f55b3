#include "kernels/extract/crease_cells.h"

#include <algorithm>
#include <cmath>

#include "kernels/extract/crease_faces.h"
#include "kernels/extract/loop_triangulation.h"
#include "kernels/field/edge_roots.h"
#include "kernels/mesh/face_contact.h"
#include "kernels/mesh/orientation_sign.h"

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
/// Of a segment: more are noise to the lattice, and vertices of an outline have numbers of a byte.
constexpr std::uint32_t kMostKinks = 16;

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

std::uint64_t name_of(const LoopKink& kink) {
  return static_cast<std::uint64_t>(kink.face) << 16 | kink.number;
}

/// Sides of an outline: corners c and d of two vertices.
template <class F>
void for_each_side(const PatchOutline& outline, const F& visit) {
  for (std::size_t c = 0; c < outline.corners.size(); ++c) {
    const std::size_t d = c + 1 == outline.corners.size() ? 0 : c + 1;
    if (outline.corners[c].vertex != outline.corners[d].vertex) visit(c, d);
  }
}

/// Faces that may come of a loop, whatever its feature: those along its creases; else the fan about its middle, to which a
/// feature may go back, and its triangulation.
/// \returns false where one has no area to speak of
bool collect_faces(const CreasedLoop& of, std::uint64_t number, std::vector<ContactFace>& faces) {
  const std::uint64_t base = number << 8;
  std::vector<Float3> at(of.vertices + of.faces.inner.size());
  for (const OutlineCorner& c : of.outline.corners) at[c.vertex] = c.at;
  const auto add = [&](std::size_t a, std::size_t b, std::size_t c) {
    if (is_sliver(at[a], at[b], at[c])) return false;
    faces.push_back({{wide(at[a]), wide(at[b]), wide(at[c])}, {base + a, base + b, base + c}});
    return !collinear(faces.back().corner[0], faces.back().corner[1], faces.back().corner[2]);
  };
  if (of.followed) {
    std::copy(of.faces.inner.begin(), of.faces.inner.end(),
              at.begin() + static_cast<std::ptrdiff_t>(of.vertices));
    return std::all_of(of.faces.triangles.begin(), of.faces.triangles.end(),
                       [&](const auto& t) { return add(t[0], t[1], t[2]); });
  }
  at.resize(of.vertices + 1);
  at[of.vertices] = mean_point(of.loop);
  bool sound = true;
  for_each_side(of.outline, [&](std::size_t c, std::size_t d) {
    sound = sound && add(of.outline.corners[c].vertex, of.outline.corners[d].vertex, of.vertices);
  });
  CreasePatch plain;
  if (sound && triangulate_patch(of.outline, of.vertices, plain))
    sound = std::all_of(plain.triangles.begin(), plain.triangles.end(),
                        [&](const auto& t) { return add(t[0], t[1], t[2]); });
  return sound;
}

/// Whether no faces of different loops of a cell meet, and all have an area.
bool are_apart(std::span<const CreasedLoop> loops) {
  std::vector<ContactFace> before, faces;
  for (std::size_t l = 0; l < loops.size(); ++l) {
    faces.clear();
    if (!collect_faces(loops[l], l, faces)) return false;
    for (const ContactFace& a : before)
      for (const ContactFace& b : faces)
        if (face_contact(a, b) != FaceContact::kNone) return false;
    before.insert(before.end(), faces.begin(), faces.end());
  }
  return true;
}

/// A segment of a loop in a face of its cell, from the lower lattice edge on, which is the same from both cells.
FaceChain chain_of(const CreasedLoop& of, std::size_t segment) {
  const TracedLoop& loop = of.loop;
  const std::size_t next = loop.after(segment);
  const int face = common_face(loop.samples.edge[segment], loop.samples.edge[next]), axis = face >> 1;
  const auto u = static_cast<std::size_t>((axis + 1) % 3), v = static_cast<std::size_t>((axis + 2) % 3);
  FaceChain chain;
  const auto add = [&](const Float3& at) {
    chain.push_back({static_cast<double>(at[u]), static_cast<double>(at[v])});
  };
  add(loop.samples.point[segment]);
  for (const LoopKink& kink : of.kinks.all)
    if (kink.segment == segment && kink.snapped == 0) add(kink.at);
  add(loop.samples.point[next]);
  int from = loop.samples.edge[segment], to = loop.samples.edge[next];
  if (face & 1) from = mirrored_edge(from, axis), to = mirrored_edge(to, axis);
  if (from > to) std::reverse(chain.begin(), chain.end());
  return chain;
}

/// Chains that cross each other or themselves in a face go, whichever cell looks.
void drop_unsound_faces(std::span<CreasedLoop> loops) {
  std::array<std::vector<FaceChain>, 6> chains;
  std::array<bool, 6> kinked{};
  for (const CreasedLoop& of : loops) {
    for (std::size_t i = 0; i < of.loop.size(); ++i) {
      const auto face = static_cast<std::size_t>(
          common_face(of.loop.samples.edge[i], of.loop.samples.edge[of.loop.after(i)]));
      chains[face].push_back(chain_of(of, i));
      kinked[face] = kinked[face] || chains[face].back().size() > 2;
    }
  }
  for (std::size_t face = 0; face < 6; ++face) kinked[face] = kinked[face] && !chains_are_sound(chains[face]);
  for (CreasedLoop& of : loops)
    std::erase_if(of.kinks.all, [&](const LoopKink& kink) {
      const std::uint8_t* edge = of.loop.samples.edge;
      return kinked[static_cast<std::size_t>(
          common_face(edge[kink.segment], edge[of.loop.after(kink.segment)]))];
    });
}

}  // namespace

bool CreaseCells::pass(const Int3& cell) const {
  return lines_ && lines_->passes(lines_->cell_number(
                       {corner_[0] + cell[0], corner_[1] + cell[1], corner_[2] + cell[2]}));
}

void CreaseCells::find_kinks(const BrickInput& brick, const TracedLoop& loop, LoopKinks& kinks) const {
  kinks.all.clear();
  const Int3 in_block = {corner_[0] + loop.cell[0], corner_[1] + loop.cell[1], corner_[2] + loop.cell[2]};
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
    if (!chain || chain->count > kMostKinks) continue;
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
      made.turned = turned;
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
}

std::uint32_t CreaseCells::vertex(const LoopKink& kink, PatchBuilder& patch) {
  const auto [found, is_new] = vertex_.emplace(name_of(kink), 0);
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

bool CreaseCells::follow(CreasedLoop& of) const {
  if (!of.kinks.agree) return false;
  const Int3& cell = of.loop.cell;
  const Int3 in_block = {corner_[0] + cell[0], corner_[1] + cell[1], corner_[2] + cell[2]};
  PatchOutline outline = of.outline;
  outline.clockwise = of.kinks.inverted;
  return add_links(*lines_, lines_->pieces_of(lines_->cell_number(in_block)), in_block, of.kinks, of.place,
                   outline) &&
         triangulate_patch(outline, of.vertices, of.faces);
}

void CreaseCells::settle(const BrickInput& brick, bool follow_them, std::span<CreasedLoop> loops) {
  bool any = false;
  for (CreasedLoop& of : loops) {
    find_kinks(brick, of.loop, of.kinks);
    of.kinked = !of.kinks.all.empty();
    of.followed = false;
    any = any || of.kinked;
  }
  if (!any) return;
  drop_unsound_faces(loops);
  bool all = true;
  for (CreasedLoop& of : loops) {
    of.outline = PatchOutline{};
    of.place.clear();
    of.vertices = make_outline(of.loop, of.kinks, of.outline, of.place);
    of.followed = follow_them && !of.kinks.all.empty() && follow(of);
    all = all && (of.followed || of.kinks.all.empty());
  }
  if ((all && loops.size() == 1) || are_apart(loops)) return;
  for (CreasedLoop& of : loops) straighten(of);
}

void CreaseCells::straighten(CreasedLoop& of) {
  of.followed = false;
  std::vector<LoopKink> left;
  for (std::size_t k = 0; k < of.kinks.all.size();) {
    const std::size_t i = of.kinks.all[k].segment;
    std::size_t last = k;
    while (last < of.kinks.all.size() && of.kinks.all[last].segment == i) ++last;
    Flap flap;
    for (std::size_t n = k; n < last; ++n)
      if (of.kinks.all[n].snapped == 0) flap.kinks.push_back(of.kinks.all[n]);
    if (!flap.kinks.empty()) {
      if (triangulate_flap(chain_of(of, i), flap.triangles)) {
        flap.root = {of.loop.vertex[i], of.loop.vertex[of.loop.after(i)]};
        if (flap.kinks.front().turned) {
          std::swap(flap.root[0], flap.root[1]);
          std::reverse(flap.kinks.begin(), flap.kinks.end());
        }
        flap.turned = of.kinks.all[k].turned;
        flap.name = name_of(flap.kinks.front());
        flaps_.push_back(std::move(flap));
      } else {
        left.insert(left.end(), of.kinks.all.begin() + static_cast<std::ptrdiff_t>(k),
                    of.kinks.all.begin() + static_cast<std::ptrdiff_t>(last));
      }
    }
    k = last;
  }
  of.kinks.all = std::move(left);
  of.outline = PatchOutline{};
  of.place.clear();
  of.vertices = make_outline(of.loop, of.kinks, of.outline, of.place);
}

void CreaseCells::close_flaps(PatchBuilder& patch) {
  std::stable_sort(flaps_.begin(), flaps_.end(),
                   [](const Flap& a, const Flap& b) { return a.name < b.name; });
  for (std::size_t i = 0; i < flaps_.size(); ++i) {
    if (i + 1 < flaps_.size() && flaps_[i + 1].name == flaps_[i].name) {
      ++i;  // neither cell has the kinks
      continue;
    }
    const Flap& flap = flaps_[i];
    if (!inside_brick(flap.kinks.front().above)) continue;
    std::vector<std::uint32_t> name = {flap.root[0]};
    for (const LoopKink& kink : flap.kinks) name.push_back(vertex(kink, patch));
    name.push_back(flap.root[1]);
    // The loop has the straight segment its way, so the flap has it the other way, and the chain as the loop runs.
    for (const auto& t : flap.triangles)
      patch.add_face(name[t[0]], name[t[flap.turned ? 2 : 1]], name[t[flap.turned ? 1 : 2]]);
  }
}

std::vector<std::uint32_t> CreaseCells::names_of(const CreasedLoop& of, PatchBuilder& patch) {
  std::vector<std::uint32_t> names(of.loop.vertex.begin(),
                                   of.loop.vertex.begin() + static_cast<std::ptrdiff_t>(of.loop.size()));
  for (const LoopKink& kink : of.kinks.all)
    if (kink.snapped == 0) names.push_back(vertex(kink, patch));
  return names;
}

void CreaseCells::emit(const BrickInput& brick, const CreasedLoop& of, PatchBuilder& patch) {
  std::vector<std::uint32_t> names = names_of(of, patch);
  const std::uint32_t colour = mean_colour(brick.field, of.loop);
  for (std::size_t i = 0; i < of.faces.inner.size(); ++i)
    names.push_back(patch.add_own({0, in_owner(of.loop.cell) + of.faces.inner[i], colour,
                                   of.faces.is_corner[i] ? VertexClass::kCorner : VertexClass::kCrease}));
  for (const auto& t : of.faces.triangles) patch.add_face(names[t[0]], names[t[1]], names[t[2]]);
}

void CreaseCells::fill(const BrickInput& brick, const CreasedLoop& of, PatchBuilder& patch) {
  const std::vector<std::uint32_t> names = names_of(of, patch);
  CreasePatch made;
  if (triangulate_patch(of.outline, of.vertices, made)) {
    for (const auto& t : made.triangles) patch.add_face(names[t[0]], names[t[1]], names[t[2]]);
    return;
  }
  const std::uint32_t centre = patch.add_centre(of.loop.cell, of.loop.number, mean_point(of.loop),
                                                mean_colour(brick.field, of.loop), VertexClass::kSmooth);
  for_each_side(of.outline, [&](std::size_t c, std::size_t d) {
    patch.add_face(names[of.outline.corners[c].vertex], names[of.outline.corners[d].vertex], centre);
  });
}

}  // namespace tessera
