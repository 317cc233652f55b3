#include "kernels/holes/boundary_loops.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr std::size_t kNone = ~std::size_t{0};

/// Where the edge begins that follows `e`, kNone if it is not there. A vertex of a manifold has one border edge out.
std::size_t next_of(const std::vector<BoundaryEdge>& border, const BoundaryEdge& e) {
  const auto next = std::lower_bound(border.begin(), border.end(), e.to,
                                     [](const BoundaryEdge& b, std::uint64_t v) { return b.from < v; });
  return next != border.end() && next->from == e.to ? static_cast<std::size_t>(next - border.begin()) : kNone;
}

HoleBoundary make_boundary(const std::vector<BoundaryEdge>& loop, const std::vector<Chord>& chords) {
  HoleBoundary out;
  std::vector<std::array<std::uint64_t, 2>> order;  // vertex, position in the loop
  for (const BoundaryEdge& e : loop) {
    order.push_back({e.from, order.size()});
    out.vertex.push_back(e.from);
    out.third.push_back(e.third);
  }
  std::sort(order.begin(), order.end());
  for (const auto& [v, i] : order) {
    auto c = std::lower_bound(chords.begin(), chords.end(), Chord{v, 0});
    for (; c != chords.end() && (*c)[0] == v; ++c) {
      const auto it = std::lower_bound(order.begin(), order.end(), std::array<std::uint64_t, 2>{(*c)[1], 0});
      if (it == order.end() || (*it)[0] != (*c)[1]) continue;
      const auto j = static_cast<std::uint32_t>((*it)[1]), k = static_cast<std::uint32_t>(i);
      out.taken.push_back({std::min(j, k), std::max(j, k)});
    }
  }
  std::sort(out.taken.begin(), out.taken.end());
  return out;
}

}  // namespace

EdgeRecord edge_record(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
  return {std::min(a, b), std::max(a, b), 2 * c + (a > b)};
}

void BoundaryMatcher::close() {
  if (faces_ == 1) {
    const bool down = open_.third & 1;
    border.push_back({down ? open_.low : open_.high, down ? open_.high : open_.low, open_.third >> 1});
  } else if (faces_ > 1) {
    chords.push_back({open_.low, open_.high});
  }
}

void BoundaryMatcher::add(const EdgeRecord& record) {
  if (faces_ != 0 && record.low == open_.low && record.high == open_.high) {
    ++faces_;
    return;
  }
  close();
  open_ = record;
  faces_ = 1;
}

void BoundaryMatcher::finish() {
  close();
  faces_ = 0;
  std::sort(border.begin(), border.end(),
            [](const BoundaryEdge& a, const BoundaryEdge& b) { return a.from < b.from; });
}

LoopCounts for_each_boundary_loop(const BoundaryMatcher& boundaries, std::uint64_t maximum,
                                  const std::function<void(HoleBoundary&&)>& use) {
  const std::vector<BoundaryEdge>& border = boundaries.border;
  LoopCounts counts;
  std::vector<std::uint8_t> seen(border.size(), 0);
  std::vector<BoundaryEdge> loop;
  for (std::size_t first = 0; first < border.size(); ++first) {
    if (seen[first]) continue;
    loop.clear();
    std::uint64_t length = 0;
    std::size_t at = first;
    do {
      seen[at] = 1;
      ++length;
      if (length <= maximum) loop.push_back(border[at]);
      at = next_of(border, border[at]);
    } while (at != kNone && !seen[at]);
    ++counts.loops;
    counts.longest = std::max(counts.longest, length);
    counts.broken += at != first;
    if (at == first && length <= maximum && length >= 3) use(make_boundary(loop, boundaries.chords));
  }
  return counts;
}

std::vector<HoleBoundary> short_boundary_loops(const BoundaryMatcher& boundaries, std::uint64_t first,
                                               std::uint64_t last, std::uint64_t maximum) {
  const std::vector<BoundaryEdge>& border = boundaries.border;
  std::vector<HoleBoundary> out;
  const auto from = [](const BoundaryEdge& b, std::uint64_t v) { return b.from < v; };
  const auto begin =
      static_cast<std::size_t>(std::lower_bound(border.begin(), border.end(), first, from) - border.begin());
  std::vector<BoundaryEdge> loop;
  for (std::size_t start = begin; start < border.size() && border[start].from < last; ++start) {
    loop.clear();
    std::size_t at = start;
    do {  // a loop of which another vertex is smaller belongs to that one
      loop.push_back(border[at]);
      at = next_of(border, border[at]);
    } while (at != kNone && at > start && loop.size() < maximum);
    if (at == start && loop.size() >= 3) out.push_back(make_boundary(loop, boundaries.chords));
  }
  return out;
}

}  // namespace tessera
