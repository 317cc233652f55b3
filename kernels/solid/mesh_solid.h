/// \file mesh_solid.h
/// A triangle mesh as a solid: winding numbers, exact where it is closed, generalized where it is not.
#pragma once
#include "kernels/solid/border_winding.h"
#include "kernels/solid/line_windings.h"
#include "kernels/solid/solid_field.h"

namespace tessera {

class MeshSolid : public SolidOperand {
 public:
  /// The faces show outwards: tables and crossings of a mesh that is inside out are turned by who has them.
  /// \param border  a leaf far from it needs its sum at one node only: from there crossings tell the rest
  MeshSolid(LineWindings lines, BorderWinding border)
      : lines_(std::move(lines)), border_(std::move(border)) {}

  void windings(const Int3& leaf, std::span<const SolidCrossing> crossings, std::span<float> out,
                BorderRegions& regions) const override;
  [[nodiscard]] Double3 membrane_normal(const Double3& cells) const override;
  /// Appends the leaves of a block, relative to it, that the closing membrane may pass though no face does.
  /// \param occupied  per slot of the block: a crossing of this mesh is on an edge from the leaf's nodes
  void membrane_leaves(const SolidBlock& block, std::span<const std::uint8_t> occupied,
                       std::vector<Int3>& out) const;

  /// What winding numbers are at the first nodes of leaves that faces pass, shares of all that were looked at.
  struct Shares {
    double half =
        0.0;  ///< nearer to a half than to a whole: almost none of a solid with holes, almost all of an open sheet
    double inside = 0.0, turned = 0.0;  ///< above 1/2, and below -1/2, as of a solid whose faces show inwards
  };
  /// \param maximum  so many leaves at most, evenly chosen
  [[nodiscard]] Shares shares(std::size_t maximum) const;

  [[nodiscard]] const LineWindings& lines() const { return lines_; }
  [[nodiscard]] const BorderWinding& border() const { return border_; }

 private:
  void search(const SolidBlock& block, std::span<const std::uint8_t> occupied, const Int3& cube, int edge,
              std::vector<Int3>& out) const;
  /// How far the winding number at the first node of a cube of leaves is from 1/2, and how much it can
  /// change within the cube and one node around it. \pre no face passes
  bool may_pass(const Int3& leaf, int edge) const;

  LineWindings lines_;
  BorderWinding border_;
};

}  // namespace tessera
