/// \file place_search.h
/// Where a vertex is best put among its neighbours: a pattern search (Hooke and Jeeves 1961) in a plane or along a line.
#pragma once
#include <array>
#include <utility>

#include "octree/vector.h"

namespace tessera {

struct PlaceSearch {
  double first_step = 0.0, last_step = 0.0;  ///< lengths: halved from the one to the other
  int steps = 0;                             ///< at most
  double gain = 0.0;                         ///< of the cost: less is no step
};

/// \param axes  steps go in eight directions between these two; one is zero where there is but a line
/// \param cost  of a place, 0 the best there can be; infinite where the vertex must not be   \param before  that of `from`
template <class Cost>
[[nodiscard]] Double3 search_place(const Double3& from, const std::pair<Double3, Double3>& axes,
                                   const PlaceSearch& search, double before, const Cost& cost) {
  constexpr std::array<std::array<double, 2>, 8> kDirections = {{{1, 0},
                                                                 {0.7071, 0.7071},
                                                                 {0, 1},
                                                                 {-0.7071, 0.7071},
                                                                 {-1, 0},
                                                                 {-0.7071, -0.7071},
                                                                 {0, -1},
                                                                 {0.7071, -0.7071}}};
  Double3 best = from;
  double least = before, width = search.first_step;
  for (int i = 0; i < search.steps && width > search.last_step && least > 0.0; ++i) {
    const Double3 centre = best;
    double found = least - search.gain;
    for (const auto& d : kDirections) {
      const Double3 p = centre + (axes.first * d[0] + axes.second * d[1]) * width;
      if (const double c = cost(p); c < found) found = c, best = p;
    }
    if (best == centre)
      width *= 0.5;
    else
      least = found;
  }
  return best;
}

}  // namespace tessera
