#include "kernels/solid/mesh_creases.h"

#include <algorithm>
#include <cmath>

#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr std::uint32_t kUnknown = ~std::uint32_t{0};
/// Triangles of a section within one face of the lattice: more are noise below the lattice, or a loop.
constexpr int kMaxSectionSteps = 400;

std::int64_t floor_cell(std::int64_t quanta) {
  return quanta >> kSolidQuantumBits;
}
/// The cell of a coordinate: one in a plane of nodes lies before it.
std::int32_t cell_before(std::int64_t quanta) {
  return static_cast<std::int32_t>(floor_cell(quanta - 1));
}
bool passes_plane(std::int64_t quanta, std::int32_t plane) {
  return quanta > static_cast<std::int64_t>(plane) * kSolidQuanta;
}

}  // namespace

MeshCreases::MeshCreases(const SolidBlock& block, double angle_deg)
    : block_(block),
      sharp_cos_(static_cast<float>(cosine_of_degrees(angle_deg))),
      // Of two normals that open wider than an angle one opens wider than half of it against any third.
      flag_cos_(static_cast<float>(cosine_of_degrees(0.5 * angle_deg)) + 1e-5f) {
  for (std::size_t k = 0; k < 3; ++k) {
    low_[k] = (block.origin[k] - 1) * kSolidQuanta;
    high_[k] = (block.origin[k] + block.cells[k] + 1) * kSolidQuanta;
  }
}

std::uint32_t MeshCreases::weld(std::uint8_t operand, const Long3& at) {
  if (2 * (at_.size() + 1) > table_.size()) grow();
  std::uint64_t hash = operand;
  for (const std::int64_t c : at) hash = (hash ^ static_cast<std::uint64_t>(c)) * 0x9e3779b97f4a7c15ULL;
  hash ^= hash >> 32;
  std::size_t slot = hash & (table_.size() - 1);
  for (; table_[slot] != kUnknown; slot = (slot + 1) & (table_.size() - 1))
    if (at_[table_[slot]] == at && operand_[table_[slot]] == operand) return table_[slot];
  const auto made = static_cast<std::uint32_t>(at_.size());
  table_[slot] = made;
  at_.push_back(at);
  operand_.push_back(operand);
  first_face_.push_back(kUnknown);
  flagged_.push_back(0);
  return made;
}

void MeshCreases::grow() {
  table_.assign(std::max<std::size_t>(1024, 2 * table_.size()), kUnknown);
  for (std::uint32_t v = 0; v < at_.size(); ++v) {
    std::uint64_t hash = operand_[v];
    for (const std::int64_t c : at_[v]) hash = (hash ^ static_cast<std::uint64_t>(c)) * 0x9e3779b97f4a7c15ULL;
    hash ^= hash >> 32;
    std::size_t slot = hash & (table_.size() - 1);
    while (table_[slot] != kUnknown) slot = (slot + 1) & (table_.size() - 1);
    table_[slot] = v;
  }
}

void MeshCreases::add(std::uint8_t operand, std::span<const Long3> corner,
                      std::span<const std::array<std::uint32_t, 3>> faces, std::span<const Float3> normal) {
  std::vector<std::uint32_t> vertex(corner.size(), kUnknown);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    bool near = true;
    for (std::size_t k = 0; k < 3 && near; ++k) {
      const std::int64_t x = corner[faces[f][0]][k], y = corner[faces[f][1]][k], z = corner[faces[f][2]][k];
      near = std::max({x, y, z}) >= low_[k] && std::min({x, y, z}) <= high_[k];
    }
    if (!near) continue;
    std::array<std::uint32_t, 3> made;
    for (std::size_t c = 0; c < 3; ++c) {
      std::uint32_t& v = vertex[faces[f][c]];
      if (v == kUnknown) v = weld(operand, corner[faces[f][c]]);
      made[c] = v;
    }
    if (made[0] == made[1] || made[1] == made[2] || made[2] == made[0]) continue;
    const auto number = static_cast<std::uint32_t>(faces_.size());
    faces_.push_back(made);
    normal_.push_back(normal[f]);
    for (const std::uint32_t v : made) {
      if (first_face_[v] == kUnknown)
        first_face_[v] = number;
      else if (!(dot(normal_[first_face_[v]], normal[f]) > flag_cos_))
        flagged_[v] = 1;
    }
  }
}

