#include "stream/stages/scan/orient_anchors.h"

#include <algorithm>
#include <utility>

#include "stream/stages/scan/orient_tally.h"

namespace tessera {
namespace {

constexpr std::uint64_t kOutsideNode = std::uint64_t{1} << 60;  ///< weight: everything joins outside
constexpr int kKeyBits = 63;
/// Components of what hangs on nothing in a block, in a cube, in the last graph; 0 is what is known.
constexpr std::uint64_t kOfBlock = std::uint64_t{1} << 32, kOfCube = std::uint64_t{2} << 32,
                        kOfTop = std::uint64_t{3} << 32;

bool is_on_nothing(const PatchAnchor& a) {
  return a.anchor >= PatchAnchor::kLoose && a.anchor != PatchAnchor::kOutside;
}

PatchVote between(std::uint32_t a, std::uint32_t b, int sign, const PatchVote& v) {
  return {std::min(a, b), std::max(a, b), sign > 0 ? v.same : v.opposite, sign > 0 ? v.opposite : v.same};
}

std::size_t border_index(const OrientationScene& scene, std::uint32_t patch) {
  return static_cast<std::size_t>(std::lower_bound(scene.border.begin(), scene.border.end(), patch) -
                                  scene.border.begin());
}

}  // namespace

AnchorSigns::AnchorSigns(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks,
                         const PatchLinks& links, const OrientationScene& scene, const PatchAnchors& anchors,
                         const SightVotes* sight, const TaskContext& context, std::uint64_t limit) {
  list_cubes(overlay, blocks, anchors, limit);
  const std::vector<PatchVote> seen = sight != nullptr ? sight->outer() : std::vector<PatchVote>{};
  const auto for_outer = [&](const auto& use) {
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      context.check_stop();
      for (const PatchVote& v : links.outer(b)) use(v, true);
    }
    for (const PatchVote& v : seen) use(v, false);
  };
  ports_.resize(scene.border.size());
  for_outer([&](const PatchVote& v, bool) {
    if (cube_of(v.a) != cube_of(v.b))
      ports_[border_index(scene, v.a)].sign = ports_[border_index(scene, v.b)].sign = 1;
  });
  std::uint64_t broken = 0, all = 0;
  for (const AnchorsEntry& e : anchors.entries()) broken += e.broken_votes, all += e.inner_votes;

  std::vector<std::uint64_t> weight;
  std::vector<PatchVote> top_links, top_votes;
  for (Cube& cube : cubes_) {
    context.check_stop();
    cube.first_top = static_cast<std::uint32_t>(weight.size());
    BlockSigns signs = solve_cube(cube, blocks, links, scene, anchors, seen);
    broken += signs.broken_votes, all += signs.inner_votes;
    weight.insert(weight.end(), signs.weight.begin(), signs.weight.end());
    const auto shifted = [&](const PatchVote& v) {
      return PatchVote{cube.first_top + v.a,
                       v.b == PatchAnchor::kOutside ? PatchAnchor::kOutside : cube.first_top + v.b, v.same,
                       v.opposite};
    };
    for (const PatchVote& v : signs.links) top_links.push_back(shifted(v));
    for (const PatchVote& v : signs.sides) top_votes.push_back(shifted(v));
    cube.anchors = std::move(signs.patches);
  }
  outside_ = static_cast<std::uint32_t>(weight.size());
  for (std::vector<PatchVote>* votes : {&top_links, &top_votes})
    for (PatchVote& v : *votes) v.b = std::min(v.b, outside_);
  for_outer([&](const PatchVote& v, bool link) {
    const Port &p = ports_[border_index(scene, v.a)], &q = ports_[border_index(scene, v.b)];
    if (cube_of(v.a) != cube_of(v.b) && p.top != q.top)
      (link ? top_links : top_votes).push_back(between(p.top, q.top, p.sign * q.sign, v));
  });
  merge_votes(top_links);
  weight.push_back(kOutsideNode);
  top_votes.insert(top_votes.end(), top_links.begin(), top_links.end());
  merge_votes(top_votes);
  top_ = solve_signs(weight, top_votes);

