#include "kernels/remesh/reference_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/decimate/feature_edges.h"
#include "kernels/mesh/triangle_foot.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

/// Edges of the reference: a shorter crease that ends somewhere is noise.
constexpr std::size_t kMinSegments = 3;
/// Cosines: a line that bends by more is cut there. Borders of scans waver, so they get more.
constexpr double kStraightCrease = 0.70710678118654752, kStraightBorder = 0.5;
constexpr double kStrongCrease = 0.70710678118654752;  ///< cosine of its turn: noise seldom turns by more
/// Of the shortest line of its own: one that runs on for so long bears an edge that is no needle.
constexpr double kLongLine = 0.2;
constexpr std::ptrdiff_t kCornerCreases = 3;

Double3 closest_on_segment(const Double3& p, const Double3& a, const Double3& b) {
  const Double3 d = b - a;
  const double square = dot(d, d);
  if (!(square > 0.0)) return a;
  const double t = dot(p - a, d) / square;
  return t <= 0.0 ? a : t >= 1.0 ? b : a + d * t;
}

bool is_strong_crease(const CollapseMesh& mesh, std::uint32_t f, std::uint32_t g) {
  const auto normal = [&](std::uint32_t face) {
    const std::uint32_t* v = mesh.face(face).vertex;
    return triangle_normal(mesh.at(v[0]), mesh.at(v[1]), mesh.at(v[2]));
  };
  const Double3 m = normal(f), n = normal(g);
  return dot(m, n) < kStrongCrease * norm(m) * norm(n);
}

}  // namespace

ReferenceSurface::ReferenceSurface(const MeshBlock& reference, const Double3& origin,
                                   double feature_angle_deg, double min_line, const SizingOptions& sizing)
    : reference_(&reference), class_(reference.position.size(), VertexClass::kSmooth) {
  {
    CollapseMesh mesh(reference, origin);
    copy_mesh(mesh);
    find_lines(mesh, feature_angle_deg, min_line);
  }
  join_segments();
  find_lasting_corners(min_line);
  size(sizing);
  faces_ = ClosestFaces(at_, face_, Double3{});
  slot_.resize(face_.size());
  for (std::uint32_t slot = 0; slot < faces_.size(); ++slot) slot_[faces_.face(slot)] = slot;
}

void ReferenceSurface::copy_mesh(const CollapseMesh& mesh) {
  at_.reserve(mesh.vertices()), number_.reserve(mesh.vertices());
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) {
    at_.push_back(mesh.at(v));
    number_.push_back(mesh.block_vertex(v));
  }
  face_.reserve(mesh.faces().size());
  for (const CollapseFace& f : mesh.faces()) face_.push_back({f.vertex[0], f.vertex[1], f.vertex[2]});
}

/// Normals, neighbours, creases and borders.
void ReferenceSurface::find_lines(CollapseMesh& mesh, double feature_angle_deg, double min_line) {
  std::vector<std::uint32_t> same(mesh.vertices());
  std::iota(same.begin(), same.end(), 0u);
  mark_features(mesh, *reference_, sharp_vertices(mesh, feature_angle_deg), same, feature_angle_deg);

  normal_.resize(face_.size());
  adjacent_.resize(face_.size());
  std::vector<std::array<std::uint32_t, 2>> borders, strong;
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) {
    Double3 sum{};
    const auto add = [&](std::uint32_t g) {
      const std::uint32_t* v = mesh.face(g).vertex;
      sum = sum + triangle_normal(mesh.at(v[0]), mesh.at(v[1]), mesh.at(v[2]));
    };
    add(f);
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t c = 4 * f + i, o = mesh.opposite(c);
      if (o != kNoCorner && !mesh.crease_edge(c)) add(o >> 2);
      const bool border = o == kNoCorner && mesh.border_edge(c);
      if (!border && !(mesh.crease_edge(c) && o != kNoCorner && o > c)) continue;
      const std::uint32_t a = mesh.vertex(next_corner(c)), b = mesh.vertex(prev_corner(c));
      (border ? borders : creases_).push_back({std::min(a, b), std::max(a, b)});
      if (!border && is_strong_crease(mesh, f, o >> 2)) strong.push_back(creases_.back());
    }
    normal_[f] = narrow(unit_or_zero(sum));
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t o = mesh.opposite(4 * f + i);
      adjacent_[f][i] = o == kNoCorner || mesh.crease_edge(4 * f + i) ? kNone : o >> 2;
    }
  }
  std::sort(creases_.begin(), creases_.end());
  std::sort(borders.begin(), borders.end());
  std::sort(strong.begin(), strong.end());
  // Where this part of the reference ends, lines go on.
  std::vector<std::uint8_t> goes_on(at_.size());
  for (std::uint32_t v = 0; v < at_.size(); ++v) goes_on[v] = (mesh.state(v) & kVertexLocked) != 0;
  prune_twigs(min_line, goes_on);
  prune_islands(2.0 * min_line, goes_on);
  for (const auto* lines : {&creases_, &borders})
    for (const auto& line : *lines) {
      const bool crease = lines == &creases_;
      segments_.push_back(
          {line, {kNone, kNone}, crease, !crease || std::binary_search(strong.begin(), strong.end(), line)});
    }
  for (const auto& line : creases_)
    for (const std::uint32_t v : line) class_[v] = VertexClass::kCrease;
}

