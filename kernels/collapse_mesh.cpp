#include "kernels/collapse_mesh.h"

#include <algorithm>
#include <string>

#include "octree/error.h"

namespace tessera {

CollapseMesh::CollapseMesh(const MeshBlock& block, const Double3& origin) {
  const std::size_t n = block.position.size(), m = block.faces.size();
  vertex.resize(3 * m);
  opposite.assign(3 * m, kNoCorner);
  corner.assign(n, kNoCorner);
  face_state.assign(m, 0);
  vertex_state.assign(n, 0);
  position.resize(n);
  for (std::size_t v = 0; v < n; ++v)
    for (std::size_t a = 0; a < 3; ++a) position[v][a] = block.position[v][a] - origin[a];
  // Flags 1, 2, 4 name the edges 01, 12, 20; they lie opposite corners 2, 0, 1.
  for (std::size_t f = 0; f < m; ++f) {
    for (std::size_t i = 0; i < 3; ++i) vertex[3 * f + i] = block.faces[f][i];
    const unsigned flags = block.face_flags[f];
    unsigned state = 0;
    if (flags & kFaceBorder01) state |= kStateBorder << 2;
    if (flags & kFaceBorder12) state |= kStateBorder << 0;
    if (flags & kFaceBorder20) state |= kStateBorder << 1;
    if (flags & kFaceSynthetic) state |= kStateSynthetic;
    face_state[f] = static_cast<std::uint8_t>(state);
  }
  // Edges grouped by their smaller vertex (counting sort), matched inside the group.
  std::vector<std::uint32_t> begin(n + 1, 0);
  const auto low = [&](std::uint32_t c) { return std::min(vertex[next_corner(c)], vertex[prev_corner(c)]); };
  const auto high = [&](std::uint32_t c) { return std::max(vertex[next_corner(c)], vertex[prev_corner(c)]); };
  for (std::uint32_t c = 0; c < 3 * m; ++c) ++begin[low(c) + 1];
  for (std::size_t v = 0; v < n; ++v) begin[v + 1] += begin[v];
  std::vector<std::uint32_t> edges(3 * m);
  {
    std::vector<std::uint32_t> at(begin.begin(), begin.end() - 1);
    for (std::uint32_t c = 0; c < 3 * m; ++c) edges[at[low(c)]++] = c;
  }
  for (std::size_t v = 0; v < n; ++v) {
    const auto first = edges.begin() + begin[v], last = edges.begin() + begin[v + 1];
    std::sort(first, last, [&](std::uint32_t c, std::uint32_t d) {
      return high(c) != high(d) ? high(c) < high(d) : c < d;
    });
    for (auto i = first; i != last;) {
      auto j = i + 1;
      while (j != last && high(*j) == high(*i)) ++j;
      if (j - i > 2 || (j - i == 2 && vertex[next_corner(i[0])] != vertex[prev_corner(i[1])]))
        throw InputError("decimation: the edge between vertices " + std::to_string(block.key[v]) + " and " +
                         std::to_string(block.key[high(*i)]) +
                         " has more than two faces, or two of the same direction; import the mesh first");
      if (j - i == 2) opposite[i[0]] = i[1], opposite[i[1]] = i[0];
      i = j;
    }
  }
  // Fans: one corner each; a vertex with corners outside its fan is pinched.
  std::vector<std::uint32_t> corners(n, 0);
  for (std::uint32_t c = 0; c < 3 * m; ++c) {
    ++corners[vertex[c]];
    if (corner[vertex[c]] == kNoCorner) corner[vertex[c]] = c;
  }
  for (std::uint32_t v = 0; v < n; ++v) {
    if (corner[v] == kNoCorner) {
      vertex_state[v] = kVertexDead;
      continue;
    }
    std::uint32_t first = corner[v], c = first;
    bool open = false;
    for (;;) {
      const std::uint32_t o = opposite[prev_corner(c)];
      if (o == kNoCorner) {
        open = true;
        break;
      }
      c = prev_corner(o);
      if (c == first) break;
    }
    corner[v] = c;
    first = c;
    std::uint32_t seen = 0;
    unsigned state = open ? unsigned{kVertexOpen} : 0u;
    if (open && !border_edge(prev_corner(first))) state |= kVertexLocked;
    for (;;) {
      ++seen;
      const std::uint32_t o = opposite[next_corner(c)];
      if (o == kNoCorner) {
        if (!border_edge(next_corner(c))) state |= kVertexLocked;
        break;
      }
      c = next_corner(o);
      if (c == first) break;
    }
    if (seen != corners[v]) state |= kVertexPinched | kVertexLocked;
    if (open) state |= kVertexBorder;
    vertex_state[v] = static_cast<std::uint8_t>(state);
  }
}

bool CollapseMesh::gather(std::uint32_t u, Star& star) const {
  const std::uint32_t first = corner[u];
  std::uint32_t c = first;
  std::size_t k = 0;
  for (;;) {
    if (k == kMaxRing) return false;
    star.corner[k] = c;
    star.ring[k] = vertex[next_corner(c)];
    ++k;
    const std::uint32_t o = opposite[next_corner(c)];
    if (o == kNoCorner) {
      star.ring[k] = vertex[prev_corner(c)];
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

/// The edges opposite corners a and b become one.
void CollapseMesh::join(std::uint32_t a, std::uint32_t b) {
  const auto bits = [&](std::uint32_t c) {
    return c == kNoCorner
               ? 0u
               : (static_cast<unsigned>(face_state[c / 3]) >> (c % 3)) & (kStateBorder | kStateCrease);
  };
  const unsigned both = bits(a) | bits(b);
  if (a != kNoCorner) {
    opposite[a] = b;
    face_state[a / 3] = static_cast<std::uint8_t>(face_state[a / 3] | both << a % 3);
  }
  if (b != kNoCorner) {
    opposite[b] = a;
    face_state[b / 3] = static_cast<std::uint8_t>(face_state[b / 3] | both << b % 3);
  }
}

/// Makes c, or where the fan is open the first corner of c's fan, the corner of v.
void CollapseMesh::seat(std::uint32_t v, std::uint32_t c) {
  if (vertex_state[v] & kVertexOpen)
    for (std::uint32_t o = opposite[prev_corner(c)]; o != kNoCorner; o = opposite[prev_corner(c)])
      c = prev_corner(o);
  corner[v] = c;
}

void CollapseMesh::collapse(const Star& star, std::size_t at) {
  const std::uint32_t v = star.ring[at];
  const std::size_t k = star.faces;
  // The face on the left of u -> v is f_at = (u, v, w_at+1); on the right f_at-1 = (u, w_at-1, v).
  const bool has_left = star.closed || at < k, has_right = star.closed || at > 0;
  const std::size_t left = at, right = at > 0 ? at - 1 : k - 1;
  const auto kill = [&](std::size_t i) {
    face_state[star.corner[i] / 3] = static_cast<std::uint8_t>(face_state[star.corner[i] / 3] | kStateDead);
  };
  for (std::size_t i = 0; i < k; ++i)
    if (!(has_left && i == left) && !(has_right && i == right)) vertex[star.corner[i]] = v;
  std::uint32_t seat_of_v = kNoCorner;
  if (has_left) {
    const std::uint32_t c = star.corner[left], outer = opposite[c], inner = opposite[next_corner(c)];
    const std::uint32_t w = vertex[prev_corner(c)];
    // Flags of a removed border edge live on in the dead face: hand them to the face that stays.
    if (outer == kNoCorner && inner != kNoCorner && border_edge(c))
      face_state[inner / 3] = static_cast<std::uint8_t>(face_state[inner / 3] | kStateBorder << inner % 3);
    if (inner == kNoCorner && outer != kNoCorner && border_edge(next_corner(c)))
      face_state[outer / 3] = static_cast<std::uint8_t>(face_state[outer / 3] | kStateBorder << outer % 3);
    kill(left);
    join(outer, inner);
    // In the inner face the corner at w follows the corner opposite the edge (v, w); in the outer one it
    // precedes.
    if (inner != kNoCorner) {
      seat(w, prev_corner(inner));
      seat_of_v = next_corner(inner);
    } else if (outer != kNoCorner) {
      seat(w, next_corner(outer));
      seat_of_v = prev_corner(outer);
    }
  }
  if (has_right) {
    const std::uint32_t c = star.corner[right], outer = opposite[c], inner = opposite[prev_corner(c)];
    const std::uint32_t w = vertex[next_corner(c)];
    if (outer == kNoCorner && inner != kNoCorner && border_edge(c))
      face_state[inner / 3] = static_cast<std::uint8_t>(face_state[inner / 3] | kStateBorder << inner % 3);
    if (inner == kNoCorner && outer != kNoCorner && border_edge(prev_corner(c)))
      face_state[outer / 3] = static_cast<std::uint8_t>(face_state[outer / 3] | kStateBorder << outer % 3);
    kill(right);
    join(outer, inner);
    if (inner != kNoCorner) {
      seat(w, next_corner(inner));
      seat_of_v = prev_corner(inner);
    } else if (outer != kNoCorner) {
      seat(w, prev_corner(outer));
      seat_of_v = next_corner(outer);
    }
  }
  if (seat_of_v != kNoCorner) seat(v, seat_of_v);
  const std::uint32_t u = vertex[star.corner[has_left ? left : right]];
  vertex_state[u] = kVertexDead;
}

}  // namespace tessera
