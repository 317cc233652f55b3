#include "kernels/decimate/collapse_mesh.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <utility>

#include "octree/error.h"
#include "octree/lists.h"
#include "octree/morton.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// The flag of an edge in the numbering of MeshFaceFlag: opposite corner 2, 0, 1.
constexpr unsigned kFlagOppositeCorner[3] = {kFaceBorder12, kFaceBorder20, kFaceBorder01};
static_assert(kFaceCrease01 == kFaceBorder01 << 5 && kFaceCrease20 == kFaceBorder20 << 5);

/// Numbers 0 to n - 1 in the Morton order of cells, a 1024th of the extent wide: in the low half of each entry.
/// \param position_of  position of a number, no coordinate far below 0
template <class Position>
std::vector<std::uint64_t> in_morton_order(std::size_t n, const Position& position_of) {
  double extent = 0.0;
  for (std::size_t v = 0; v < n; ++v)
    for (const double x : position_of(v)) extent = std::max(extent, x);
  const double scale = extent > 0.0 ? 1023.0 / extent : 0.0;
  std::vector<std::uint64_t> order(n), other(n);
  for (std::size_t v = 0; v < n; ++v) {
    const Double3 p = position_of(v);
    std::uint32_t cell[3];
    for (std::size_t a = 0; a < 3; ++a) cell[a] = static_cast<std::uint32_t>(std::max(0.0, p[a] * scale));
    order[v] = morton_encode(cell[0], cell[1], cell[2]) << 32 | v;
  }
  // Stable radix sort of 30 bits: ties stay in the order of the numbers.
  std::vector<std::uint32_t> count(1025);
  for (int shift = 32; shift < 62; shift += 10) {
    counting_sort<std::uint64_t>(order, other, count, [shift](std::uint64_t o) { return o >> shift & 1023; });
    order.swap(other);
  }
  return order;
}

/// Whether the block is canonical (mesh_block.h) and its vertices are numbered by place more or less already, as keys by
/// bricks and leaves number them: the corners of most faces are then few numbers apart.
bool lies_in_order(const MeshBlock& block) {
  constexpr std::uint32_t kFew = 512;
  constexpr std::size_t kMax = 8;  // one face in so many may be far apart
  std::size_t far = 0;
  const std::array<std::uint32_t, 3>* before = nullptr;
  for (const auto& f : block.faces) {
    if (f[1] < f[0] || f[2] < f[0] || (before && f < *before)) return false;
    far += std::max(f[1], f[2]) - f[0] > kFew;
    before = &f;
  }
  return far * kMax <= block.faces.size();
}

}  // namespace

CollapseMesh::CollapseMesh(const MeshBlock& block, const Double3& origin, Order order) {
  std::vector<std::uint32_t> slot;
  number_vertices(block, origin, order, slot);
  if (slot.empty())
    copy_faces(block);
  else
    fill_faces(block, slot);
  match_edges(block);
  find_fans();
}

namespace {

CollapseFace face_of(const MeshBlock& block, std::size_t f, std::size_t first) {
  constexpr unsigned kBordersAndCreases = 0xe7;
  const unsigned flags = block.face_flags[f];
  CollapseFace face{{0, 0, 0},
                    flags & kFaceSynthetic ? unsigned{kStateSynthetic} : 0u,
                    {kNoCorner, kNoCorner, kNoCorner},
                    block.face_bound.empty() ? 0.0f : block.face_bound[f]};
  if (flags & kFaceDone) face.state |= kStateDone;
  if ((flags & kBordersAndCreases) == 0) return face;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t from = first + i < 3 ? first + i : first + i - 3;
    if (flags & kFlagOppositeCorner[from]) face.state |= kStateBorder << i;
    if (flags & kFlagOppositeCorner[from] << 5) face.state |= kStateCrease << i;
  }
  return face;
}

}  // namespace

