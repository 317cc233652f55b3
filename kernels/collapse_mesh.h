/// \file collapse_mesh.h
/// A corner table that halfedge collapses edit in place: compact arrays, no allocation after construction.
///
///            b                      corner c of face f = c / 3 at vertex u = vertex[c]
///          /   \                    next(c) is at a, prev(c) at b: counter-clockwise from outside
///    f   /   f'  \                  opposite[c]: the corner across the edge a-b, kNoCorner where the block
///      /c    \     \                or the surface ends
///     u ------ a ---
///
/// Star of u: faces f_i = (u, w_i, w_i+1), counter-clockwise; closed where w_k = w_0.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/mesh_block.h"

namespace tessera {

inline constexpr std::uint32_t kNoCorner = 0xffffffffu;
inline constexpr std::size_t kMaxRing = 64;  ///< a vertex with more neighbours is never removed

constexpr std::uint32_t next_corner(std::uint32_t c) {
  return c % 3 == 2 ? c - 2 : c + 1;
}
constexpr std::uint32_t prev_corner(std::uint32_t c) {
  return c % 3 == 0 ? c + 2 : c - 1;
}

/// Bits of CollapseMesh::face_state. Per edge: border and crease, shifted by the corner opposite the edge.
enum FaceState : std::uint8_t {
  kStateBorder = 1,  ///< << 0, 1, 2
  kStateCrease = 8,  ///< << 0, 1, 2
  kStateSynthetic = 64,
  kStateDead = 128,
};

/// Bits of CollapseMesh::vertex_state.
enum VertexState : std::uint8_t {
  kVertexLocked = 1,    ///< the star is not complete, or not one fan
  kVertexBorder = 2,    ///< the surface ends here
  kVertexCrease = 4,    ///< exactly two crease edges
  kVertexFixed = 8,     ///< a corner: never removed, may be collapsed into
  kVertexOpen = 16,     ///< the fan is not closed in the block: border or locked
  kVertexPinched = 32,  ///< more than one fan: nothing may collapse into it either
  kVertexDead = 64,
};

/// The star of one vertex, copied out.
struct Star {
  std::size_t faces = 0;  ///< ring has `faces` vertices where closed, one more where open
  bool closed = false;
  std::array<std::uint32_t, kMaxRing + 1> ring;    ///< w_i
  std::array<std::uint32_t, kMaxRing + 1> corner;  ///< corner of the centre in f_i
  std::size_t ring_size() const { return closed ? faces : faces + 1; }
};

struct CollapseMesh {
  std::vector<std::uint32_t> vertex;     ///< 3m
  std::vector<std::uint32_t> opposite;   ///< 3m
  std::vector<std::uint32_t> corner;     ///< n: a corner of the vertex, the first of the fan where it is open
  std::vector<std::uint8_t> face_state;  ///< m
  std::vector<std::uint8_t> vertex_state;  ///< n
  std::vector<Double3> position;           ///< n, relative to the block

  /// \pre  block is canonical
  /// \throws InputError  an edge with more than two faces, or two in the same direction
  explicit CollapseMesh(const MeshBlock& block, const Double3& origin);

  /// \return false if the vertex has more than kMaxRing faces
  bool gather(std::uint32_t u, Star& star) const;

  bool border_edge(std::uint32_t opposite_corner) const {
    return (face_state[opposite_corner / 3] & (kStateBorder << opposite_corner % 3)) != 0;
  }
  bool crease_edge(std::uint32_t opposite_corner) const {
    return (face_state[opposite_corner / 3] & (kStateCrease << opposite_corner % 3)) != 0;
  }
  void mark_crease(std::uint32_t opposite_corner) {
    face_state[opposite_corner / 3] =
        static_cast<std::uint8_t>(face_state[opposite_corner / 3] | (kStateCrease << opposite_corner % 3));
  }

  /// Removes the centre of the star: every f_i that has not w_at becomes (w_at, w_i, w_i+1).
  /// \pre the collapse is legal
  void collapse(const Star& star, std::size_t at);

 private:
  void join(std::uint32_t a, std::uint32_t b);
  void seat(std::uint32_t v, std::uint32_t c);
};

}  // namespace tessera
