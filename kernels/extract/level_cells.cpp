#include "kernels/extract/level_cells.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "kernels/extract/cell_loops.h"

namespace tessera {
namespace {

constexpr std::uint8_t kNone = 255;
constexpr std::size_t kEdgeSlots = 3 * 27;  ///< edges and half edges of a cell: axis, then where they begin
constexpr double kForbidden = 1e300;

std::size_t edge_slot(std::size_t axis, const Int3& in_cell) {
  return axis * 27 + static_cast<std::size_t>(in_cell[0] + 3 * in_cell[1] + 9 * in_cell[2]);
}
std::size_t axis_of(std::size_t edge_slot) {
  return edge_slot / 27;
}
Int3 start_of(std::size_t edge_slot) {
  const int p = static_cast<int>(edge_slot % 27);
  return {p % 3, p / 3 % 3, p / 9};
}

Int3 minus(const Int3& a, const Int3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Int3 doubled(const Int3& a) {
  return {2 * a[0], 2 * a[1], 2 * a[2]};
}

}  // namespace

/// A face of a cell, or a quarter of one: nodes counter-clockwise as seen from outside the cell.
struct LevelCells::Face {
  int face = 0;              ///< of the cell
  bool quarter = false;      ///< of the finer lattice
  Int3 low = {0, 0, 0};      ///< its min corner, finer lattice
  std::vector<Int3> corner;  ///< finer lattice
};

/// Where segments lead, by places of edges in the cell.
struct LevelCells::Links {
  std::array<std::uint8_t, kEdgeSlots> next, face, faces_before;
  Links() {
    next.fill(kNone);
    face.fill(kNone);
    faces_before.fill(kNone);
  }
};

LevelPair::Node LevelCells::node(const Int3& at, bool quarter) const {
  if (quarter || ((at[0] | at[1] | at[2]) & 1))
    return LevelPair(fields_.own, fields_.finer, around_, 2 * kBrickCells, -1).node(at);
  const Int3 n = {at[0] >> 1, at[1] >> 1, at[2] >> 1};
  const BandLeaf* leaf = mixed_.leaf_at(n[0], n[1], n[2]);
  if (!leaf) return {};
  const std::size_t i = BandLeaf::node(n[0], n[1], n[2]);
  if (!leaf->is_valid(i)) return {};
  const bool inside = (leaf->inside[i >> 6] >> (i & 63) & 1) != 0;
  return {true, inside, leaf->value(i), false};
}

void LevelCells::list_faces(const Int3& cell, int face, std::vector<Face>& out) const {
  const auto a = static_cast<std::size_t>(face >> 1);
  const std::size_t u = (a + 1) % 3, v = (a + 2) % 3;
  Int3 base = doubled(cell), size = {2, 2, 2};
  base[a] += face & 1 ? 2 : 0;
  size[a] = 0;
  // Corners go round from base along the first of the two axes.
  const std::size_t first = face & 1 ? u : v, second = face & 1 ? v : u;
  const auto moved = [&](Int3 at, int by_first, int by_second) {
    at[first] += by_first;
    at[second] += by_second;
    return at;
  };
  if (is_split(base, size)) {
    for (int q = 0; q < 4; ++q) {
      const Int3 low = moved(base, q & 1, q >> 1);
      out.push_back({face, true, low, {low, moved(low, 1, 0), moved(low, 1, 1), moved(low, 0, 1)}});
    }
    return;
  }
  Face whole{face, false, base, {}};
  constexpr std::array<std::array<int, 2>, 4> kRound = {{{0, 0}, {2, 0}, {2, 2}, {0, 2}}};
  for (std::size_t i = 0; i < 4; ++i) {
    const Int3 from = moved(base, kRound[i][0], kRound[i][1]);
    const Int3 to = moved(base, kRound[(i + 1) % 4][0], kRound[(i + 1) % 4][1]);
    whole.corner.push_back(from);
    Int3 low = from, length;
    for (std::size_t c = 0; c < 3; ++c) {
      low[c] = std::min(from[c], to[c]);
      length[c] = std::max(from[c], to[c]) - low[c];
    }
    if (is_split(low, length))
      whole.corner.push_back({(from[0] + to[0]) / 2, (from[1] + to[1]) / 2, (from[2] + to[2]) / 2});
  }
  out.push_back(std::move(whole));
}

void LevelCells::link(const Int3& cell, const Face& face, std::uint8_t number, Links& links) const {
  const std::size_t n = face.corner.size();
  std::vector<LevelPair::Node> nodes;
  for (const Int3& c : face.corner) nodes.push_back(node(c, face.quarter));
  const auto inside = [&](std::size_t i) { return nodes[i % n].inside; };
  const auto edge = [&](std::size_t i) {
    const Int3 &from = face.corner[i % n], &to = face.corner[(i + 1) % n];
    Int3 low;
    std::size_t axis = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      low[c] = std::min(from[c], to[c]);
      if (from[c] != to[c]) axis = c;
    }
    return edge_slot(axis, minus(low, doubled(cell)));
  };
  bool join = false;
  if (n == 4 && inside(0) == inside(2) && inside(1) == inside(3) && inside(0) != inside(1)) {
    // The rule of joined_faces(), exact.
    const auto at = [&](std::size_t i) { return double{nodes[i].value}; };
    const double det = at(0) * at(2) - at(1) * at(3);
    join = inside(0) ? det > 0.0 : det < 0.0;
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (inside(i) || !inside(i + 1)) continue;
    std::size_t out = i + 1;
    if (join)
      out = i + n - 1;
    else
      while (inside(out + 1)) ++out;
    const std::size_t from = edge(i), to = edge(out);
    links.next[from] = static_cast<std::uint8_t>(to);
    links.face[from] = number;
    links.faces_before[to] = number;
  }
}

std::vector<LevelLoop> LevelCells::trace(const Int3& cell, const BrickBand& band) const {
  std::vector<Face> faces;
  for (int face = 0; face < 6; ++face) list_faces(cell, face, faces);
  Links links;
  for (std::size_t f = 0; f < faces.size(); ++f) link(cell, faces[f], static_cast<std::uint8_t>(f), links);
  std::vector<LevelLoop> loops;
  std::vector<std::size_t> to_next;  ///< faces in which the ways to next points lie
  for (std::size_t start = 0; start < kEdgeSlots; ++start) {
    if (links.next[start] == kNone) continue;
    LevelLoop& loop = loops.emplace_back();
    to_next.clear();
    for (std::size_t at = start; links.next[at] != kNone;) {
      LevelPoint p;
      const std::size_t axis = axis_of(at), u = (axis + 1) % 3, v = (axis + 2) % 3;
      const Int3 in_cell = start_of(at);
      p.axis = static_cast<int>(axis);
      p.line = kNone;
      if (in_cell[u] != 1 && in_cell[v] != 1)
        p.line = static_cast<std::uint8_t>(4 * axis + (in_cell[u] ? 1u : 0u) + (in_cell[v] ? 2u : 0u));
      for (std::size_t c = 0; c < 3; ++c) p.node[c] = 2 * cell[c] + in_cell[c];
      Int3 length = {0, 0, 0}, low = p.node;
      low[axis] = 2 * cell[axis];
      length[axis] = 2;
      p.finer = p.line == kNone || is_split(low, length);
      p.edge = p.line;
      const auto number = links.face[at], before = links.faces_before[at];
      p.faces = 1u << faces[number].face | 1u << faces[before].face;
      loop.push_back(p);
      to_next.push_back(number);
      const std::size_t next = links.next[at];
      links.next[at] = kNone;
      at = next;
    }
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const LevelPoint& next = loop[i + 1 == loop.size() ? 0 : i + 1];
      const Face& face = faces[to_next[i]];
      loop[i].ends = ends_at(cell, face, band);
      if (!face.quarter && loop[i].line != kNone && loop[i].line == next.line)
        loop[i].ends = ends_beyond(cell, face.face, loop[i], loop[i].ends, band);
    }
  }
  return loops;
}

