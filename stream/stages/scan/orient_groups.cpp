#include "stream/stages/scan/orient_groups.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "stream/stages/scan/orient_viewers.h"

namespace tessera {
namespace {

/// Votes between groups at the sides of blocks, per link between blocks: a factory has 2.
constexpr std::uint64_t kVotesPerLink = 4;
constexpr std::size_t kMergeAt = 1u << 16;
constexpr std::int64_t kJoined = std::int64_t{1} << 40;  ///< more than any votes add up to

}  // namespace

JobGroups::JobGroups(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks,
                     const PatchLinks& links, const TaskContext& context) {
  std::vector<PatchVote> votes = links.outer();
  std::vector<std::uint32_t> border;
  for (const PatchVote& v : votes) border.push_back(v.a), border.push_back(v.b);
  std::sort(border.begin(), border.end());
  border.erase(std::unique(border.begin(), border.end()), border.end());
  std::vector<std::uint32_t> node(border.size());
  std::vector<std::int8_t> sign(border.size());
  std::vector<PatchVote> inner;
  std::size_t merge_at = kMergeAt;
  for (std::size_t i = 0, b = 0; i < border.size(); ++b) {
    context.check_stop();
    const std::uint64_t last = blocks[b].first_patch + blocks[b].patches;
    if (border[i] >= last) continue;
    std::vector<std::uint64_t> weight;
    for (const PatchStats& s : load_stats(overlay, blocks[b])) weight.push_back(s.surfels);
    const PatchGroups groups = links.groups(b, weight);
    const auto first = static_cast<std::uint32_t>(blocks[b].first_patch);
    std::map<std::uint32_t, std::uint32_t> nodes;
    const std::size_t begin = i;
    for (; i < border.size() && border[i] < last; ++i) nodes[groups.of[border[i] - first]] = 0;
    for (auto& [group, index] : nodes) {
      index = static_cast<std::uint32_t>(groups_.size());
      groups_.push_back({first + group, 0, 1, groups.size[group]});
    }
    for (const PatchVote& v : links.inner(b)) {
      const auto p = nodes.find(groups.of[v.a]), q = nodes.find(groups.of[v.b]);
      if (p == nodes.end() || q == nodes.end() || p == q) continue;
      const bool keep = groups.sign[v.a] * groups.sign[v.b] > 0;
      inner.push_back({std::min(p->second, q->second), std::max(p->second, q->second),
                       keep ? v.same : v.opposite, keep ? v.opposite : v.same});
    }
    if (inner.size() > merge_at) merge_votes(inner), merge_at = 2 * inner.size() + kMergeAt;
    for (std::size_t k = begin; k < i; ++k)
      node[k] = nodes.at(groups.of[border[k] - first]), sign[k] = groups.sign[border[k] - first];
  }
  const auto index_of = [&](std::uint32_t patch) {
    return std::lower_bound(border.begin(), border.end(), patch) - border.begin();
  };
  for (PatchVote& v : votes) {
    const auto p = static_cast<std::size_t>(index_of(v.a)), q = static_cast<std::size_t>(index_of(v.b));
    v.a = std::min(node[p], node[q]), v.b = std::max(node[p], node[q]);
    if (sign[p] * sign[q] < 0) std::swap(v.same, v.opposite);
  }
  votes.insert(votes.end(), inner.begin(), inner.end());
  inner = {};
  merge_votes(votes);
  std::vector<std::uint64_t> weight;
  for (const SharedGroup& g : groups_) weight.push_back(g.size);
  const PatchGroups joined = group_patches(weight, votes, kGroupLimits);
  first_shared_ = static_cast<std::uint32_t>(overlay.first_patch().back());
  size_ = joined.size;
  for (std::size_t g = 0; g < groups_.size(); ++g)
    groups_[g].shared = first_shared_ + joined.of[g], groups_[g].sign = joined.sign[g];
  by_shared_.resize(groups_.size());
  std::iota(by_shared_.begin(), by_shared_.end(), 0u);
  std::stable_sort(by_shared_.begin(), by_shared_.end(),
                   [&](std::uint32_t l, std::uint32_t r) { return groups_[l].shared < groups_[r].shared; });
}

std::uint64_t JobGroups::bytes(std::uint64_t outer) {
  return kVotesPerLink * outer * 3 * sizeof(PatchVote) + 2 * outer * 120 + (1u << 20);
}

const SharedGroup* JobGroups::find(std::uint32_t group) const {
  const auto at = std::lower_bound(groups_.begin(), groups_.end(), group,
                                   [](const SharedGroup& g, std::uint32_t k) { return g.group < k; });
  return at != groups_.end() && at->group == group ? &*at : nullptr;
}

void JobGroups::share_out(VisibilityVotes& votes) const {
  std::vector<PatchVote> sides;
  for (const PatchVote& v : votes.sides) {
    if (v.a < first_shared_) {
      sides.push_back(v);
      continue;
    }
    const double whole = static_cast<double>(size_[v.a - first_shared_]);
    for (auto k = first_of(v.a); k != by_shared_.end() && groups_[*k].shared == v.a; ++k) {
      const SharedGroup& g = groups_[*k];
      const auto part = [&](std::int64_t vote) {
        return static_cast<std::int64_t>(
            std::floor(static_cast<double>(vote) * (static_cast<double>(g.size) / whole) + 0.5));
      };
      const std::int64_t same = part(v.same), opposite = part(v.opposite);
      sides.push_back({g.group, v.b, g.sign > 0 ? same : opposite, g.sign > 0 ? opposite : same});
    }
  }
  merge_votes(sides);
  votes.sides = std::move(sides);
  for (PatchVote& v : votes.pairs) {
    const auto [a, a_sign] = of_block(v.a);
    const auto [b, b_sign] = of_block(v.b);
    v.a = std::min(a, b), v.b = std::max(a, b);
    if (a_sign * b_sign < 0) std::swap(v.same, v.opposite);
  }
  for (std::size_t k = 1; k < by_shared_.size(); ++k) {
    const SharedGroup &l = groups_[by_shared_[k - 1]], &r = groups_[by_shared_[k]];
    if (l.shared != r.shared) continue;
    const bool same = l.sign == r.sign;
    votes.pairs.push_back({l.group, r.group, same ? kJoined : 0, same ? 0 : kJoined});
  }
  merge_votes(votes.pairs);
}

std::vector<std::uint32_t>::const_iterator JobGroups::first_of(std::uint32_t shared) const {
  return std::lower_bound(by_shared_.begin(), by_shared_.end(), shared,
                          [&](std::uint32_t g, std::uint32_t k) { return groups_[g].shared < k; });
}

std::pair<std::uint32_t, std::int8_t> JobGroups::of_block(std::uint32_t group) const {
  if (group < first_shared_) return {group, std::int8_t{1}};
  const SharedGroup& g = groups_[*first_of(group)];
  return {g.group, g.sign};
}

}  // namespace tessera
