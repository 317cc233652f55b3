/// \file collapse_mesh.h
/// A corner table that halfedge collapses edit in place: one half of a cache line per face. Only splits, which remeshing
/// does, allocate after construction.
///
///            b                      corner c = 4 f + i is corner i of face f, at vertex(c) = u here;
///          /   \                    next_corner(c) is at a, prev_corner(c) at b: counter-clockwise from outside
///    f   /       \                  opposite(c): the corner across the edge a-b, kNoCorner where the block
///      /c          \                or the surface ends
///     u ----------- a
///
/// Star of u: faces f_i = (u, w_i, w_i+1), counter-clockwise; closed where w_k = w_0.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "octree/portable_math.h"

namespace tessera {

inline constexpr std::uint32_t kNoCorner = 0xffffffffu;
inline constexpr std::size_t kMaxRing = 62;  ///< a vertex with more neighbours is never removed

[[nodiscard]] constexpr std::uint32_t next_corner(std::uint32_t c) {
  return (c & 3u) == 2u ? c - 2 : c + 1;
}
[[nodiscard]] constexpr std::uint32_t prev_corner(std::uint32_t c) {
  return (c & 3u) == 0u ? c + 2 : c - 1;
}

/// Whether indices of vertices and of corners, which are 4 face + 0, 1 or 2, fit into 32 bits beside kNoCorner.
[[nodiscard]] constexpr bool fits_collapse_mesh(std::size_t vertices, std::size_t faces) {
  return vertices < kNoCorner && faces <= kNoCorner / 4;
}

/// Bits of CollapseFace::state. Border and crease are per edge: shifted by the corner opposite the edge.
enum FaceState : std::uint32_t {
  kStateBorder = 1,  ///< << 0, 1, 2
  kStateCrease = 8,  ///< << 0, 1, 2
  kStateSynthetic = 64,
  kStateDead = 128,
  kStateDone = 256,     ///< kFaceDone
  kStateUnasked = 512,  ///< for the owner of the mesh: it may meet others
};

/// Bits of CollapseMesh::state.
enum VertexState : std::uint8_t {
  kVertexLocked = 1,    ///< the star is not complete, or not one fan
  kVertexBorder = 2,    ///< the surface ends here
  kVertexCrease = 4,    ///< exactly two crease edges
  kVertexFixed = 8,     ///< a corner: never removed, may be collapsed into
  kVertexOpen = 16,     ///< the fan is not closed in the block: border or locked
  kVertexPinched = 32,  ///< more than one fan: nothing may collapse into it either
  kVertexDead = 64,
  kVertexKept = kVertexLocked | kVertexFixed | kVertexDead,  ///< never removed (again)
};

/// The star of one vertex, copied out.
struct Star {
  std::size_t faces = 0;  ///< ring has `faces` vertices where closed, one more where open
  bool closed = false;
  std::array<std::uint32_t, kMaxRing + 2> ring;    ///< w_i; whole registers of eight
  std::array<std::uint32_t, kMaxRing + 1> corner;  ///< corner of the centre in f_i
  [[nodiscard]] std::size_t ring_size() const { return closed ? faces : faces + 1; }
  /// The place after i in the ring.
  [[nodiscard]] std::size_t following(std::size_t i) const { return i + 1 < ring_size() ? i + 1 : 0; }
};

struct alignas(32) CollapseFace {
  std::uint32_t vertex[3];
  std::uint32_t state;
  std::uint32_t opposite[3];
  float bound;  ///< MeshBlock::face_bound
};

struct alignas(32) CollapseVertex {
  Double3 at{};
  double error = 0.0;  ///< for the owner of the mesh: what the vertex costs where it is
};

class CollapseMesh {
 public:
  enum class Order : std::uint8_t {
    kByPosition,  ///< Morton order of the places of vertices, for the caches
    kNearEnough   ///< the order of the block where that is canonical and comes close to one of places
  };
  /// Takes over the block with vertices and faces in this order.
  /// \param origin  subtracted from all positions
  /// \throws InputError  an edge with more than two faces, or two in the same direction
  CollapseMesh(const MeshBlock& block, const Double3& origin, Order order = Order::kByPosition);

