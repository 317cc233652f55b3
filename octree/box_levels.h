/// \file box_levels.h
/// Boxes over boxes, for questions like "which of these may be near": a tree without pointers, and the ways down it.
#pragma once
#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <utility>
#include <vector>

namespace tessera {

/// \param boxes  at least one, in an order in which neighbours lie together; with `low` and `high`, three of each
/// \param children  of a box of the level above, one after the other; at least 2
/// \returns levels: the boxes themselves first, last one box around all
template <class Box>
[[nodiscard]] std::vector<std::vector<Box>> box_levels(std::vector<Box> boxes, std::size_t children) {
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

/// From a point to a box, zero inside.
template <class Box>
double square_to_box(const Box& box, const std::array<double, 3>& p) {
  double sum = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const double excess = std::max({0.0, double{box.low[a]} - p[a], p[a] - double{box.high[a]}});
    sum += excess * excess;
  }
  return sum;
}

/// What is still open: all children of one box a level.
inline constexpr std::size_t kBoxStack = 256;

/// Calls use(index) for boxes of the lowest level in which there is something to win, children of a box by their bounds, the
/// lowest first, equal ones from the last.
/// \param levels  box_levels(), with `children`
/// \param bound   (box) -> number: what there is in the box is not below it
/// \param wins    (bound) -> whether one so low may win still
template <class Box, class Bound, class Wins, class Use>
void visit_nearest_boxes(const std::vector<std::vector<Box>>& levels, std::size_t children,
                         const Bound& bound, const Wins& wins, const Use& use) {
  struct Entry {
    double bound;
    std::size_t level, index;
  };
  std::array<Entry, kBoxStack> stack;
  std::size_t top = 0;
  stack[top++] = {bound(levels.back()[0]), levels.size() - 1, 0};
  while (top > 0) {
    const Entry e = stack[--top];
    if (!wins(e.bound)) continue;
    if (e.level == 0) {
      use(e.index);
      continue;
    }
    const std::vector<Box>& below = levels[e.level - 1];
    const std::size_t first = top, end = std::min(below.size(), (e.index + 1) * children);
    assert(top + children <= stack.size());
    for (std::size_t c = e.index * children; c < end; ++c) {
      const Entry child = {bound(below[c]), e.level - 1, c};
      if (!wins(child.bound)) continue;
      std::size_t at = top++;  // the nearest on top
      for (; at > first && stack[at - 1].bound < child.bound; --at) stack[at] = stack[at - 1];
      stack[at] = child;
    }
  }
}

enum class BoxOrder { kAscending, kDescending };

/// Calls use(index) for boxes of the lowest level that `enters`, as do all above them, until one call returns false.
/// \param enters  (box) -> whether to look into it
template <class Box, class Enters, class Use>
void visit_boxes(const std::vector<std::vector<Box>>& levels, std::size_t children, BoxOrder order,
                 const Enters& enters, const Use& use) {
  std::array<std::pair<std::size_t, std::size_t>, kBoxStack> stack;  // level, index
  std::size_t top = 0;
  stack[top++] = {levels.size() - 1, 0};
  while (top > 0) {
    const auto [level, index] = stack[--top];
    if (!enters(levels[level][index])) continue;
    if (level == 0) {
      if (!use(index)) return;
      continue;
    }
    const std::size_t first = index * children, end = std::min(levels[level - 1].size(), first + children);
    assert(top + children <= stack.size());
    for (std::size_t c = first; c < end; ++c)
      stack[top++] = {level - 1, order == BoxOrder::kDescending ? c : first + end - 1 - c};
  }
}

}  // namespace tessera