void MeshCreases::count_faces_around() {
  around_first_.assign(at_.size() + 1, 0);
  for (const auto& f : faces_)
    for (const std::uint32_t v : f) ++around_first_[v + 1];
  for (std::size_t v = 0; v < at_.size(); ++v) around_first_[v + 1] += around_first_[v];
  around_.resize(3 * faces_.size());
  std::vector<std::uint32_t> next(around_first_.begin(), around_first_.end() - 1);
  for (std::uint32_t f = 0; f < faces_.size(); ++f)
    for (const std::uint32_t v : faces_[f]) around_[next[v]++] = f;
}

std::uint32_t MeshCreases::across(std::uint32_t face, std::uint32_t from, std::uint32_t to) const {
  std::uint32_t other = kUnknown;
  for (std::uint32_t i = around_first_[from]; i < around_first_[from + 1]; ++i) {
    const std::uint32_t f = around_[i];
    if (f == face) continue;
    const auto& v = faces_[f];
    if (v[0] != to && v[1] != to && v[2] != to) continue;
    if (other != kUnknown) return kUnknown;
    other = f;
  }
  if (other == kUnknown) return kUnknown;
  const auto turn = [&](std::uint32_t f) {
    const auto& v = faces_[f];
    for (std::size_t k = 0; k < 3; ++k)
      if (v[k] == from) return v[(k + 1) % 3] == to;
    return false;
  };
  return turn(face) != turn(other) ? other : kUnknown;
}

void MeshCreases::find_sharp_edges() {
  for (std::uint32_t f = 0; f < faces_.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = faces_[f][k], w = faces_[f][(k + 1) % 3];
      if (!flagged_[v] || !flagged_[w]) continue;
      const std::uint32_t g = across(f, v, w);
      if (g == kUnknown || g < f) continue;
      if (normal_[f] == Float3{0, 0, 0} || normal_[g] == Float3{0, 0, 0}) continue;
      if (!(dot(normal_[f], normal_[g]) < sharp_cos_)) continue;
      const bool ascending = at_[v] < at_[w];
      sharp_.push_back({ascending ? v : w, ascending ? w : v, {f, g}});
    }
  // By place, for numbers hang on the order of the faces.
  std::sort(sharp_.begin(), sharp_.end(), [&](const SharpEdge& a, const SharpEdge& b) {
    return std::tie(at_[a.a], at_[a.b], operand_[a.a]) < std::tie(at_[b.a], at_[b.b], operand_[b.a]);
  });
}

std::uint32_t MeshCreases::sharp_edge(std::uint32_t from, std::uint32_t to) const {
  if (!(at_[from] < at_[to])) std::swap(from, to);
  const auto key = std::tie(at_[from], at_[to], operand_[from]);
  const auto found = std::lower_bound(
      sharp_.begin(), sharp_.end(), key,
      [&](const SharpEdge& e, const auto& k) { return std::tie(at_[e.a], at_[e.b], operand_[e.a]) < k; });
  return found != sharp_.end() && found->a == from && found->b == to
             ? static_cast<std::uint32_t>(found - sharp_.begin())
             : kUnknown;
}

bool MeshCreases::inside(const Int3& cell, int beyond) const {
  for (std::size_t k = 0; k < 3; ++k)
    if (cell[k] < -1 - beyond || cell[k] > block_.cells[k] + beyond) return false;
  return true;
}