/// \param slot  of each vertex of the block; left empty where they stay as they are
void CollapseMesh::number_vertices(const MeshBlock& block, const Double3& origin, Order requested,
                                   std::vector<std::uint32_t>& slot) {
  const std::size_t n = block.position.size();
  block_vertex_.resize(n);
  state_.assign(n, 0);
  corner_.assign(n, kNoCorner);
  if (requested == Order::kNearEnough && lies_in_order(block)) {
    std::iota(block_vertex_.begin(), block_vertex_.end(), 0u);
  } else {
    const std::vector<std::uint64_t> order =
        in_morton_order(n, [&](std::size_t v) { return block.position[v] - origin; });
    slot.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      block_vertex_[i] = static_cast<std::uint32_t>(order[i]);
      slot[block_vertex_[i]] = static_cast<std::uint32_t>(i);
    }
  }
  vertices_.reserve(n);
  for (const std::uint32_t v : block_vertex_) vertices_.push_back({block.position[v] - origin, 0.0});
}

void CollapseMesh::copy_faces(const MeshBlock& block) {
  faces_.reserve(block.faces.size());
  for (std::size_t f = 0; f < block.faces.size(); ++f) {
    CollapseFace face = face_of(block, f, 0);
    std::copy(block.faces[f].begin(), block.faces[f].end(), face.vertex);
    faces_.push_back(face);
  }
}

void CollapseMesh::fill_faces(const MeshBlock& block, const std::vector<std::uint32_t>& slot) {
  const std::size_t n = block.position.size(), m = block.faces.size();
  // Faces by their lowest vertex: a counting sort.
  std::vector<std::uint32_t> begin(n + 1, 0);
  const auto lowest = [&](const std::array<std::uint32_t, 3>& t) {
    return std::min({slot[t[0]], slot[t[1]], slot[t[2]]});
  };
  for (const auto& t : block.faces) ++begin[lowest(t) + 1];
  for (std::size_t v = 0; v < n; ++v) begin[v + 1] += begin[v];
  faces_.resize(m);
  for (std::size_t f = 0; f < m; ++f) {
    const auto& t = block.faces[f];
    CollapseFace& face = faces_[begin[lowest(t)]++];
    // The lowest vertex first, so that the order of the input leaves no trace.
    const std::size_t first =
        slot[t[0]] < slot[t[1]] ? (slot[t[0]] < slot[t[2]] ? 0 : 2) : (slot[t[1]] < slot[t[2]] ? 1 : 2);
    face = face_of(block, f, first);
    for (std::size_t i = 0; i < 3; ++i) face.vertex[i] = slot[t[first + i < 3 ? first + i : first + i - 3]];
  }
  for (std::size_t f = 0; f < m;) {
    std::size_t end = f + 1;
    while (end < m && faces_[end].vertex[0] == faces_[f].vertex[0]) ++end;
    std::sort(&faces_[f], &faces_[f] + (end - f), [](const CollapseFace& a, const CollapseFace& b) {
      return a.vertex[1] != b.vertex[1] ? a.vertex[1] < b.vertex[1] : a.vertex[2] < b.vertex[2];
    });
    f = end;
  }
}