  [[nodiscard]] std::size_t vertices() const { return vertices_.size(); }
  [[nodiscard]] std::uint32_t vertex(std::uint32_t c) const { return faces_[c >> 2].vertex[c & 3u]; }
  [[nodiscard]] std::uint32_t opposite(std::uint32_t c) const { return faces_[c >> 2].opposite[c & 3u]; }
  [[nodiscard]] const CollapseFace& face(std::size_t f) const { return faces_[f]; }
  CollapseFace& face(std::size_t f) { return faces_[f]; }
  [[nodiscard]] std::span<const CollapseFace> faces() const { return faces_; }
  [[nodiscard]] const CollapseVertex& node(std::uint32_t v) const { return vertices_[v]; }
  CollapseVertex& node(std::uint32_t v) { return vertices_[v]; }
  [[nodiscard]] const Double3& at(std::uint32_t v) const { return vertices_[v].at; }
  [[nodiscard]] std::uint8_t state(std::uint32_t v) const { return state_[v]; }
  void add_state(std::uint32_t v, unsigned bits) { state_[v] = static_cast<std::uint8_t>(state_[v] | bits); }
  void drop_state(std::uint32_t v, unsigned bits) {
    state_[v] = static_cast<std::uint8_t>(state_[v] & ~bits);
  }
  /// A corner of the vertex, the first of its fan where that is open.
  [[nodiscard]] std::uint32_t corner(std::uint32_t v) const { return corner_[v]; }
  [[nodiscard]] std::uint32_t block_vertex(std::uint32_t v) const {
    return block_vertex_[v];
  }  ///< its index in the block

  /// \return false if the vertex has more than kMaxRing faces
  bool gather(std::uint32_t u, Star& star) const;

  /// Calls `visit(w)` for each neighbour of v in the fan of its corner.
  template <class Visit>
  void for_each_neighbour(std::uint32_t v, const Visit& visit) const {
    const std::uint32_t first = corner_[v];
    for (std::uint32_t c = first;;) {
      visit(vertex(next_corner(c)));
      const std::uint32_t o = opposite(next_corner(c));
      if (o == kNoCorner) return visit(vertex(prev_corner(c)));
      c = next_corner(o);
      if (c == first) return;
    }
  }

  // The edge opposite a corner.
  [[nodiscard]] bool border_edge(std::uint32_t c) const {
    return (faces_[c >> 2].state & (kStateBorder << (c & 3u))) != 0;
  }
  [[nodiscard]] bool crease_edge(std::uint32_t c) const {
    return (faces_[c >> 2].state & (kStateCrease << (c & 3u))) != 0;
  }
  [[nodiscard]] bool done(std::size_t f) const { return (faces_[f].state & kStateDone) != 0; }
  void mark_done(std::size_t f) { faces_[f].state |= kStateDone; }
  void unsettle(std::size_t f) { faces_[f].state &= ~unsigned{kStateDone}; }
  void mark_crease(std::uint32_t c) { faces_[c >> 2].state |= kStateCrease << (c & 3u); }
  void unmark_crease(std::uint32_t c) { faces_[c >> 2].state &= ~(unsigned{kStateCrease} << (c & 3u)); }

  /// Removes the centre of the star: every f_i that has not w_at becomes (w_at, w_i, w_i+1).
  /// \pre the collapse is legal
  void collapse(const Star& star, std::size_t at);

  /// Puts a new vertex on the edge opposite corner c; each face there becomes two. Both halves are the line that the
  /// edge was. Its block_vertex() is kNoCorner. \pre the edge has two faces, or one and is a border
  std::uint32_t split(std::uint32_t c, const Double3& at);

  /// Turns the edge opposite corner c into the one between the corners across it.
  /// \pre the edge has two faces and is no line; the new one does not exist yet
  void flip(std::uint32_t c);

  /// Room for so many faces, with as many vertices as they have.
  void reserve(std::size_t faces);

  /// Closes the gaps that dead vertices and faces left; the order stays.
  /// \param[out] kept  the vertices that are left, as they were numbered before: ascending
  void compact(std::vector<std::uint32_t>& kept);
  /// The same, and gives back the memory of those that were there.
  void shrink();

  /// The same, and vertices and faces get the Morton order of their places again: splits append theirs at the end, far from
  /// their neighbours. Allocates about 60 bytes a face for a while. \param[out] kept  per vertex, its number before
  void sort_by_position(std::vector<std::uint32_t>& kept);

 private:
  void number_vertices(const MeshBlock& block, const Double3& origin, Order order,
                       std::vector<std::uint32_t>& slot);
  void copy_faces(const MeshBlock& block);
  void fill_faces(const MeshBlock& block, const std::vector<std::uint32_t>& slot);
  void match_edges(const MeshBlock& block);
  void find_fans();
  void join(std::uint32_t a, std::uint32_t b, unsigned lost_flags);
  void seat(std::uint32_t v, std::uint32_t c);
  std::uint32_t cut_face(std::uint32_t c, std::uint32_t m);
  void set_edge(std::uint32_t c, std::uint32_t across, unsigned lines);

  std::vector<CollapseFace> faces_;
  std::vector<CollapseVertex> vertices_;
  std::vector<std::uint32_t> corner_, block_vertex_;
  std::vector<std::uint8_t> state_;
};

}  // namespace tessera