/// Twigs: what leads from the end of a crease to the next corner. Noise leaves many, too short to shape a face.
void ReferenceSurface::prune_twigs(double min_line, const std::vector<std::uint8_t>& goes_on) {
  constexpr int kRounds = 2;  // a twig may bear twigs
  for (int round = 0; round < kRounds && !creases_.empty(); ++round) {
    struct End {
      std::uint32_t vertex, crease;
    };
    std::vector<End> ends;
    for (std::uint32_t e = 0; e < creases_.size(); ++e)
      for (const std::uint32_t v : creases_[e]) ends.push_back({v, e});
    std::sort(ends.begin(), ends.end(), [](const End& a, const End& b) {
      return a.vertex != b.vertex ? a.vertex < b.vertex : a.crease < b.crease;
    });
    const auto of = [&](std::uint32_t v) {
      return std::equal_range(ends.begin(), ends.end(), End{v, 0},
                              [](const End& a, const End& b) { return a.vertex < b.vertex; });
    };
    std::vector<std::uint8_t> gone(creases_.size(), 0);
    for (const End& first : ends) {
      const auto around = of(first.vertex);
      if (around.second - around.first != 1 || goes_on[first.vertex]) continue;
      std::vector<std::uint32_t> twig;
      double length = 0.0;
      std::uint32_t v = first.vertex, crease = first.crease;
      bool ended = true;
      while (length < min_line || twig.size() < kMinSegments) {
        twig.push_back(crease);
        const std::uint32_t w = creases_[crease][creases_[crease][0] == v ? 1 : 0];
        length += norm(at(w) - at(v));
        const auto next = of(w);
        ended = !goes_on[w];
        if (next.second - next.first != 2) break;
        crease = next.first->crease == crease ? (next.first + 1)->crease : next.first->crease;
        v = w;
      }
      if (ended && (length < min_line || twig.size() < kMinSegments))
        for (const std::uint32_t e : twig) gone[e] = 1;
    }
    std::size_t kept = 0;
    for (std::size_t e = 0; e < gone.size(); ++e)
      if (!gone[e]) creases_[kept++] = creases_[e];
    if (kept == creases_.size()) return;
    creases_.resize(kept);
  }
}

void ReferenceSurface::prune_islands(double min_sum, const std::vector<std::uint8_t>& goes_on) {
  DisjointSets<std::uint32_t> parts(at_.size());
  for (const auto& e : creases_) parts.unite(e[0], e[1]);
  std::vector<double> length(at_.size(), 0.0);
  for (const auto& e : creases_) length[parts.find(e[0])] += norm(at(e[1]) - at(e[0]));
  for (const auto& e : creases_)
    for (const std::uint32_t v : e)
      if (goes_on[v]) length[parts.find(v)] = min_sum;
  std::erase_if(creases_, [&](const auto& e) { return length[parts.find(e[0])] < min_sum; });
}

