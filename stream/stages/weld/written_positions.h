/// \file written_positions.h
/// Where the output of a job holds what lies on the lattice.
#pragma once
#include <functional>

#include "octree/lattice.h"
#include "stream/runtime/stage.h"

namespace tessera {

struct WrittenPositions {
  Lattice lattice;
  Double3 shift = {0, 0, 0};   ///< subtracted from all positions
  Double3 origin = {0, 0, 0};  ///< of formats of floats: what these are offsets from
  bool floats = false;         ///< positions are rounded to floats; else nothing is
  /// \param cells  of the lattice
  Double3 of(const Double3& cells) const {
    Double3 p;
    for (std::size_t a = 0; a < 3; ++a) {
      p[a] = lattice.world(static_cast<int>(a), cells[a]) - shift[a];
      if (floats) p[a] = static_cast<double>(static_cast<float>(p[a] - origin[a]));
    }
    return p;
  }
};

using WrittenBy = std::function<WrittenPositions(const JobState&)>;

}  // namespace tessera
