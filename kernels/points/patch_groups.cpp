#include "kernels/points/patch_groups.h"

namespace tessera {

PatchGroups group_patches(std::span<const std::uint64_t> weight, const std::vector<PatchVote>& links,
                          const ContractionLimits& limits) {
  const Contraction tree = contract_signs(weight, links, limits);
  PatchGroups groups{
      std::vector<std::uint32_t>(weight.size()), std::vector<std::int8_t>(weight.size(), 1), {}};
  for (const std::uint32_t p : tree.joined_last) {
    const std::uint32_t parent = tree.parent[p];
    if (parent == p) {
      groups.of[p] = groups.count();
      groups.size.push_back(0);
    } else {
      groups.of[p] = groups.of[parent];
      groups.sign[p] = static_cast<std::int8_t>(groups.sign[parent] * tree.relation[p]);
    }
    groups.size[groups.of[p]] += weight[p];
  }
  return groups;
}

void tear_groups(std::span<const PatchVote> sides, std::span<const std::uint64_t> weight, double clear,
                 PatchGroups& groups) {
  std::vector<std::int64_t> shown(groups.count(), 0);
  for (const PatchVote& v : sides) shown[groups.of[v.a]] += v.same - v.opposite;
  for (const PatchVote& v : sides) {
    std::uint32_t& group = groups.of[v.a];
    const std::int64_t against = shown[group] < 0 ? v.same : v.opposite;
    if (static_cast<double>(against) < clear * static_cast<double>(v.same + v.opposite)) continue;
    groups.size[group] -= weight[v.a];
    group = groups.count();
    groups.size.push_back(weight[v.a]);
  }
}

}  // namespace tessera
