/// \file winding_number.h
/// Generalised winding number of oriented, area-weighted points: about 1 inside a closed surface, 0 outside,
/// the part of the sphere of directions that the surface covers where it has holes. Source: Barill, Dickson,
/// Schmidt, Levin, Jacobson, "Fast Winding Numbers for Soups and Clouds", 2018. Change: which cells count as
/// far is fixed by the lattice instead of by a tree of the points and an opening angle.
///
///   w(x) = 1 / (4 pi)  sum m_i . (p_i - x) / max(|p_i - x|, kCore)^3
///
/// On every level a query takes the multipoles of those cells that are children of the neighbourhood (3^3) of
/// its parent cell and not adjacent to its own cell; leaves adjacent to its own are summed point by point.
/// All sums run in key order. So a value is a pure function of query, lattice and points: the same bits for
/// any block that holds the leaves around the query and the multipoles further out.
#pragma once
#include <span>

#include "octree/multipole.h"

namespace tessera {

/// Distance below which the field of a point grows no more, cells: far below what multipoles see, so that a
/// query on a point is defined.
inline constexpr float kDipoleCore = 0.5f;

class WindingField {
 public:
  /// \param tree  all dipoles, top level kMaxCellBits
  explicit WindingField(const MultipoleTree& tree) : far_(tree), near_(nullptr) {}
  /// \param far   all cells down to some level, without dipoles
  /// \param near  what lies below: top level far.leaf_bits(); complete for the leaves of `far` adjacent to the
  ///              queries, and with the dipoles of the near leaves adjacent to them
  WindingField(const MultipoleTree& far, const MultipoleTree& near) : far_(far), near_(&near) {}

  /// \param queries   quanta from the lattice origin; consecutive ones of the same leaf share their lists, so hand
  ///                  them in Morton order or at least leaf by leaf
  /// \param gradient  per cell, or empty
  /// \cost about 1 us a query beside a surface, plus 5 us a change of leaf
  void evaluate(std::span<const Int3> queries, std::span<float> value, std::span<Float3> gradient = {}) const;

 private:
  const MultipoleTree& far_;
  const MultipoleTree* near_;
};

}  // namespace tessera
