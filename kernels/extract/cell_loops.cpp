#include "kernels/extract/cell_loops.h"

namespace tessera {
namespace {

constexpr int corner_bit(int corner, int axis) {
  return corner >> axis & 1;
}

constexpr int edge_between(int corner_a, int corner_b) {
  const int diff = corner_a ^ corner_b;
  const int along = diff == 1 ? 0 : diff == 2 ? 1 : 2;
  return 4 * along + corner_bit(corner_a, (along + 1) % 3) + 2 * corner_bit(corner_a, (along + 2) % 3);
}

/// Corners of a face, counter-clockwise seen from outside the cell.
constexpr std::array<int, 4> face_cycle(int face) {
  const int a = face >> 1;
  const int u = 1 << (a + 1) % 3;
  const int v = 1 << (a + 2) % 3;
  const int base = (face & 1) << a;
  if (face & 1) return {base, base | u, base | u | v, base | v};
  return {base, base | v, base | u | v, base | u};
}

constexpr bool is_ambiguous(unsigned pattern, int face) {
  const std::array<int, 4> c = face_cycle(face);
  const auto in = [&](int i) { return (pattern >> c[static_cast<std::size_t>(i)] & 1) != 0; };
  return in(0) == in(2) && in(1) == in(3) && in(0) != in(1);
}

constexpr CellLoops trace(unsigned pattern, unsigned joined) {
  constexpr std::uint8_t kNone = 255;
  std::array<std::uint8_t, kCellEdges> next{};
  for (auto& n : next) n = kNone;
  for (int face = 0; face < 6; ++face) {
    const std::array<int, 4> c = face_cycle(face);
    // entry[i]: the boundary goes into the solid on the way to corner i; exit[i]: out of it after corner i
    const auto inside = [&](int i) { return (pattern >> c[static_cast<std::size_t>(i & 3)] & 1) != 0; };
    const auto edge = [&](int i) {
      return static_cast<std::size_t>(
          edge_between(c[static_cast<std::size_t>(i & 3)], c[static_cast<std::size_t>((i + 1) & 3)]));
    };
    const bool join = is_ambiguous(pattern, face) && (joined >> face & 1);
    for (int i = 0; i < 4; ++i) {
      if (inside(i) || !inside(i + 1)) continue;  // not an entry
      int out = i + 1;
      if (join) {
        out = i - 1 + 4;  // the exit before the outside corner i
      } else {
        while (inside(out + 1)) ++out;
      }
      next[edge(i)] = static_cast<std::uint8_t>(edge(out));
    }
  }
  CellLoops loops;
  int filled = 0;
  for (std::size_t first = 0; first < kCellEdges; ++first) {
    if (next[first] == kNone) continue;
    std::uint8_t length = 0;
    for (std::size_t e = first; next[e] != kNone;) {
      loops.edge[static_cast<std::size_t>(filled++)] = static_cast<std::uint8_t>(e);
      ++length;
      const std::size_t following = next[e];
      next[e] = kNone;
      e = following;
    }
    loops.length[loops.count++] = length;
  }
  return loops;
}

struct Tables {
  std::array<CellLoops, 256> loops{};
  std::array<std::uint8_t, 256> ambiguous{};
  std::array<std::array<std::uint8_t, kCellEdges>, kCellEdges> face{};
};

constexpr Tables make_tables() {
  Tables t;
  for (unsigned pattern = 0; pattern < 256; ++pattern) {
    t.loops[pattern] = trace(pattern, 0);
    for (int face = 0; face < 6; ++face)
      if (is_ambiguous(pattern, face)) t.ambiguous[pattern] |= static_cast<std::uint8_t>(1 << face);
  }
  for (auto& row : t.face)
    for (auto& f : row) f = 255;
  for (int face = 0; face < 6; ++face) {
    const std::array<int, 4> c = face_cycle(face);
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) {
        if (i == j) continue;
        t.face[static_cast<std::size_t>(edge_between(c[i], c[(i + 1) & 3]))]
              [static_cast<std::size_t>(edge_between(c[j], c[(j + 1) & 3]))] =
            static_cast<std::uint8_t>(face);
      }
    }
  }
  return t;
}

constexpr Tables kTables = make_tables();

}  // namespace

std::uint8_t ambiguous_faces(unsigned pattern) {
  return kTables.ambiguous[pattern];
}

const CellLoops& unambiguous_loops(unsigned pattern) {
  return kTables.loops[pattern];
}

CellLoops trace_loops(unsigned pattern, unsigned joined) {
  return trace(pattern, joined);
}

std::uint8_t joined_faces(unsigned pattern, const std::array<float, 8>& value) {
  std::uint8_t joined = 0;
  for (int face = 0; face < 6; ++face) {
    if (!is_ambiguous(pattern, face)) continue;
    const int a = face >> 1;
    const int u = 1 << (a + 1) % 3;
    const int v = 1 << (a + 2) % 3;
    const int base = (face & 1) << a;
    const auto at = [&](int corner) { return static_cast<double>(value[static_cast<std::size_t>(corner)]); };
    // Products of two floats are exact in double, so the sign of the difference is exact too.
    const double det = at(base) * at(base | u | v) - at(base | u) * at(base | v);
    const bool inside_on_main_diagonal = (pattern >> base & 1) != 0;
    if (inside_on_main_diagonal ? det > 0.0 : det < 0.0) joined |= static_cast<std::uint8_t>(1 << face);
  }
  return joined;
}

std::uint8_t common_face(int edge_a, int edge_b) {
  return kTables.face[static_cast<std::size_t>(edge_a)][static_cast<std::size_t>(edge_b)];
}

}  // namespace tessera