  for (const PatchVote& v : top_links) {
    broken += static_cast<std::uint64_t>(top_.sign[v.a] == top_.sign[v.b] ? v.opposite : v.same);
    all += static_cast<std::uint64_t>(v.same + v.opposite);
  }
  // Links of anchors with what hangs on the outside of a block were sides of it in its cube.
  for (std::size_t b = 0; b < blocks.size(); ++b)
    for (const PatchVote& v : anchors.load<PatchVote>(b, &AnchorsEntry::links)) {
      if (v.b != PatchAnchor::kOutside) continue;
      PatchAnchor anchor;
      anchor.anchor = v.a;
      broken += static_cast<std::uint64_t>(of(b, anchor).sign > 0 ? v.opposite : v.same);
      all += static_cast<std::uint64_t>(v.same + v.opposite);
    }
  frustrated_ = share_of(broken, all);
}

void AnchorSigns::list_cubes(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks,
                             const PatchAnchors& anchors, std::uint64_t limit) {
  const auto key = [&](std::size_t b) { return overlay.bricks()[blocks[b].first_brick].key; };
  const auto split = [&](const auto& self, std::size_t first, std::size_t last, int bits) -> void {
    std::uint64_t count = 0;
    for (std::size_t b = first; b < last; ++b)
      count += anchors.entries()[b].weight.bytes / sizeof(std::uint64_t);
    if (count <= limit || last - first == 1 || bits == 0) {
      cubes_.push_back({first, last, 0, {}});
      first_patch_.push_back(blocks[first].first_patch);
      return;
    }
    for (std::size_t begin = first; begin < last;) {
      std::size_t end = begin + 1;
      while (end < last && key(end) >> (bits - 3) == key(begin) >> (bits - 3)) ++end;
      self(self, begin, end, bits - 3);
      begin = end;
    }
  };
  if (!blocks.empty()) split(split, 0, blocks.size(), kKeyBits);
  first_patch_.push_back(overlay.first_patch().back());
  for (std::size_t c = 0; c < cubes_.size(); ++c) {
    std::uint32_t first = 0;
    for (std::size_t b = cubes_[c].first_block; b < cubes_[c].last_block; ++b) {
      block_patch_.push_back(blocks[b].first_patch);
      cube_of_block_.push_back(c), first_anchor_.push_back(first);
      first += static_cast<std::uint32_t>(anchors.entries()[b].weight.bytes / sizeof(std::uint64_t));
    }
  }
}

std::size_t AnchorSigns::cube_of(std::uint32_t patch) const {
  return static_cast<std::size_t>(std::upper_bound(first_patch_.begin(), first_patch_.end() - 1, patch) -
                                  first_patch_.begin()) -
         1;
}