/// Vertex by vertex the edges to larger ones: a face has each in one direction. Faces ascend by their first corners, the
/// smallest.
void CollapseMesh::match_edges(const MeshBlock& block) {
  constexpr std::uint32_t kCame = kNoCorner - 1;  // no face has the other direction
  const std::size_t n = vertices_.size(), m = faces_.size();
  std::vector<std::uint32_t> across(n,
                                    kNoCorner);  // from the vertex at hand to this one: the corner opposite
  // Faces by the smaller end of the edge opposite their first corners: lists of those that leave it and that come to it.
  std::vector<std::array<std::uint32_t, 2>> first(n, {kNoCorner, kNoCorner});
  std::vector<std::uint32_t> next(m);
  std::uint32_t v = 0;
  const auto refuse = [&](std::uint32_t w) {
    throw InputError("decimation: the edge between vertices " + std::to_string(block.key[block_vertex_[v]]) +
                     " and " + std::to_string(block.key[block_vertex_[w]]) +
                     " has more than two faces, or two of the same direction; import the mesh first");
  };
  for (std::uint32_t begin = 0, end = 0; v < n; ++v, begin = end) {
    for (; end < m && faces_[end].vertex[0] == v; ++end) {
      const std::uint32_t a = faces_[end].vertex[1], b = faces_[end].vertex[2];
      next[end] = std::exchange(first[std::min(a, b)][a > b], end);
    }
    const auto each = [&](std::size_t comes, const auto& use) {  // (the other vertex, the corner across)
      for (std::uint32_t f = begin; f < end; ++f) use(faces_[f].vertex[1 + comes], 4 * f + (comes ? 1 : 2));
      for (std::uint32_t f = first[v][comes]; f != kNoCorner; f = next[f])
        use(faces_[f].vertex[2 - comes], 4 * f);
    };
    each(0, [&](std::uint32_t w, std::uint32_t corner) {
      if (across[w] != kNoCorner) refuse(w);
      across[w] = corner;
    });
    bool alone = false;
    each(1, [&](std::uint32_t w, std::uint32_t corner) {
      const std::uint32_t other = across[w];
      if (other == kNoCorner) {
        across[w] = kCame;
        alone = true;
        return;
      }
      if (other == kCame || opposite(other) != kNoCorner) refuse(w);
      faces_[corner >> 2].opposite[corner & 3u] = other;
      faces_[other >> 2].opposite[other & 3u] = corner;
    });
    const auto clear = [&](std::uint32_t w, std::uint32_t) { across[w] = kNoCorner; };
    each(0, clear);
    if (alone) each(1, clear);
  }
}

/// One corner per vertex, the first of its fan; a vertex with corners outside its fan is pinched.
void CollapseMesh::find_fans() {
  const std::size_t n = vertices_.size();
  std::vector<std::uint32_t> corners(n, 0);
  for (auto f = static_cast<std::uint32_t>(faces_.size()); f-- > 0;)  // the first corner stays
    for (std::uint32_t i = 3; i-- > 0;) {
      const std::uint32_t v = faces_[f].vertex[i];
      ++corners[v];
      corner_[v] = 4 * f + i;
    }
  for (std::uint32_t v = 0; v < n; ++v) {
    if (corner_[v] == kNoCorner) {
      state_[v] = kVertexDead;
      continue;
    }
    const std::uint32_t start = corner_[v];
    std::uint32_t c = start, seen = 1, o = opposite(next_corner(c));
    unsigned bits = 0;
    for (; o != kNoCorner && next_corner(o) != start; o = opposite(next_corner(c))) {
      c = next_corner(o);
      ++seen;
    }
    if (o == kNoCorner) {
      bits = kVertexOpen | kVertexBorder;
      if (!border_edge(next_corner(c))) bits |= kVertexLocked;
      c = start;
      for (o = opposite(prev_corner(c)); o != kNoCorner; o = opposite(prev_corner(c))) {
        c = prev_corner(o);
        ++seen;
      }
      if (!border_edge(prev_corner(c))) bits |= kVertexLocked;
      corner_[v] = c;
    }
    if (seen != corners[v]) bits |= kVertexPinched | kVertexLocked;
    state_[v] = static_cast<std::uint8_t>(bits);
  }
}

bool CollapseMesh::gather(std::uint32_t u, Star& star) const {
  const std::uint32_t first = corner_[u];
  std::uint32_t c = first;
  std::size_t k = 0;
  for (;;) {
    if (k == kMaxRing) return false;
    const CollapseFace& f = faces_[c >> 2];
    const std::uint32_t next = next_corner(c);
    star.corner[k] = c;
    star.ring[k] = f.vertex[next & 3u];
    ++k;
    const std::uint32_t o = f.opposite[next & 3u];
    if (o == kNoCorner) {
      star.ring[k] = f.vertex[prev_corner(c) & 3u];
      star.faces = k;
      star.closed = false;
      return true;
    }
    c = next_corner(o);
    if (c == first) break;
  }
  star.faces = k;
  star.closed = true;
  return true;
}

