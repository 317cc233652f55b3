#include "solvers/rcm_ordering.h"

#include <algorithm>

namespace tessera {
namespace {

/// Rows reached from `root`, level by level, neighbours by ascending degree; `level` is -1 where not reached.
struct Levels {
  std::vector<std::int32_t> order;
  std::int32_t depth = 0;
};

Levels breadth_first(const SparseMatrix& a, std::int32_t root, std::vector<std::int32_t>& level) {
  Levels out;
  const auto degree = [&](std::int32_t i) { return a.start[i + 1] - a.start[i]; };
  out.order.push_back(root);
  level[root] = 0;
  for (std::size_t k = 0; k < out.order.size(); ++k) {
    const std::int32_t i = out.order[k];
    const std::size_t first = out.order.size();
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e)
      if (const std::int32_t j = a.column[e]; level[j] < 0) {
        level[j] = level[i] + 1;
        out.order.push_back(j);
      }
    std::sort(out.order.begin() + static_cast<std::ptrdiff_t>(first), out.order.end(),
              [&](std::int32_t x, std::int32_t y) {
                return degree(x) != degree(y) ? degree(x) < degree(y) : x < y;
              });
  }
  out.depth = level[out.order.back()];
  return out;
}

}  // namespace

std::vector<std::int32_t> reverse_cuthill_mckee(const SparseMatrix& a) {
  std::vector<std::int32_t> order, level(static_cast<std::size_t>(a.rows), -1);
  order.reserve(level.size());
  for (std::int32_t seed = 0; seed < a.rows; ++seed) {
    if (level[seed] >= 0) continue;
    Levels best = breadth_first(a, seed, level);
    for (;;) {  // depth grows every round
      const std::int32_t far = best.order.back();
      for (const std::int32_t i : best.order) level[i] = -1;
      Levels next = breadth_first(a, far, level);
      const bool deeper = next.depth > best.depth;
      best = std::move(next);
      if (!deeper) break;
    }
    order.insert(order.end(), best.order.begin(), best.order.end());
  }
  std::reverse(order.begin(), order.end());
  return order;
}

}  // namespace tessera