void ReferenceSurface::join_segments() {
  if (segments_.empty()) return;
  struct End {
    std::uint32_t vertex, segment, side;
  };
  std::vector<End> ends;
  for (std::uint32_t s = 0; s < segments_.size(); ++s)
    for (std::uint32_t side = 0; side < 2; ++side) ends.push_back({segments_[s].vertex[side], s, side});
  std::sort(ends.begin(), ends.end(), [](const End& a, const End& b) {
    return a.vertex != b.vertex ? a.vertex < b.vertex : a.segment < b.segment;
  });
  for (std::size_t i = 0; i < ends.size();) {
    std::size_t end = i + 1;
    while (end < ends.size() && ends[end].vertex == ends[i].vertex) ++end;
    const std::uint32_t v = ends[i].vertex;
    if (end - i == 2) {
      const End &x = ends[i], &y = ends[i + 1];
      const Double3 in = at(v) - at(segments_[x.segment].vertex[1 - x.side]),
                    out = at(segments_[y.segment].vertex[1 - y.side]) - at(v);
      const bool crease = segments_[x.segment].crease;
      const double minimum = crease ? kStraightCrease : kStraightBorder, along = dot(in, out);
      if (crease == segments_[y.segment].crease && along > 0.0 &&
          along * along > minimum * minimum * dot(in, in) * dot(out, out)) {
        segments_[x.segment].beyond[x.side] = y.segment;
        segments_[y.segment].beyond[y.side] = x.segment;
      } else {
        class_[v] = VertexClass::kCorner;
      }
    } else {
      class_[v] = VertexClass::kCorner;
    }
    i = end;
  }
  std::vector<std::array<std::uint32_t, 3>> flat;
  flat.reserve(segments_.size());
  for (const Segment& s : segments_) flat.push_back({s.vertex[0], s.vertex[1], s.vertex[1]});
  lines_ = ClosestFaces(at_, flat, Double3{});
}

/// How far a line runs from a corner to the next, as far as that is of interest.
double ReferenceSurface::length_from(std::uint32_t vertex, std::uint32_t segment, double enough) const {
  double length = 0.0;
  for (std::uint32_t s = segment; length < enough;) {
    const Segment& here = segments_[s];
    const std::size_t side = here.vertex[0] == vertex ? 1 : 0;
    length += norm(at(here.vertex[1]) - at(here.vertex[0]));
    vertex = here.vertex[side];
    s = here.beyond[side];
    if (s == kNone || s == segment) break;
  }
  return length;
}

void ReferenceSurface::find_lasting_corners(double min_line) {
  lasting_.assign(at_.size(), 0);
  struct End {
    std::uint32_t vertex, segment;
  };
  std::vector<End> ends;
  for (std::uint32_t s = 0; s < segments_.size(); ++s)
    for (const std::uint32_t v : segments_[s].vertex)
      if (class_[v] == VertexClass::kCorner && segments_[s].strong) ends.push_back({v, s});
  std::stable_sort(ends.begin(), ends.end(), [](const End& a, const End& b) { return a.vertex < b.vertex; });
  const auto away = [&](const End& e) {
    const auto& [a, b] = segments_[e.segment].vertex;
    return at(a == e.vertex ? b : a) - at(e.vertex);
  };
  const auto curvatures = [&](const End& a, const End& b) {
    const Double3 u = away(a), v = away(b);
    const bool borders = !segments_[a.segment].crease && !segments_[b.segment].crease;
    return dot(u, v) > -(borders ? kStraightBorder : kStraightCrease) * norm(u) * norm(v);
  };
  const double enough = kLongLine * min_line;
  for (auto first = ends.begin(); first != ends.end();) {
    const auto last =
        std::find_if(first, ends.end(), [&](const End& e) { return e.vertex != first->vertex; });
    // Two lines: a corner where they bend, and not where others that are weak meet them.
    const bool corner =
        last - first >= kCornerCreases || (last - first == 2 && curvatures(*first, *(first + 1)));
    if (corner && std::any_of(first, last, [&](const End& e) {
          return length_from(e.vertex, e.segment, enough) >= enough;
        }))
      lasting_[first->vertex] = 1;
    first = last;
  }
}