/// The edges opposite corners a and b become one; `lost_flags` are those of an edge whose face goes.
void CollapseMesh::join(std::uint32_t a, std::uint32_t b, unsigned lost_flags) {
  const auto flags = [&](std::uint32_t c) {
    return c == kNoCorner ? 0u : faces_[c >> 2].state >> (c & 3u) & (kStateBorder | kStateCrease);
  };
  const unsigned all = flags(a) | flags(b) | lost_flags;
  for (const auto& [c, d] : {std::pair(a, b), std::pair(b, a)}) {
    if (c == kNoCorner) continue;
    faces_[c >> 2].opposite[c & 3u] = d;
    faces_[c >> 2].state |= all << (c & 3u);
  }
}

/// Makes c, or where the fan is open the first corner of c's fan, the corner of v.
void CollapseMesh::seat(std::uint32_t v, std::uint32_t c) {
  if (state_[v] & kVertexOpen)
    for (std::uint32_t o = opposite(prev_corner(c)); o != kNoCorner; o = opposite(prev_corner(c)))
      c = prev_corner(o);
  corner_[v] = c;
}

void CollapseMesh::collapse(const Star& star, std::size_t at) {
  const std::uint32_t v = star.ring[at];
  const std::size_t k = star.faces;
  // On the left of u -> v lies f_at = (u, v, w_at+1), on the right f_at-1 = (u, w_at-1, v).
  const bool has_left = star.closed || at < k, has_right = star.closed || at > 0;
  const std::size_t left = at, right = at > 0 ? at - 1 : k - 1;
  const std::uint32_t u = vertex(star.corner[0]);
  for (std::size_t i = 0; i < k; ++i)
    if (!(has_left && i == left) && !(has_right && i == right))
      faces_[star.corner[i] >> 2].vertex[star.corner[i] & 3u] = v;
  std::uint32_t seat_of_v = kNoCorner;
  // `w` keeps the edge to v. Its outer face (across v - w) and its inner one (across u - w) become
  // neighbours.
  const auto remove = [&](std::uint32_t c, std::uint32_t corner_of_v, std::uint32_t w, bool is_left) {
    const std::uint32_t outer = opposite(c), inner = opposite(corner_of_v);
    CollapseFace& f = faces_[c >> 2];
    unsigned lost = 0;
    if (outer == kNoCorner) lost |= f.state >> (c & 3u) & kStateBorder;
    if (inner == kNoCorner) lost |= f.state >> (corner_of_v & 3u) & kStateBorder;
    f.state |= kStateDead;
    join(outer, inner, lost);
    // Seen from the corner across the edge: the inner face of the left has v next and w before, and so on.
    const std::uint32_t from = inner != kNoCorner ? inner : outer;
    if (from == kNoCorner) return;
    const bool w_is_prev = (inner != kNoCorner) == is_left;
    seat(w, w_is_prev ? prev_corner(from) : next_corner(from));
    seat_of_v = w_is_prev ? next_corner(from) : prev_corner(from);
  };
  if (has_left) {
    const std::uint32_t c = star.corner[left];
    remove(c, next_corner(c), vertex(prev_corner(c)), true);
  }
  if (has_right) {
    const std::uint32_t c = star.corner[right];
    remove(c, prev_corner(c), vertex(next_corner(c)), false);
  }
  if (seat_of_v != kNoCorner) seat(v, seat_of_v);
  state_[u] = kVertexDead;
}

/// The edge opposite c: its other side, and what of a line it is (bits as those of corner 0).
void CollapseMesh::set_edge(std::uint32_t c, std::uint32_t across, unsigned lines) {
  CollapseFace& f = faces_[c >> 2];
  f.opposite[c & 3u] = across;
  f.state = (f.state & ~(unsigned{kStateBorder | kStateCrease} << (c & 3u))) | lines << (c & 3u);
  if (across != kNoCorner) faces_[across >> 2].opposite[across & 3u] = c;
}