/// Where the edge from a to b passes a plane, whichever way it is named, from the min corner of a cell of the block: the same
/// numbers in every block.
Double3 MeshCreases::cross_plane(std::uint32_t a, std::uint32_t b, std::size_t axis, std::int32_t plane,
                                 const Int3& cell) const {
  const bool ascending = at_[a] < at_[b];
  const Long3 &p = at_[ascending ? a : b], &q = at_[ascending ? b : a];
  const double s = static_cast<double>(static_cast<std::int64_t>(plane) * kSolidQuanta - p[axis]) /
                   static_cast<double>(q[axis] - p[axis]);
  Double3 at;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::int64_t from = p[k] - (block_.origin[k] + cell[k]) * kSolidQuanta;
    at[k] = (static_cast<double>(from) + s * static_cast<double>(q[k] - p[k])) /
            static_cast<double>(kSolidQuanta);
  }
  at[axis] = plane - block_.origin[axis] - cell[axis];
  return at;
}

void MeshCreases::cut_edge(std::uint32_t edge, CreaseLines& lines) {
  const SharpEdge& e = sharp_[edge];
  const Long3 &p = at_[e.a], &q = at_[e.b];
  for (std::size_t k = 0; k < 3; ++k)
    if (std::max(p[k], q[k]) < low_[k] || std::min(p[k], q[k]) > high_[k]) return;
  struct Step {
    double s;
    std::size_t axis;
    std::int32_t plane;
  };
  std::vector<Step> steps;
  Int3 cell, last;
  for (std::size_t k = 0; k < 3; ++k) {
    cell[k] = cell_before(p[k]);
    last[k] = cell_before(q[k]);
    const int way = last[k] > cell[k] ? 1 : -1;
    for (std::int32_t at = cell[k]; at != last[k]; at += way) {
      const std::int32_t plane = way > 0 ? at + 1 : at;
      steps.push_back({static_cast<double>(static_cast<std::int64_t>(plane) * kSolidQuanta - p[k]) /
                           static_cast<double>(q[k] - p[k]),
                       k, plane});
    }
  }
  std::sort(steps.begin(), steps.end(),
            [](const Step& a, const Step& b) { return std::tie(a.s, a.axis) < std::tie(b.s, b.axis); });
  const auto vertex_end = [&](std::uint32_t v) {
    if (of_vertex_[v] == kUnknown) {
      of_vertex_[v] = static_cast<std::uint32_t>(lines.vertices.size());
      Double3 at;
      for (std::size_t k = 0; k < 3; ++k)
        at[k] = static_cast<double>(at_[v][k] - block_.origin[k] * kSolidQuanta) /
                static_cast<double>(kSolidQuanta);
      lines.vertices.push_back(at);
    }
    return of_vertex_[v] | kCreaseVertex;
  };
  for (std::size_t k = 0; k < 3; ++k) {
    cell[k] -= block_.origin[k];
    last[k] -= block_.origin[k];
  }
  std::uint32_t from = kUnknown;  // the crossing before the piece at hand; none yet: the first vertex
  bool begins = true;
  for (std::size_t i = 0; i <= steps.size(); ++i) {
    const bool here = inside(cell);
    Int3 next = cell, above = cell;
    if (i < steps.size()) {
      const std::size_t k = steps[i].axis;
      next[k] += q[k] > p[k] ? 1 : -1;
      if (q[k] > p[k]) above = next;
    }
    std::uint32_t to = kUnknown;
    if (i < steps.size() && (inside(cell, 1) || inside(next, 1))) {
      to = static_cast<std::uint32_t>(crossings_.size());
      Crossing& made = crossings_.emplace_back();
      made.edge = edge;
      made.cell = above;
      made.axis = steps[i].axis;
      made.plane = steps[i].plane;
      made.at = cross_plane(e.a, e.b, steps[i].axis, steps[i].plane, above);
      // Of a cell in the halo, all faces: what its loops become depends on them.
      made.face =
          inside(above) ? 3 * lines.cell_number(above) + static_cast<std::uint32_t>(steps[i].axis) : kUnknown;
    }
    if (here) {
      CreasePiece piece;
      piece.cell = lines.cell_number(cell);
      piece.end = {begins ? vertex_end(e.a) : from, i == steps.size() ? vertex_end(e.b) : to};
      piece.rank = {kNoRank, kNoRank};
      piece_edge_.push_back({edge, static_cast<std::uint32_t>(lines.pieces.size())});
      lines.pieces.push_back(piece);
    }
    begins = false;
    from = to;
    cell = next;
  }
}