/// Along a line from a vertex, into the segment, as far as `left`.
void ReferenceSurface::walk_line(std::uint32_t vertex, std::uint32_t segment, double left,
                                 std::vector<Double3>& part) const {
  for (std::uint32_t s = segment; s != kNone && left > 0.0;) {
    const Segment& here = segments_[s];
    const std::size_t end = here.vertex[0] == vertex ? 1 : 0;
    const Double3 &from = at(vertex), &to = at(here.vertex[end]);
    const double run = norm(to - from);
    part.push_back(run <= left ? to : from + (to - from) * (left / run));
    left -= run;
    vertex = here.vertex[end];
    s = here.beyond[end];
    if (s == segment) break;
  }
}

/// The longest edge around an end of a segment whose chord keeps to the line.
float ReferenceSurface::chord_length(std::uint32_t segment, std::size_t side,
                                     const SizingOptions& sizing) const {
  constexpr double kStep = 0.8, kLongestEdge = 4.0 / 3.0;  // an edge is as long before it is split
  const double shortest = kShortestOnLine * sizing.longest,
               square = sizing.line_tolerance * sizing.line_tolerance;
  const Segment& here = segments_[segment];
  const std::uint32_t v = here.vertex[side];
  std::vector<Double3> part;
  double length = sizing.longest;
  for (; length > shortest; length *= kStep) {
    const double half = 0.5 * kLongestEdge * length;
    part.assign(1, at(v));
    walk_line(v, here.beyond[side], half, part);
    std::reverse(part.begin(), part.end());
    walk_line(v, segment, half, part);
    const bool keeps = std::all_of(part.begin(), part.end(), [&](const Double3& p) {
      return squared_distance(p, closest_on_segment(p, part.front(), part.back())) <= square;
    });
    if (keeps) break;
  }
  return static_cast<float>(std::max(length, shortest));
}

/// Per vertex of the reference the length of edges that its crease allows; empty where none asks for less than the longest.
std::vector<float> ReferenceSurface::chords(const SizingOptions& sizing) const {
  std::vector<float> out;
  if (!(sizing.line_tolerance > 0.0)) return out;
  const auto longest = static_cast<float>(sizing.longest);
  for (std::uint32_t s = 0; s < segments_.size(); ++s)
    for (std::size_t side = 0; side < 2; ++side) {
      const Segment& here = segments_[s];
      if (!here.crease || here.beyond[side] == kNone || here.beyond[side] < s) continue;
      const float length = chord_length(s, side, sizing);
      if (!(length < longest)) continue;
      if (out.empty()) out.assign(at_.size(), longest);
      out[number_[here.vertex[side]]] = length;
    }
  return out;
}

void ReferenceSurface::size(const SizingOptions& sizing) {
  std::vector<std::uint8_t> on_line(at_.size(), 0);
  std::vector<std::array<std::uint32_t, 3>> lines;
  for (std::uint32_t s = 0; s < segments_.size(); ++s)
    for (std::size_t side = 0; side < 2; ++side) {
      const Segment& here = segments_[s];
      on_line[number_[here.vertex[side]]] = 1;
      if (here.beyond[side] == kNone || here.beyond[side] < s) continue;
      const Segment& next = segments_[here.beyond[side]];
      const std::uint32_t v = here.vertex[side];
      lines.push_back(
          {number_[here.vertex[1 - side]], number_[v], number_[next.vertex[next.vertex[0] == v ? 1 : 0]]});
    }
  const std::vector<float> at_lines = chords(sizing),
                           length = sizing_field(*reference_, on_line, lines, at_lines, sizing);
  graded_ = sizing.tolerance > 0.0 || !at_lines.empty();
  for (const std::uint32_t v : number_) length_.push_back(length[v]);
}

float ReferenceSurface::length_in_face(std::uint32_t face, const Double3& p) const {
  const auto& f = face_[face];
  const Double3 a = at(f[0]), b = at(f[1]), c = at(f[2]), n = triangle_normal(a, b, c);
  const double square = dot(n, n);
  if (!(square > 0.0)) return length_[f[0]];
  const double wb = std::clamp(dot(cross(c - p, a - p), n) / square, 0.0, 1.0),
               wc = std::clamp(dot(cross(a - p, b - p), n) / square, 0.0, 1.0 - wb);
  return static_cast<float>((1.0 - wb - wc) * static_cast<double>(length_[f[0]]) +
                            wb * static_cast<double>(length_[f[1]]) +
                            wc * static_cast<double>(length_[f[2]]));
}

