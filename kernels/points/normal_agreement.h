/// \file normal_agreement.h
/// Whether given normals have a common side: how often neighbours on one surface point to opposite sides of it.
/// Two faces of a thin wall do so rightly: there each neighbour lies behind the other, and across a narrow gap before it. On
/// one surface the neighbour of a wrong normal lies behind as often as before.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// A point and the normal that it came with, unit.
struct NormalSample {
  Double3 p{};
  Float3 n{};
};

struct NormalAgreement {
  std::uint64_t pairs = 0;    ///< of neighbours in the tangent plane whose normals are parallel up to sign
  std::uint64_t against = 0;  ///< of them, whose normals contradict each other
  std::uint64_t cells = 0;
  /// Of them, those in which normals of one side lie on this side of a line in the plane and those of the other on that:
  /// there the border of a region that is turned over passes. Few places tell of a large one.
  std::uint64_t split = 0;

  /// Members by name, for records of them.
  static void fields(auto& self, auto&& field) {
    field("pairs", self.pairs);
    field("against", self.against);
    field("cells", self.cells);
    field("split", self.split);
  }
  void add(const NormalAgreement& other) {
    pairs += other.pairs, against += other.against, cells += other.cells, split += other.split;
  }
  double share() const {
    return pairs == 0 ? 0.0 : static_cast<double>(against) / static_cast<double>(pairs);
  }
};

/// Each sample against its nearest neighbours in its tangent plane. \param cell  points of one place, a few dozen
/// \cost quadratic
[[nodiscard]] NormalAgreement compare_neighbours(std::span<const NormalSample> cell);

}  // namespace tessera
