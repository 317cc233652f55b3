/// \file border_shift.h
/// How far the vertices at the end of the surface move onto the border (field/border.h): all the way, or as far as no
/// face of their star turns over or shrinks to nothing.
#pragma once
#include "kernels/extract/brick_band.h"
#include "kernels/extract/cell_loops.h"
#include "kernels/extract/loop_triangulation.h"
#include "kernels/field/directed_field.h"

namespace tessera {

class BorderShift {
 public:
  /// \param corner  node coordinates of the brick's min corner relative to the block
  BorderShift(const DirectedField& field, const BrickBand& band, const Int3& corner)
      : field_(field), band_(band), corner_(corner) {}

  /// How far a vertex moves from its root: a pure function of the four cells around the lattice edge.
  /// \param node  relative to the brick, within [0, 64]
  Float3 of_vertex(const Int3& node, std::size_t axis, std::uint32_t root);
  /// Whether a vertex of the loop moves. If so, its triangles.
  bool triangulate(const std::uint8_t* edge, const std::uint32_t* root, std::size_t size, LoopTriangles& out);
  /// Triangles of the loop that triangulate() saw last were chosen for vertices that go all the way, and may cross where it
  /// twists. If they do where its vertices lie: others that do not, if there are. \param cell  within the brick
  void triangulate_crossing(const Int3& cell, const std::uint8_t* edge, const std::uint32_t* root,
                            std::size_t size, LoopTriangles& triangles);

 private:
  /// A corner of a loop and the way that the border wants it to go.
  struct Corner {
    Float3 point, shift;
  };
  Float3 wanted(std::uint32_t root) const;
  float share_in_cell(const Int3& cell, std::uint8_t edge);
  static Float3 gone(const Corner& corner, float share);
  static float min_area(const std::array<Corner, 3>& corners, float share, const Float3& normal);
  static float share_of_face(const std::array<Corner, 3>& corners, const Float3& normal);

  const DirectedField& field_;
  const BrickBand& band_;
  Int3 corner_;
  std::array<Corner, kCellEdges> corners_;  ///< of the loop at work
  Float3 normal_ = {0, 0, 0};
};

}  // namespace tessera