float ReferenceSurface::length_on_line(std::uint32_t segment, const Double3& p) const {
  const auto& [v, w] = segments_[segment].vertex;
  const Double3 d = at(w) - at(v);
  const double square = dot(d, d), t = square > 0.0 ? std::clamp(dot(p - at(v), d) / square, 0.0, 1.0) : 0.0;
  return static_cast<float>((1.0 - t) * static_cast<double>(length_[v]) +
                            t * static_cast<double>(length_[w]));
}

ReferenceSurface::Foot ReferenceSurface::closest(const Double3& p, double limit_square,
                                                 std::uint32_t hint) const {
  const ClosestFaces::Hit hit =
      faces_.closest(p, limit_square, hint == kNone ? ClosestFaces::kNone : slot_[hint]);
  if (hit.slot == ClosestFaces::kNone) return {};
  const auto corner = faces_.corners(hit.slot);
  return {foot_in_triangle(p, corner[0], corner[1], corner[2]).at, hit.square, faces_.face(hit.slot)};
}

ReferenceSurface::Foot ReferenceSurface::near(const Double3& p, double limit_square, double trust_square,
                                              std::uint32_t face) const {
  const double maximum = std::min(limit_square, trust_square);
  constexpr int kSteps = 12;
  std::uint32_t before = kNone;
  for (int step = 0; face != kNone && step < kSteps; ++step) {
    const auto& f = face_[face];
    const Double3 &a = at(f[0]), &b = at(f[1]), &c = at(f[2]);
    const Double3 u = b - a, v = c - a, q = p - a, n = cross(u, v);
    const double square = dot(n, n);
    if (!(square > 0.0)) break;
    double weight[3];
    weight[1] = dot(cross(q, v), n);
    weight[2] = dot(cross(u, q), n);
    weight[0] = square - weight[1] - weight[2];
    const std::size_t worst =
        weight[0] < weight[1] ? (weight[0] < weight[2] ? 0 : 2) : (weight[1] < weight[2] ? 1 : 2);
    if (weight[worst] >= 0.0) {
      const double height = -dot(q, n);
      const double away = height * height / square;
      if (!(away < maximum)) break;
      return {p + n * (height / square), away, face};
    }
    const std::uint32_t next = adjacent_[face][worst];
    if (next == before ||
        next == kNone) {  // the edge between the two is nearest, or the line where the walk ends
      const Double3 foot = foot_in_triangle(p, a, b, c).at;
      const double away = squared_distance(p, foot);
      if (!(away < maximum)) break;
      return {foot, away, face};
    }
    before = face;
    face = next;
  }
  return closest(p, limit_square, face != kNone ? face : before);
}

ReferenceSurface::Foot ReferenceSurface::on_segment(const Double3& p, std::uint32_t segment) const {
  const Segment& s = segments_[segment];
  const Double3 foot = closest_on_segment(p, at(s.vertex[0]), at(s.vertex[1]));
  return {foot, squared_distance(p, foot), segment};
}

ReferenceSurface::Foot ReferenceSurface::closest_on_lines(const Double3& p) const {
  const ClosestFaces::Hit hit = lines_.closest(p, std::numeric_limits<double>::max(), ClosestFaces::kNone);
  return hit.slot == ClosestFaces::kNone ? Foot{} : on_segment(p, lines_.face(hit.slot));
}

ReferenceSurface::Foot ReferenceSurface::slide(const Double3& p, std::uint32_t segment) const {
  Foot best = on_segment(p, segment);
  for (std::size_t side = 0; side < 2; ++side) {
    std::uint32_t from = segment;
    std::uint32_t next = segments_[segment].beyond[side];
    // A few steps may lead away before the line comes back: what lies farther along it is no place for the vertex.
    for (int worse = 0; next != kNone && next != segment && worse < 3;) {
      const Foot foot = on_segment(p, next);
      if (foot.square < best.square) {
        best = foot;
        worse = 0;
      } else {
        ++worse;
      }
      const Segment& s = segments_[next];
      const std::uint32_t after = s.beyond[s.beyond[0] == from ? 1 : 0];
      from = next;
      next = after;
    }
  }
  return best;
}

