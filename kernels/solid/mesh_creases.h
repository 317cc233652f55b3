/// \file mesh_creases.h
/// The sharp edges of meshes in a block of the lattice, cut at the faces of its cells, for extraction to follow (crease_lines.h).
///
/// Decisions about planes of the lattice are those of lattice_crossings.h: a vertex in a plane lies before it. Around every point
/// where a sharp edge passes a face of a cell the section of the mesh with the face is followed both ways, from triangle to
/// triangle, up to lattice edges. Where that fails (borders, edges of more than two faces, closed sections) extraction goes
/// without. What comes out depends on the triangles alone, in whatever order they come.
#pragma once
#include <span>
#include <vector>

#include "kernels/extract/crease_lines.h"
#include "kernels/solid/solid_field.h"

namespace tessera {

class MeshCreases {
 public:
  /// \param angle_deg  edges whose faces turn by more than this are sharp
  MeshCreases(const SolidBlock& block, double angle_deg);

  /// Faces of one operand; those away from the block may be left out.
  /// \param corner  per vertex, in quanta; those at one place become one
  /// \param normal  per face: unit, or zero where it has no area
  void add(std::uint8_t operand, std::span<const Long3> corner,
           std::span<const std::array<std::uint32_t, 3>> faces, std::span<const Float3> normal);

  /// \pre all faces that come within the block's cells [-1, cells] were added
  [[nodiscard]] CreaseLines lines();

  /// What faces take at most, and what comes of them, where no more than an edge a face is sharp.
  [[nodiscard]] static constexpr std::uint64_t bytes(std::uint64_t faces) { return 160 * faces; }

 private:
  struct SharpEdge {
    std::uint32_t a = 0, b = 0;  ///< vertices, the lesser position first
    std::array<std::uint32_t, 2> face{};
  };
  struct Crossing {
    std::uint32_t face = 0;  ///< CreaseChain::face
    std::uint32_t edge = 0;  ///< sharp edge
    std::size_t axis = 0;    ///< across the face
    std::int32_t plane = 0;  ///< node coordinate along it, global
    Double3 at{};            ///< cells from the min corner of that above the face
    Int3 cell{};             ///< above the face
  };

  std::uint32_t weld(std::uint8_t operand, const Long3& at);
  void grow();
  void count_faces_around();
  /// The other face at an edge; nothing (~0) unless there is just one, turned as this one is.
  [[nodiscard]] std::uint32_t across(std::uint32_t face, std::uint32_t from, std::uint32_t to) const;
  void find_sharp_edges();
  [[nodiscard]] std::uint32_t sharp_edge(std::uint32_t from, std::uint32_t to) const;
  void cut_edge(std::uint32_t edge, CreaseLines& lines);
  /// Crossings of different faces of the lattice at one place of the lattice edge between them, where bodies touch, or a vertex lies
  /// there: each of them would have a vertex at that place, in cells that do not see each other.
  void find_meetings();
  void trace_sections(CreaseLines& lines);
  [[nodiscard]] bool walk(const Crossing& from, std::uint32_t face, std::vector<std::uint32_t>& passed,
                          CreaseChain& chain, std::size_t end) const;
  [[nodiscard]] bool leave(const Crossing& at, std::uint32_t face, CreaseChain& chain, std::size_t end) const;
  [[nodiscard]] Double3 cross_plane(std::uint32_t a, std::uint32_t b, std::size_t axis, std::int32_t plane,
                                    const Int3& cell) const;
  void rank_vertices(CreaseLines& lines);
  /// \param beyond  so many cells beyond those of the lines
  [[nodiscard]] bool inside(const Int3& cell, int beyond = 0) const;

  SolidBlock block_;
  Long3 low_{}, high_{};  ///< in quanta: of the cells looked at
  float sharp_cos_, flag_cos_;
  std::vector<Long3> at_;              ///< per vertex
  std::vector<std::uint8_t> operand_;  ///< per vertex
  std::vector<std::uint32_t> table_;   ///< open addressing: vertices by place
  std::vector<std::array<std::uint32_t, 3>> faces_;
  std::vector<Float3> normal_;
  std::vector<std::uint32_t> first_face_;  ///< per vertex: one of its faces
  std::vector<std::uint8_t> flagged_;      ///< per vertex: normals around it turn
  std::vector<std::uint32_t> around_first_, around_;
  std::vector<SharpEdge> sharp_;                          ///< ascending by a, b
  std::vector<Crossing> crossings_;                       ///< by number
  std::vector<std::uint8_t> meets_;                       ///< per crossing: find_meetings()
  std::vector<std::uint32_t> edge_first_;                 ///< per sharp edge: its first crossing
  std::vector<std::uint32_t> of_vertex_;                  ///< per vertex: its number among those of the lines
  std::vector<std::array<std::uint32_t, 2>> piece_edge_;  ///< sharp edge, place in pieces
};

}  // namespace tessera