/// The face of c = (u, a, b) becomes (u, a, m), and a new one, which is returned, (u, m, b). The edge a - b stays open.
std::uint32_t CollapseMesh::cut_face(std::uint32_t c, std::uint32_t m) {
  const auto g = static_cast<std::uint32_t>(faces_.size());
  const CollapseFace old = faces_[c >> 2];
  const std::uint32_t n = next_corner(c), p = prev_corner(c);
  const auto lines = [&](std::uint32_t d) { return old.state >> (d & 3u) & (kStateBorder | kStateCrease); };
  const std::uint32_t b = old.vertex[p & 3u];
  faces_.push_back({{old.vertex[c & 3u], m, b},
                    old.state & unsigned{kStateSynthetic},
                    {kNoCorner, kNoCorner, kNoCorner},
                    old.bound});
  faces_[c >> 2].vertex[p & 3u] = m;
  set_edge(4 * g + 1, old.opposite[n & 3u], lines(n));
  set_edge(4 * g + 2, n, 0);
  set_edge(n, 4 * g + 2, 0);
  set_edge(4 * g, kNoCorner, lines(c));
  if (corner_[b] == p) corner_[b] = 4 * g + 2;
  return g;
}

std::uint32_t CollapseMesh::split(std::uint32_t c, const Double3& at) {
  const auto m = static_cast<std::uint32_t>(vertices_.size());
  vertices_.push_back({at, 0.0});
  block_vertex_.push_back(kNoCorner);
  const std::uint32_t d = opposite(c);
  const auto lines = [&](std::uint32_t e) {
    return faces_[e >> 2].state >> (e & 3u) & (kStateBorder | kStateCrease);
  };
  const std::uint32_t g = cut_face(c, m);
  if (d == kNoCorner) {
    corner_.push_back(4 * g + 1);
    state_.push_back(kVertexOpen | kVertexBorder);
    return m;
  }
  corner_.push_back(prev_corner(c));
  state_.push_back(0);
  const std::uint32_t h = cut_face(d, m);
  set_edge(c, 4 * h, lines(c));
  set_edge(d, 4 * g, lines(d));
  return m;
}

void CollapseMesh::flip(std::uint32_t c) {
  const std::uint32_t d = opposite(c), cn = next_corner(c), cp = prev_corner(c), dn = next_corner(d),
                      dp = prev_corner(d);
  const std::uint32_t u = vertex(c), w = vertex(d), a = vertex(cn), b = vertex(cp);
  const auto lines = [&](std::uint32_t e) {
    return faces_[e >> 2].state >> (e & 3u) & (kStateBorder | kStateCrease);
  };
  const std::uint32_t across_a = opposite(dn), across_b = opposite(cn);
  const unsigned lines_a = lines(dn), lines_b = lines(cn);
  faces_[c >> 2].vertex[cp & 3u] = w;
  faces_[d >> 2].vertex[dp & 3u] = u;
  set_edge(c, across_a, lines_a);
  set_edge(d, across_b, lines_b);
  set_edge(cn, dn, 0);
  set_edge(dn, cn, 0);
  if (corner_[a] == dp) corner_[a] = cn;
  if (corner_[b] == cp) corner_[b] = dn;
}

void CollapseMesh::reserve(std::size_t faces) {
  faces_.reserve(faces);
  const std::size_t vertices =
      vertices_.size() + (faces > faces_.size() ? (faces - faces_.size() + 1) / 2 : 0);
  vertices_.reserve(vertices), corner_.reserve(vertices);
  block_vertex_.reserve(vertices), state_.reserve(vertices);
}

