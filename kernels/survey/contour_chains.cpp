#include "kernels/survey/contour_chains.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace tessera {
namespace {

/// The way of one level through one face.
struct ContourStep {
  std::int64_t level;
  EdgeName from, to;
  Double2 from_point, to_point;
};

EdgeName edge_name(std::uint64_t a, std::uint64_t b) {
  return {std::min(a, b), std::max(a, b)};
}

/// Of the edge from its end with the smaller key: the same bits from either face. Monotone in the height.
Double2 crossing(const MeshBlock& block, std::uint32_t a, std::uint32_t b, double height) {
  if (block.key[a] > block.key[b]) std::swap(a, b);
  const Double3 &p = block.position[a], &q = block.position[b];
  const double t = std::clamp((height - p[2]) / (q[2] - p[2]), 0.0, 1.0);
  Double2 at{};
  for (std::size_t k = 0; k < 2; ++k)
    at[k] =
        t == 1.0 ? q[k] : std::clamp(p[k] + t * (q[k] - p[k]), std::min(p[k], q[k]), std::max(p[k], q[k]));
  return at;
}

void add_steps(const MeshBlock& block, const std::array<std::uint32_t, 3>& f, const ContourLevels& levels,
               std::int64_t first, std::int64_t end, std::vector<ContourStep>& steps) {
  const std::array<double, 3> z = {block.position[f[0]][2], block.position[f[1]][2], block.position[f[2]][2]};
  const std::int64_t from = std::max(first, levels.above(std::min({z[0], z[1], z[2]})));
  const double top = std::max({z[0], z[1], z[2]});
  for (std::int64_t level = from; level < end && levels.height(level) <= top; ++level) {
    const double height = levels.height(level);
    ContourStep step{level, {}, {}, {}, {}};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = (k + 1) % 3;
      const bool above = z[k] >= height, next_above = z[next] >= height;
      if (above == next_above) continue;
      const EdgeName name = edge_name(block.key[f[k]], block.key[f[next]]);
      const Double2 at = crossing(block, f[k], f[next], height);
      if (above) {
        step.from = name, step.from_point = at;
      } else {
        step.to = name, step.to_point = at;
      }
    }
    steps.push_back(step);
  }
}

/// Follows steps from `at` until none goes on or the first comes again; marks them.
ContourChain follow(const std::vector<ContourStep>& steps, const std::vector<std::size_t>& next,
                    std::size_t at, std::vector<std::uint8_t>& done) {
  ContourChain chain;
  chain.level = steps[at].level;
  chain.begin = chain.smallest = steps[at].from;
  chain.points.push_back(steps[at].from_point);
  for (const std::size_t first = at;;) {
    done[at] = 1;
    chain.end = steps[at].to;
    const std::size_t following = next[at];
    if (following == first) {
      chain.closed = true;
      chain.end = steps[at].from;
      break;
    }
    if (chain.end < chain.smallest) {
      chain.smallest = chain.end;
      chain.smallest_at = static_cast<std::uint32_t>(chain.points.size());
    }
    chain.points.push_back(steps[at].to_point);
    if (following == next.size() || done[following]) break;
    at = following;
  }
  return chain;
}

}  // namespace

std::int64_t ContourLevels::above(double at) const {
  auto k = static_cast<std::int64_t>(std::floor((at - base) / interval));
  while (height(k) > at) --k;
  while (height(k) <= at) ++k;
  return k;
}

std::vector<ContourChain> contour_chains(const MeshBlock& block, const ContourLevels& levels,
                                         std::int64_t first, std::int64_t end) {
  std::vector<ContourStep> steps;
  for (const auto& f : block.faces) add_steps(block, f, levels, first, end, steps);
  std::sort(steps.begin(), steps.end(), [](const ContourStep& a, const ContourStep& b) {
    return std::tie(a.level, a.from, a.to) < std::tie(b.level, b.from, b.to);
  });
  // The step that begins where this one ends, if there is one.
  std::vector<std::size_t> next(steps.size(), steps.size());
  std::vector<std::uint8_t> has_previous(steps.size()), done(steps.size());
  for (std::size_t s = 0; s < steps.size(); ++s) {
    const auto found = std::lower_bound(steps.begin(), steps.end(), steps[s],
                                        [](const ContourStep& a, const ContourStep& b) {
                                          return std::tie(a.level, a.from) < std::tie(b.level, b.to);
                                        });
    if (found == steps.end() || found->level != steps[s].level || found->from != steps[s].to) continue;
    next[s] = static_cast<std::size_t>(found - steps.begin());
    has_previous[next[s]] = 1;
  }
  std::vector<ContourChain> chains;
  // Open chains from their beginnings; then what is left goes round, and the first step met is that of the smallest name.
  for (std::size_t s = 0; s < steps.size(); ++s)
    if (!has_previous[s]) chains.push_back(follow(steps, next, s, done));
  for (std::size_t s = 0; s < steps.size(); ++s)
    if (!done[s]) chains.push_back(follow(steps, next, s, done));
  std::stable_sort(chains.begin(), chains.end(), [](const ContourChain& a, const ContourChain& b) {
    return std::tie(a.level, a.begin) < std::tie(b.level, b.begin);
  });
  return chains;
}

void remove_spikes(std::vector<Double2>& points, bool closed) {
  std::vector<Double2> kept;
  const auto add = [&](const Double2& p) {
    if (!kept.empty() && kept.back() == p) return;
    if (kept.size() >= 2 && kept[kept.size() - 2] == p) {
      kept.pop_back();
      return;
    }
    kept.push_back(p);
  };
  for (const Double2& p : points) add(p);
  if (closed) {
    // Across the joint.
    std::size_t first = 0;
    while (kept.size() - first >= 2) {
      if (kept.back() == kept[first] || (kept.size() - first >= 3 && kept[kept.size() - 2] == kept[first])) {
        kept.pop_back();
      } else if (kept.back() == kept[first + 1]) {
        ++first;
      } else {
        break;
      }
    }
    kept.erase(kept.begin(), kept.begin() + static_cast<std::ptrdiff_t>(first));
    if (kept.size() < 3) kept.clear();
  }
  if (!closed && kept.size() < 2) kept.clear();
  points = std::move(kept);
}

}  // namespace tessera