/// Leaves the face of the lattice through the triangle: which of its lattice edges that passes, and where.
bool MeshCreases::leave(const Crossing& at, std::uint32_t face, CreaseChain& chain, std::size_t end) const {
  const std::size_t axis = at.face % 3, u = (axis + 1) % 3, v = (axis + 2) % 3;
  NodeBox box;
  Int3 node;
  for (std::size_t k = 0; k < 3; ++k) {
    node[k] = at.cell[k] + block_.origin[k];
    box.low[k] = node[k];
    box.high[k] = node[k] + (k == axis ? 1 : 2);
  }
  std::vector<LatticeCrossing> found;
  find_crossings({at_[faces_[face][0]], at_[faces_[face][1]], at_[faces_[face][2]]}, box, 1u << u | 1u << v,
                 found);
  int count = 0;
  for (const LatticeCrossing& c : found) {
    if (c.node[c.axis] != node[c.axis]) continue;
    const std::size_t along = c.axis, first = (along + 1) % 3, second = (along + 2) % 3;
    chain.edge[end] =
        static_cast<std::uint8_t>(4 * along + static_cast<std::size_t>(c.node[first] - node[first]) +
                                  2 * static_cast<std::size_t>(c.node[second] - node[second]));
    chain.t[end] = static_cast<float>(c.t);
    chain.normal[end] = normal_[face];
    ++count;
  }
  return count == 1;
}

/// From a crossing on through one of its edge's faces until the section leaves the face of the lattice.
bool MeshCreases::walk(const Crossing& from, std::uint32_t face, std::vector<std::uint32_t>& passed,
                       CreaseChain& chain, std::size_t end) const {
  const std::size_t axis = from.face % 3;
  std::uint32_t a = sharp_[from.edge].a, b = sharp_[from.edge].b;
  for (int step = 0; step < kMaxSectionSteps; ++step) {
    const auto& f = faces_[face];
    const std::uint32_t third = f[0] != a && f[0] != b ? f[0] : f[1] != a && f[1] != b ? f[1] : f[2];
    // One of the edges from the third vertex passes the plane too.
    (passes_plane(at_[third][axis], from.plane) == passes_plane(at_[a][axis], from.plane) ? a : b) = third;
    const std::uint32_t edge = sharp_.empty() || !flagged_[a] || !flagged_[b] ? kUnknown : sharp_edge(a, b);
    if (edge != kUnknown) {
      std::uint32_t there = kUnknown;
      for (std::uint32_t c = edge_first_[edge]; c < edge_first_[edge + 1]; ++c)
        if (crossings_[c].face == from.face) there = c;
      if (there == kUnknown) return leave(from, face, chain, end);
      if (std::find(passed.begin(), passed.end(), there) != passed.end()) return false;
      passed.push_back(there);
    } else {
      const Double3 at = cross_plane(a, b, axis, from.plane, from.cell);
      for (std::size_t k = 0; k < 3; ++k)
        if (k != axis && !(at[k] > 0.0 && at[k] <= 1.0)) return leave(from, face, chain, end);
    }
    face = across(face, a, b);
    if (face == kUnknown) return false;
  }
  return false;
}

