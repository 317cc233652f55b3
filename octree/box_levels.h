/// \file box_levels.h
/// Boxes over boxes, for questions like "which of these may be near": a tree without pointers.
#pragma once
#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace tessera {

/// \param boxes  at least one, in an order in which neighbours lie together; with `low` and `high`, three of each
/// \param children  of a box of the level above, one after the other; at least 2
/// \returns levels: the boxes themselves first, last one box around all
template <class Box>
std::vector<std::vector<Box>> box_levels(std::vector<Box> boxes, std::size_t children) {
  std::vector<std::vector<Box>> levels;
  levels.push_back(std::move(boxes));
  while (levels.back().size() > 1) {
    const std::vector<Box>& below = levels.back();
    std::vector<Box> next((below.size() + children - 1) / children);
    for (std::size_t b = 0; b < below.size(); ++b) {
      Box& box = next[b / children];
      if (b % children == 0) box = below[b];
      for (std::size_t a = 0; a < 3; ++a) {
        box.low[a] = std::min(box.low[a], below[b].low[a]);
        box.high[a] = std::max(box.high[a], below[b].high[a]);
      }
    }
    levels.push_back(std::move(next));
  }
  return levels;
}

}  // namespace tessera
