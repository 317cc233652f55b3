/// \file patch_components.h
/// Connected components of one patch, the first half of finding islands across all bricks.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/mesh/patch.h"

namespace tessera {

struct PatchComponents {
  std::uint32_t count = 0;
  /// Component of every own vertex, then of every foreign one. Numbered by first appearance in that order.
  std::vector<std::uint32_t> of_vertex;
  std::vector<std::uint32_t> vertices;  ///< own vertices per component
  std::vector<std::uint32_t> faces;     ///< faces per component
  std::vector<std::uint32_t> border;    ///< own vertices per component at which the surface ends
  std::vector<std::uint32_t> folded;    ///< own vertices per component at which it folds (count_folded)
};

/// Components of the patch's faces over shared vertices. Own vertices that only other bricks' faces use form
/// components without faces here; the seams join them. O(n) with path halving.
[[nodiscard]] PatchComponents find_components(const Patch& patch);

}  // namespace tessera
