#include "kernels/change/core_points.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace tessera {

std::vector<std::size_t> core_points(std::span<const Double3> points, double size) {
  struct Candidate {
    Double3 cell{};  ///< whole numbers
    double square = 0.0;
    std::size_t index = 0;
  };
  std::vector<Candidate> all(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    Candidate& c = all[i];
    c.index = i;
    for (std::size_t a = 0; a < 3; ++a) {
      c.cell[a] = std::floor(points[i][a] / size);
      const double d = points[i][a] - (c.cell[a] + 0.5) * size;
      c.square += d * d;
    }
  }
  std::sort(all.begin(), all.end(), [&](const Candidate& l, const Candidate& r) {
    if (l.cell != r.cell) return l.cell < r.cell;
    if (l.square != r.square) return l.square < r.square;
    const Double3 &p = points[l.index], &q = points[r.index];
    return p != q ? p < q : l.index < r.index;
  });
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < all.size(); ++k)
    if (k == 0 || all[k].cell != all[k - 1].cell) chosen.push_back(all[k].index);
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

}  // namespace tessera
