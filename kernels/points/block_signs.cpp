#include "kernels/points/block_signs.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr std::uint64_t kOutsideWeight = std::uint64_t{1}
                                         << 60;  ///< everything joins outside, never the other way round

PatchVote seen_from(std::uint32_t a, std::uint32_t b, bool keep, const PatchVote& v) {
  return {std::min(a, b), std::max(a, b), keep ? v.same : v.opposite, keep ? v.opposite : v.same};
}

/// Loose groups are tied to others by votes that cancel out, if at all.
bool is_loose(const PatchVote& v) {
  return v.a >= PatchAnchor::kLoose || (v.b >= PatchAnchor::kLoose && v.b != PatchAnchor::kOutside);
}

}  // namespace

BlockSigns solve_block_signs(const SignBlock& block) {
  const auto& [group, sign, size] = block.groups;
  const auto patches = static_cast<std::uint32_t>(group.size());
  const std::uint32_t outside = block.groups.count();
  std::vector<PatchVote> votes;
  votes.reserve(block.links.size() + block.sides.size() + block.pairs.size());
  for (const PatchVote& v : block.links)
    if (group[v.a] != group[v.b])
      votes.push_back(seen_from(group[v.a], group[v.b], sign[v.a] * sign[v.b] > 0, v));
  std::vector<std::int64_t> shown(outside, 0);
  for (const PatchVote& v : block.sides) {
    votes.push_back({v.a, outside, v.same, v.opposite});
    shown[v.a] += v.same - v.opposite;
  }
  votes.insert(votes.end(), block.pairs.begin(), block.pairs.end());
  merge_votes(votes);
  std::vector<std::uint64_t> weight = size;
  weight.push_back(kOutsideWeight);
  std::vector<std::uint8_t> anchors(outside + 1, 0);
  for (std::uint32_t p = 0; p < patches; ++p) anchors[group[p]] |= block.border[p];
  anchors[outside] = 1;
  const SignSolution solution = solve_signs(weight, votes, anchors);

  BlockSigns out;
  std::vector<std::uint32_t> number(outside + 1, PatchAnchor::kOutside);
  for (std::uint32_t g = 0; g < outside; ++g)
    if (anchors[g] != 0) number[g] = static_cast<std::uint32_t>(out.weight.size()), out.weight.push_back(0);
  std::vector<PatchAnchor> hung(outside);
  std::vector<std::uint32_t> first(outside + 1, patches);
  for (std::uint32_t p = patches; p-- > 0;) first[solution.component[group[p]]] = p;
  for (std::uint32_t g = 0; g < outside; ++g) {
    const std::uint32_t root = solution.component[g];
    PatchAnchor& to = hung[g];
    to.anchor = anchors[root] != 0 ? number[root] : PatchAnchor::kLoose | first[root];
    to.sign = static_cast<std::int8_t>(solution.sign[g] * solution.sign[root]);
    to.uncertain = solution.uncertain[g];
    to.shown = static_cast<std::int8_t>(shown[g] > 0 ? 1 : shown[g] < 0 ? -1 : 0);
    if (root != outside && anchors[root] != 0) out.weight[to.anchor] += size[g];
  }
  out.patches.resize(patches);
  for (std::uint32_t p = 0; p < patches; ++p) {
    PatchAnchor a = hung[group[p]];
    a.sign = static_cast<std::int8_t>(a.sign * sign[p]);
    a.shown = static_cast<std::int8_t>(a.shown * sign[p]);
    out.patches[p] = a;
  }
  for (const PatchVote& v : block.links) {
    const PatchAnchor &a = out.patches[v.a], &b = out.patches[v.b];
    const bool keep = a.sign * b.sign > 0;
    if (a.anchor == b.anchor) {
      out.broken_votes += static_cast<std::uint64_t>(keep ? v.opposite : v.same);
      out.inner_votes += static_cast<std::uint64_t>(v.same + v.opposite);
    } else {
      out.links.push_back(seen_from(a.anchor, b.anchor, keep, v));
    }
  }
  merge_votes(out.links);
  std::erase_if(out.links, is_loose);
  for (const PatchVote& v : block.sides) {
    const PatchAnchor& a = hung[v.a];
    if (a.anchor >= PatchAnchor::kLoose) continue;
    out.sides.push_back(seen_from(a.anchor, PatchAnchor::kOutside, a.sign > 0, v));
  }
  for (const PatchVote& v : block.pairs) {
    const PatchAnchor &a = hung[v.a], &b = hung[v.b];
    if (a.anchor != b.anchor) out.sides.push_back(seen_from(a.anchor, b.anchor, a.sign * b.sign > 0, v));
  }
  std::erase_if(out.sides, is_loose);
  merge_votes(out.sides);
  return out;
}

void settle_doubt(const PatchGroups& groups, std::span<const PatchVote> links,
                  std::span<const std::int8_t> sign, std::span<const float> lean,
                  std::span<std::uint8_t> doubtful) {
  std::vector<std::uint8_t> decided(groups.count(), 0);
  for (std::size_t p = 0; p < doubtful.size(); ++p)
    if (doubtful[p] == 0 || lean[p] >= kClearLook) decided[groups.of[p]] = 1;
  std::vector<PatchVote> votes;
  for (const PatchVote& v : links) {
    const std::uint32_t a = groups.of[v.a], b = groups.of[v.b];
    if (a == b || (decided[a] != 0 && decided[b] != 0)) continue;
    const bool keep = sign[v.a] == sign[v.b];
    votes.push_back({a, b, keep ? v.same : v.opposite, keep ? v.opposite : v.same});
  }
  decide_told(votes, decided);
  for (std::size_t p = 0; p < doubtful.size(); ++p) doubtful[p] = decided[groups.of[p]] != 0 ? 0 : 1;
}

}  // namespace tessera