/// Contracts the anchors of a cube's blocks, and tells the ports of its border where they are now.
BlockSigns AnchorSigns::solve_cube(const Cube& cube, const std::vector<PatchBlock>& blocks,
                                   const PatchLinks& links, const OrientationScene& scene,
                                   const PatchAnchors& anchors, const std::vector<PatchVote>& seen) {
  SignBlock in;
  const std::size_t index = static_cast<std::size_t>(&cube - cubes_.data());
  const std::size_t first = border_index(scene, static_cast<std::uint32_t>(first_patch_[index]));
  const std::size_t last = border_index(scene, static_cast<std::uint32_t>(first_patch_[index + 1]));
  std::vector<std::pair<std::uint32_t, std::int8_t>> node(last - first);
  std::size_t i = first;
  for (std::size_t b = cube.first_block; b < cube.last_block; ++b) {
    const std::uint32_t shift = first_anchor_[b];
    for (const std::uint64_t w : anchors.load<std::uint64_t>(b, &AnchorsEntry::weight)) {
      in.groups.of.push_back(in.groups.count()), in.groups.sign.push_back(1);
      in.groups.size.push_back(w);
    }
    for (const auto section : {&AnchorsEntry::links, &AnchorsEntry::sides})
      for (const PatchVote& v : anchors.load<PatchVote>(b, section)) {
        const bool known = v.b == PatchAnchor::kOutside;
        auto& to = known ? in.sides : section == &AnchorsEntry::links ? in.links : in.pairs;
        to.push_back({shift + v.a, known ? 0 : shift + v.b, v.same, v.opposite});
      }
    const std::uint64_t end = blocks[b].first_patch + blocks[b].patches;
    if (i == last || scene.border[i] >= end) continue;
    const auto patches = anchors.load<PatchAnchor>(b, &AnchorsEntry::patches);
    for (; i < last && scene.border[i] < end; ++i) {
      const PatchAnchor& a = patches[scene.border[i] - blocks[b].first_patch];
      node[i - first] = {shift + a.anchor, a.sign};
    }
  }
  in.border.assign(in.groups.count(), 0);
  for (std::size_t k = first; k < last; ++k)
    if (ports_[k].sign != 0) in.border[node[k - first].first] = 1;
  const auto add = [&](const PatchVote& v, std::vector<PatchVote>& to) {
    if (cube_of(v.a) != index || cube_of(v.b) != index) return;
    const auto &p = node[border_index(scene, v.a) - first], &q = node[border_index(scene, v.b) - first];
    if (p.first != q.first) to.push_back(between(p.first, q.first, p.second * q.second, v));
  };
  for (std::size_t b = cube.first_block; b < cube.last_block; ++b)
    for (const PatchVote& v : links.outer(b)) add(v, in.links);
  for (const PatchVote& v : seen) add(v, in.pairs);
  merge_votes(in.links);
  BlockSigns out = solve_block_signs(in);
  for (std::size_t k = first; k < last; ++k) {
    if (ports_[k].sign == 0) continue;
    const PatchAnchor& a = out.patches[node[k - first].first];
    ports_[k] = {cube.first_top + a.anchor, static_cast<std::int8_t>(a.sign * node[k - first].second)};
  }
  return out;
}

AnchorSigns::Known AnchorSigns::of(std::size_t block, const PatchAnchor& patch) const {
  if (patch.anchor == PatchAnchor::kOutside) return {};
  if (is_on_nothing(patch))
    return {1, true, kOfBlock + block_patch_[block] + patch.anchor - PatchAnchor::kLoose};
  const Cube& cube = cubes_[cube_of_block_[block]];
  const PatchAnchor& a = cube.anchors[first_anchor_[block] + patch.anchor];
  if (a.anchor == PatchAnchor::kOutside) return {a.sign, a.uncertain != 0, 0};
  if (is_on_nothing(a))
    return {a.sign, true, kOfCube + first_patch_[cube_of_block_[block]] + a.anchor - PatchAnchor::kLoose};
  const Known top = of_top(cube.first_top + a.anchor);
  return {a.sign * top.sign, a.uncertain != 0 || top.uncertain, top.component};
}

AnchorSigns::Known AnchorSigns::of_top(std::uint32_t top) const {
  const std::uint32_t component = top_.component[top];
  return {top_.sign[top], top_.uncertain[top] != 0, component == outside_ ? 0 : kOfTop + component};
}

std::uint64_t AnchorSigns::bytes(std::uint64_t border, std::uint64_t votes) {
  // A cube's share of the votes, as loaded, merged, contracted and flipped; the last graph is smaller than a cube's.
  const std::uint64_t nodes = std::min(border, kMaxAnchors);
  const std::uint64_t part = border > nodes ? votes / border * nodes + 2 * nodes : votes;
  return border * (sizeof(std::uint32_t) + sizeof(Port) + sizeof(PatchAnchor)) + nodes * 160 +
         part * (4 * sizeof(PatchVote) + 8);
}

}  // namespace tessera