void MeshCreases::find_meetings() {
  struct Place {
    Int3 cell;
    Double3 at;  ///< from its min corner, below 1
    std::uint32_t crossing;
  };
  std::vector<Place> places;
  for (std::uint32_t c = 0; c < crossings_.size(); ++c) {
    Place place = {crossings_[c].cell, crossings_[c].at, c};
    int planes = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      if (place.at[k] == 1.0) ++place.cell[k], place.at[k] = 0.0;
      planes += place.at[k] == 0.0;
    }
    if (planes > 1) places.push_back(place);
  }
  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) {
    return std::tie(a.cell, a.at, a.crossing) < std::tie(b.cell, b.at, b.crossing);
  });
  meets_.assign(crossings_.size(), 0);
  for (std::size_t i = 1; i < places.size(); ++i) {
    const Crossing &a = crossings_[places[i - 1].crossing], &b = crossings_[places[i].crossing];
    if (places[i - 1].cell != places[i].cell || places[i - 1].at != places[i].at) continue;
    if (a.cell == b.cell && a.axis == b.axis) continue;  // in one face: chains_are_sound()
    meets_[places[i - 1].crossing] = meets_[places[i].crossing] = 1;
  }
}

void MeshCreases::trace_sections(CreaseLines& lines) {
  std::vector<std::uint32_t> order;
  for (std::uint32_t c = 0; c < crossings_.size(); ++c)
    if (crossings_[c].face != kUnknown) order.push_back(c);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tie(crossings_[a].face, crossings_[a].at) < std::tie(crossings_[b].face, crossings_[b].at);
  });
  std::vector<std::uint8_t> done(crossings_.size(), 0);
  struct Found {
    CreaseChain chain;
    std::vector<std::uint32_t> passed;
  };
  std::vector<Found> of_face;
  for (std::size_t i = 0; i < order.size();) {
    const std::uint32_t face = crossings_[order[i]].face;
    of_face.clear();
    for (; i < order.size() && crossings_[order[i]].face == face; ++i) {
      if (done[order[i]]) continue;
      const Crossing& from = crossings_[order[i]];
      Found found;
      found.chain.face = face;
      std::vector<std::uint32_t> other = {order[i]};
      found.passed = {order[i]};
      const bool closed = walk(from, sharp_[from.edge].face[0], found.passed, found.chain, 0) &&
                          walk(from, sharp_[from.edge].face[1], other, found.chain, 1);
      std::reverse(found.passed.begin(), found.passed.end());
      found.passed.insert(found.passed.end(), other.begin() + 1, other.end());
      for (const std::uint32_t c : found.passed) done[c] = 1;
      if (!closed || found.chain.edge[0] == found.chain.edge[1]) continue;
      if (std::any_of(found.passed.begin(), found.passed.end(),
                      [&](std::uint32_t c) { return meets_[c] != 0; }))
        continue;
      if (found.chain.edge[0] > found.chain.edge[1]) {
        std::swap(found.chain.edge[0], found.chain.edge[1]);
        std::swap(found.chain.t[0], found.chain.t[1]);
        std::swap(found.chain.normal[0], found.chain.normal[1]);
        std::reverse(found.passed.begin(), found.passed.end());
      }
      of_face.push_back(std::move(found));
    }
    std::stable_sort(of_face.begin(), of_face.end(), [](const Found& a, const Found& b) {
      return std::tie(a.chain.edge, a.chain.t) < std::tie(b.chain.edge, b.chain.t);
    });
    std::uint32_t number = 0;
    for (Found& found : of_face) {
      found.chain.first = static_cast<std::uint32_t>(lines.kinks.size());
      found.chain.count = static_cast<std::uint32_t>(found.passed.size());
      found.chain.number = number;
      number += found.chain.count;
      for (const std::uint32_t c : found.passed) {
        Double3 at = crossings_[c].at;
        for (std::size_t k = 0; k < 3; ++k) at[k] = std::clamp(at[k], 0.0, 1.0);
        lines.kinks.push_back({c, narrow(at)});
      }
      lines.chains.push_back(found.chain);
    }
  }
}