std::uint32_t ReferenceSurface::colour(std::uint32_t face, const Double3& p) const {
  const auto& f = face_[face];
  const Double3 &a = at(f[0]), &b = at(f[1]), &c = at(f[2]);
  const Double3 n = triangle_normal(a, b, c);
  const double square = dot(n, n);
  const auto of = [&](std::size_t i) { return reference_->rgba[number_[f[i]]]; };
  if (!(square > 0.0)) return of(0);
  const double weight[3] = {dot(cross(b - p, c - p), n) / square, dot(cross(c - p, a - p), n) / square,
                            dot(cross(a - p, b - p), n) / square};
  std::uint32_t out = 0;
  for (unsigned shift = 0; shift < 32; shift += 8) {
    double value = 0.5;
    for (std::size_t i = 0; i < 3; ++i) value += weight[i] * (of(i) >> shift & 255u);
    out |= static_cast<std::uint32_t>(std::fmin(std::fmax(value, 0.0), 255.0)) << shift;
  }
  return out;
}

/// Of the vertices of the block, by key; kNone for others.
std::vector<std::uint32_t> ReferenceSurface::numbers_in(const MeshBlock& block) const {
  std::vector<std::uint32_t> here(number_.size()), there(block.key.size(), kNone);
  for (std::uint32_t v = 0; v < number_.size(); ++v) here[number_[v]] = v;
  std::size_t r = 0;
  for (std::size_t v = 0; v < block.key.size(); ++v) {
    while (r < reference_->key.size() && reference_->key[r] < block.key[v]) ++r;
    if (r < reference_->key.size() && reference_->key[r] == block.key[v]) there[v] = here[r];
  }
  return there;
}

std::vector<std::uint32_t> ReferenceSurface::faces_at(const MeshBlock& block) const {
  std::vector<std::uint32_t> first(at_.size(), kNone), out = numbers_in(block);
  for (std::uint32_t f = 0; f < face_.size(); ++f)
    for (const std::uint32_t v : face_[f]) first[v] = std::min(first[v], f);
  for (std::size_t v = 0; v < out.size(); ++v) {
    const std::uint32_t number = out[v];
    if (number == kNone) continue;
    out[v] = block.position[v] == reference_->position[number_[number]] ? first[number] : kNone;
  }
  return out;
}

std::vector<std::uint8_t> ReferenceSurface::lasting_corners(const MeshBlock& block) const {
  const std::vector<std::uint32_t> there = numbers_in(block);
  std::vector<std::uint8_t> out(there.size(), 0);
  for (std::size_t v = 0; v < out.size(); ++v)
    out[v] = there[v] != kNone && lasting_[there[v]] != 0 &&
             block.position[v] == reference_->position[number_[there[v]]];
  return out;
}

void ReferenceSurface::mark(MeshBlock& block) const {
  const std::vector<std::uint32_t> there = numbers_in(block);
  for (std::size_t v = 0; v < there.size(); ++v)
    if (there[v] != kNone) block.vertex_class[v] = class_[there[v]];
  for (std::size_t f = 0; f < block.faces.size(); ++f) {
    unsigned flags = block.face_flags[f] & ~unsigned{kFaceCrease01 | kFaceCrease12 | kFaceCrease20};
    for (std::size_t e = 0; e < 3; ++e) {
      const std::uint32_t a = there[block.faces[f][e]], b = there[block.faces[f][e == 2 ? 0 : e + 1]];
      if (a != kNone && b != kNone &&
          std::binary_search(creases_.begin(), creases_.end(),
                             std::array<std::uint32_t, 2>{std::min(a, b), std::max(a, b)}))
        flags |= unsigned{kFaceCrease01} << e;
    }
    block.face_flags[f] = static_cast<std::uint8_t>(flags);
  }
}

}  // namespace tessera
