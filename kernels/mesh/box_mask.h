/// \file box_mask.h
/// A grid of cells over a box, to pick what comes near something: boxes are marked, then boxes are asked.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

class BoxMask {
 public:
  /// \param cells  along each axis, > 0. What lies outside counts with the nearest cell.
  BoxMask(const Double3& low, const Double3& high, std::size_t cells)
      : low_(low), cells_(cells), set_(cells * cells * cells) {
    for (std::size_t k = 0; k < 3; ++k)
      per_cell_[k] = high[k] > low[k] ? static_cast<double>(cells) / (high[k] - low[k]) : 0.0;
  }
  void mark(const Double3& low, const Double3& high) {
    visit(low, high, [&](std::size_t i) {
      set_[i] = true;
      return false;
    });
  }
  /// Whether a cell of the box is marked: true wherever the box meets a marked one.
  bool meets(const Double3& low, const Double3& high) const {
    return visit(low, high, [&](std::size_t i) { return bool{set_[i]}; });
  }

 private:
  template <class Use>
  bool visit(const Double3& low, const Double3& high, const Use& use) const {
    std::array<std::size_t, 3> from, to;
    const double last = static_cast<double>(cells_) - 0.5;
    for (std::size_t k = 0; k < 3; ++k) {
      from[k] = static_cast<std::size_t>(std::clamp((low[k] - low_[k]) * per_cell_[k], 0.0, last));
      to[k] = static_cast<std::size_t>(std::clamp((high[k] - low_[k]) * per_cell_[k], 0.0, last));
    }
    for (std::size_t z = from[2]; z <= to[2]; ++z)
      for (std::size_t y = from[1]; y <= to[1]; ++y)
        for (std::size_t x = from[0]; x <= to[0]; ++x)
          if (use((z * cells_ + y) * cells_ + x)) return true;
    return false;
  }

  Double3 low_{}, per_cell_{};
  std::size_t cells_;
  std::vector<bool> set_;
};

}  // namespace tessera