/// Whether the cell across takes no part.
bool LevelCells::ends_at(const Int3& cell, const Face& face, const BrickBand& band) const {
  const auto axis = static_cast<std::size_t>(face.face >> 1);
  if (!face.quarter) {
    Int3 across = cell;
    across[axis] += face.face & 1 ? 1 : -1;
    return !band.takes_part(across);
  }
  Int3 across = face.low;
  if (!(face.face & 1)) --across[axis];
  return !whole_cell(fields_.finer, across);
}

/// A segment along a split edge: where the cell across has the same one on its next face around the edge, its loop is
/// these two points, without faces, and the surface goes on in the cell behind, if at all.
/// \param ends  whether the cell across takes no part
bool LevelCells::ends_beyond(const Int3& cell, int face, const LevelPoint& point, bool ends,
                             const BrickBand& band) const {
  const auto axis = static_cast<std::size_t>(face >> 1);
  Int3 across = cell;
  across[axis] += face & 1 ? 1 : -1;
  const auto along = static_cast<std::size_t>(point.axis);
  const std::size_t third = 3 - axis - along;
  const bool high = point.node[third] == 2 * cell[third] + 2;
  const int other = 2 * static_cast<int>(third) + (high ? 1 : 0);
  std::vector<Face> faces;
  list_faces(across, other, faces);
  if (faces.size() != 1) return ends;
  Links links;
  link(across, faces[0], 0, links);
  Int3 low = minus(point.node, doubled(across));
  low[along] = 0;
  Int3 up = low;
  up[along] = 1;
  const std::size_t a = edge_slot(along, low), b = edge_slot(along, up);
  if (links.next[a] != b && links.next[b] != a) return ends;
  across[third] += high ? 1 : -1;
  return !band.takes_part(across);
}