/// Around vertices where three or more sharp edges meet, their order.
void MeshCreases::rank_vertices(CreaseLines& lines) {
  struct End {
    std::uint32_t vertex, other;
    std::uint32_t piece;
    std::uint8_t end;
  };
  std::vector<End> ends;
  for (const auto& [edge, piece] : piece_edge_)
    for (std::uint8_t e = 0; e < 2; ++e) {
      if ((lines.pieces[piece].end[e] & kCreaseVertex) == 0) continue;
      const std::uint32_t a = sharp_[edge].a, b = sharp_[edge].b;
      const bool first = of_vertex_[a] == (lines.pieces[piece].end[e] & ~kCreaseVertex);
      ends.push_back({first ? a : b, first ? b : a, piece, e});
    }
  std::sort(ends.begin(), ends.end(), [&](const End& a, const End& b) {
    return a.vertex != b.vertex ? a.vertex < b.vertex : at_[a.other] < at_[b.other];
  });
  for (std::size_t i = 0; i < ends.size();) {
    std::size_t last = i;
    while (last < ends.size() && ends[last].vertex == ends[i].vertex) ++last;
    const std::uint32_t v = ends[i].vertex;
    const std::uint32_t faces = around_first_[v + 1] - around_first_[v];
    // Counter-clockwise from the first edge: the face (v, x, y) leads from the edge to x to that to y.
    std::uint32_t x = ends[i].other, face = kUnknown;
    for (std::uint32_t f = around_first_[v]; f < around_first_[v + 1]; ++f)
      for (std::size_t k = 0; k < 3; ++k)
        if (faces_[around_[f]][k] == v && faces_[around_[f]][(k + 1) % 3] == x) face = around_[f];
    std::vector<std::pair<std::size_t, std::uint8_t>> ranks;
    std::uint32_t turned = 0;
    std::uint8_t rank = 0;
    while (face != kUnknown && turned < faces && rank < kNoRank) {
      for (std::size_t e = i; e < last; ++e)
        if (ends[e].other == x) ranks.emplace_back(e, rank++);
      const auto& f = faces_[face];
      const std::size_t k = f[0] == v ? 0 : f[1] == v ? 1 : 2;
      const std::uint32_t y = f[(k + 2) % 3];
      face = across(face, v, y);
      x = y;
      ++turned;
    }
    // A whole turn about all faces, and every edge once: else it stays unknown.
    if (face != kUnknown && turned == faces && x == ends[i].other && ranks.size() == last - i)
      for (const auto& [e, r] : ranks) lines.pieces[ends[e].piece].rank[ends[e].end] = r;
    i = last;
  }
}

CreaseLines MeshCreases::lines() {
  CreaseLines lines;
  lines.cells = block_.cells;
  if (std::find(flagged_.begin(), flagged_.end(), 1) == flagged_.end()) return lines;
  count_faces_around();
  find_sharp_edges();
  of_vertex_.assign(at_.size(), kUnknown);
  for (std::uint32_t e = 0; e < sharp_.size(); ++e) {
    edge_first_.push_back(static_cast<std::uint32_t>(crossings_.size()));
    cut_edge(e, lines);
  }
  edge_first_.push_back(static_cast<std::uint32_t>(crossings_.size()));
  if (lines.pieces.empty()) return lines;
  find_meetings();
  trace_sections(lines);
  rank_vertices(lines);
  std::stable_sort(lines.pieces.begin(), lines.pieces.end(),
                   [](const CreasePiece& a, const CreasePiece& b) { return a.cell < b.cell; });
  std::uint64_t cells = 1;
  for (const int c : block_.cells) cells *= static_cast<std::uint64_t>(c) + 2;
  lines.passed.assign((cells + 63) / 64, 0);
  for (const CreasePiece& p : lines.pieces) lines.passed[p.cell >> 6] |= std::uint64_t{1} << (p.cell & 63);
  return lines;
}

}  // namespace tessera