void CollapseMesh::compact(std::vector<std::uint32_t>& kept) {
  kept.clear();
  std::vector<std::uint32_t> vertex_now(vertices_.size(), kNoCorner), face_now(faces_.size(), kNoCorner);
  for (std::uint32_t v = 0; v < vertices_.size(); ++v) {
    if (state_[v] & kVertexDead) continue;
    vertex_now[v] = static_cast<std::uint32_t>(kept.size());
    kept.push_back(v);
  }
  std::uint32_t faces = 0;
  for (std::size_t f = 0; f < faces_.size(); ++f)
    if (!(faces_[f].state & kStateDead)) face_now[f] = faces++;
  const auto corner_now = [&](std::uint32_t c) {
    return c == kNoCorner ? c : 4 * face_now[c >> 2] + (c & 3u);
  };
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    if (face_now[f] == kNoCorner) continue;
    CollapseFace face = faces_[f];
    for (std::size_t i = 0; i < 3; ++i) {
      face.vertex[i] = vertex_now[face.vertex[i]];
      face.opposite[i] = corner_now(face.opposite[i]);
    }
    faces_[face_now[f]] = face;
  }
  faces_.resize(faces);
  for (std::size_t i = 0; i < kept.size(); ++i) {
    vertices_[i] = vertices_[kept[i]];
    corner_[i] = corner_now(corner_[kept[i]]);
    block_vertex_[i] = block_vertex_[kept[i]];
    state_[i] = state_[kept[i]];
  }
  vertices_.resize(kept.size()), corner_.resize(kept.size());
  block_vertex_.resize(kept.size()), state_.resize(kept.size());
}

void CollapseMesh::shrink() {
  std::vector<std::uint32_t> kept;
  compact(kept);
  faces_.shrink_to_fit(), vertices_.shrink_to_fit();
  corner_.shrink_to_fit(), block_vertex_.shrink_to_fit(), state_.shrink_to_fit();
}

void CollapseMesh::sort_by_position(std::vector<std::uint32_t>& kept) {
  compact(kept);
  const std::size_t n = vertices_.size();
  const std::vector<std::uint64_t> order = in_morton_order(n, [&](std::size_t v) { return vertices_[v].at; });
  std::vector<std::uint32_t> vertex_now(n), number(n);
  for (std::size_t i = 0; i < n; ++i) {
    number[i] = static_cast<std::uint32_t>(order[i]);
    vertex_now[number[i]] = static_cast<std::uint32_t>(i);
  }
  const auto arranged = [&](auto& list) {
    auto sorted = list;
    for (std::size_t i = 0; i < n; ++i) sorted[i] = list[number[i]];
    std::copy(sorted.begin(), sorted.end(), list.begin());  // the room that is reserved stays
  };
  arranged(vertices_), arranged(corner_), arranged(block_vertex_), arranged(state_), arranged(kept);
  // Faces by their lowest vertex, of one vertex as they were.
  const Lists<std::uint32_t> faces = make_lists<std::uint32_t>(n, [&](const auto& put) {
    for (std::uint32_t f = 0; f < faces_.size(); ++f) {
      const std::uint32_t* v = faces_[f].vertex;
      put(std::min({vertex_now[v[0]], vertex_now[v[1]], vertex_now[v[2]]}), f);
    }
  });
  std::vector<std::uint32_t> face_now(faces_.size());
  for (std::uint32_t i = 0; i < faces.item.size(); ++i) face_now[faces.item[i]] = i;
  const std::vector<CollapseFace> before(faces_.begin(), faces_.end());
  const auto corner_now = [&](std::uint32_t c) {
    return c == kNoCorner ? c : 4 * face_now[c >> 2] + (c & 3u);
  };
  for (std::size_t f = 0; f < before.size(); ++f) {
    CollapseFace& face = faces_[face_now[f]];
    face = before[f];
    for (std::size_t i = 0; i < 3; ++i) {
      face.vertex[i] = vertex_now[face.vertex[i]];
      face.opposite[i] = corner_now(face.opposite[i]);
    }
  }
  for (std::uint32_t& c : corner_) c = corner_now(c);
}

}  // namespace tessera