const EdgeRoot& LevelCells::finer_root(const Int3& node, int axis) const {
  const EdgeRoot* root =
      fields_.finer.root_at(node[0] + kLevelMargin, node[1] + kLevelMargin, node[2] + kLevelMargin, axis);
  assert(root);
  return *root;
}

Int3 LevelCells::finer_node(const Int3& node) const {
  Int3 out;
  for (std::size_t a = 0; a < 3; ++a) out[a] = fields_.finer.origin[a] + kLevelMargin + node[a];
  return out;
}

bool LevelCells::finer_takes_part(const Int3& c, const BrickBand& band) const {
  const int step = around_.touching(c, {1, 1, 1}, 2 * kBrickCells).minimum;
  return step < 0 ? whole_cell(fields_.finer, c) : band.takes_part({c[0] >> 1, c[1] >> 1, c[2] >> 1});
}

LevelCells::Name LevelCells::finer_name(const Int3& node, int axis, const Int3& cell,
                                        const BrickBand& band) const {
  const auto u = static_cast<std::size_t>((axis + 1) % 3), v = static_cast<std::size_t>((axis + 2) % 3);
  std::array<bool, 4> part;  // A, B, C, D of brick_band.h
  for (std::size_t q = 0; q < 4; ++q) {
    Int3 c = node;
    c[u] -= q & 1 ? 0 : 1;
    c[v] -= q & 2 ? 0 : 1;
    part[q] = finer_takes_part(c, band);
  }
  const bool split =
      (part[0] && part[3] && !part[1] && !part[2]) || (part[1] && part[2] && !part[0] && !part[3]);
  const bool beyond = 2 * cell[v] == node[v];
  return {axis + (split && beyond ? 3 : 0), !(part[0] && part[1] && part[2] && part[3])};
}

std::vector<std::array<std::size_t, 3>> triangulate_level_loop(const LevelLoop& loop,
                                                               const std::vector<Float3>& point) {
  const std::size_t n = loop.size();
  std::vector<std::array<std::size_t, 3>> out;
  if (n < 3) return out;
  const auto meet = [&](std::size_t i, std::size_t j) { return (loop[i].faces & loop[j].faces) != 0; };
  const auto area = [&](std::size_t i, std::size_t j, std::size_t k) {
    const Float3 normal = triangle_normal(point[i], point[j], point[k]);
    return std::sqrt(double{dot(normal, normal)});
  };
  std::vector<double> cost(n * n, 0.0);
  std::vector<std::size_t> split(n * n, 0);
  for (std::size_t span = 2; span < n; ++span)
    for (std::size_t i = 0; i + span < n; ++i) {
      const std::size_t j = i + span;
      cost[i * n + j] = kForbidden;
      split[i * n + j] = i + 1;
      if (span + 1 < n && meet(i, j)) continue;
      for (std::size_t k = i + 1; k < j; ++k) {
        const double sides = cost[i * n + k] + cost[k * n + j];
        if (!(sides < cost[i * n + j])) continue;
        const double sum = sides + area(i, k, j);
        if (sum >= cost[i * n + j]) continue;
        cost[i * n + j] = sum;
        split[i * n + j] = k;
      }
    }
  if (!(cost[n - 1] < kForbidden)) return out;
  std::vector<std::array<std::size_t, 2>> open = {{0, n - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j - i < 2) continue;
    const std::size_t k = split[i * n + j];
    out.push_back({i, k, j});
    open.push_back({i, k});
    open.push_back({k, j});
  }
  return out;
}

}  // namespace tessera
