/// \file quadric_field.h
/// Quadric that fits all oriented, area-weighted points, near ones most: the surface where samples end.
/// Sources: Guennebaud, Germann, Gross, "Dynamic Sampling and Rendering of Algebraic Point Set Surfaces", 2008
/// (gradients fit the normals, then the value the positions); Mercier, Lescoat, Roussillon, Boubekeur, Thiery,
/// "Moving Level-of-Detail Surfaces", 2022 (a kernel without end, summed over a tree whose levels blend). Changes:
/// quadrics drawn towards the sphere instead of spheres, so that saddles and tubes go on as they are; levels blend by
/// the distance from the box of a lattice cell, so that a value is a pure function of query, lattice and points, and
/// continuous.
///
/// A point at distance d weighs area / (d^2 + core^2)^4. So the fit reaches as far as the gap is wide: beside the
/// rim it is the local surface, in the middle of a hole it is the quadric through all of its rim. Planes and spheres
/// are continued exactly, whatever is missing of them.
#pragma once
#include <span>

#include "octree/multipole.h"

namespace tessera {

struct QuadricValue {
  float distance = 0.0f;  ///< signed, cells, positive outside
  /// Part of the squared normals that the quadric does not explain: 0 on a sphere or plane, 1 where normals cancel
  /// out or there is no data.
  float misfit = 1.0f;
};

class QuadricField {
 public:
  /// \param far   all cells down to some level, without dipoles
  /// \param near  what lies below: see WindingField, same contract
  /// \param core  cells; one support radius makes it the local fit beside samples. > 0
  QuadricField(const MultipoleTree& far, const MultipoleTree& near, float core)
      : far_(far), near_(&near), core_(core) {}
  /// \param tree  all dipoles, top level kMaxCellBits
  QuadricField(const MultipoleTree& tree, float core) : far_(tree), near_(nullptr), core_(core) {}

  /// \param queries  as WindingField::evaluate() wants them
  void evaluate(std::span<const Int3> queries, std::span<QuadricValue> value) const;

 private:
  const MultipoleTree& far_;
  const MultipoleTree* near_;
  float core_;
};

}  // namespace tessera
