#include "kernels/winding_votes.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "octree/morton.h"
#include "octree/winding_number.h"

// The winding number jumps by one at every surface; where all signs are consistent it takes the same two
// values there everywhere. Evaluation on a surface gives the mean of both, so every group should see what the
// largest one sees.

namespace tessera {
namespace {

constexpr int kLeafBits = 5;         ///< leaves of 32 cells hold some twenty coarse surfels
constexpr std::size_t kInTurn = 24;  ///< groups that see all larger ones; the others see these
constexpr std::uint64_t kLeast = 4;  ///< fine surfels; less has no inside

struct Item {
  std::uint32_t rank;  ///< of the group, by falling size
  std::uint64_t cell;  ///< Morton code, and that inside the cell: together that of all 30 bits
  std::uint32_t inside;
  Dipole dipole;
  std::uint32_t surfels;
};

Item item_of(const JobSurfel& s, std::uint32_t rank) {
  Item item;
  item.rank = rank;
  item.surfels = s.surfels;
  item.dipole.moment = s.area;
  for (std::size_t a = 0; a < 3; ++a)
    item.dipole.q[a] = static_cast<std::int32_t>(std::floor(s.position[a] * kQuantaPerCell));
  const Int3& q = item.dipole.q;
  const auto code = [&](auto part) {
    return morton_encode(static_cast<std::uint32_t>(part(q[0])), static_cast<std::uint32_t>(part(q[1])),
                         static_cast<std::uint32_t>(part(q[2])));
  };
  item.cell = code([](std::int32_t v) { return v >> kQuantumBits; });
  item.inside = static_cast<std::uint32_t>(code([](std::int32_t v) { return v & (kQuantaPerCell - 1); }));
  return item;
}

/// Field of some items at places.
std::vector<float> field(std::span<const Item> items, std::span<const Int3> places) {
  std::vector<Dipole> dipoles;
  dipoles.reserve(items.size());
  for (const Item& i : items) dipoles.push_back(i.dipole);
  const MultipoleTree tree(std::move(dipoles), kLeafBits);
  std::vector<float> value(places.size());
  WindingField(tree).evaluate(places, value);
  return value;
}

}  // namespace

std::vector<SideVotes> vote_by_winding(std::span<const JobSurfel> surfels,
                                       std::span<const std::uint32_t> group, std::size_t groups,
                                       std::span<const PatchVote> ties, double scale) {
  std::vector<SideVotes> votes(groups);
  std::vector<std::uint64_t> size(groups, 0);
  for (std::size_t i = 0; i < surfels.size(); ++i) size[group[i]] += surfels[i].surfels;
  std::vector<std::uint32_t> by_size(groups), rank(groups);
  std::iota(by_size.begin(), by_size.end(), 0u);
  std::sort(by_size.begin(), by_size.end(),
            [&](std::uint32_t l, std::uint32_t r) { return size[l] != size[r] ? size[l] > size[r] : l < r; });
  for (std::uint32_t k = 0; k < groups; ++k) rank[by_size[k]] = k;

  std::vector<Item> items;
  items.reserve(surfels.size());
  for (std::size_t i = 0; i < surfels.size(); ++i) items.push_back(item_of(surfels[i], rank[group[i]]));
  std::sort(items.begin(), items.end(), [](const Item& l, const Item& r) {
    if (l.rank != r.rank) return l.rank < r.rank;
    if (l.cell != r.cell) return l.cell < r.cell;
    if (l.inside != r.inside) return l.inside < r.inside;
    return l.dipole.moment < r.dipole.moment;  // two surfels in one place: any fixed order
  });
  std::vector<Int3> places;
  places.reserve(items.size());
  for (const Item& i : items) places.push_back(i.dipole.q);

  std::vector<std::vector<std::uint32_t>> tied(std::min(groups, kInTurn));
  for (std::uint32_t t = 0; t < ties.size(); ++t)
    for (const std::uint32_t g : {ties[t].a, ties[t].b})
      if (rank[g] < tied.size()) tied[rank[g]].push_back(t);

  std::vector<float> around(items.size(), 0.0f);  // field of the groups that have their sign
  std::vector<std::int8_t> sign(groups, 1);
  double wanted = 0.0;  // mean winding number on a surface
  for (std::size_t first = 0, k = 0; first < items.size(); ++k) {
    std::size_t last = first;
    while (last < items.size() && items[last].rank == items[first].rank) ++last;
    const std::uint32_t g = by_size[items[first].rank];
    const std::size_t count = last - first;
    if (size[g] < kLeast) break;  // the rest is dust
    const bool in_turn = k < kInTurn;
    const std::size_t end = in_turn ? items.size() : last;
    const std::span<const Item> own(items.data() + first, count);
    const std::vector<float> value = field(own, {places.data() + first, end - first});
    if (k == 0) {
      double sum = 0.0, all = 0.0;
      for (std::size_t i = 0; i < count; ++i) {
        sum += static_cast<double>(value[i]) * own[i].surfels;
        all += own[i].surfels;
      }
      wanted = sum / all;
    } else {
      SideVotes& v = votes[g];
      for (std::size_t i = 0; i < count; ++i) {
        const double pull =
            4.0 * static_cast<double>(value[i]) * (wanted - static_cast<double>(around[first + i]));
        const auto vote =
            static_cast<std::int64_t>(std::floor(std::fabs(pull) * scale * own[i].surfels + 0.5));
        (pull < 0.0 ? v.hidden : v.seen) += vote;
      }
      std::int64_t net = v.seen - v.hidden;
      if (in_turn)
        for (const std::uint32_t t : tied[rank[g]]) {
          const std::uint32_t other = ties[t].a == g ? ties[t].b : ties[t].a;
          if (rank[other] < rank[g]) net += (ties[t].same - ties[t].opposite) * sign[other];
        }
      sign[g] = net < 0 ? -1 : 1;
    }
    if (in_turn)
      for (std::size_t i = last; i < items.size(); ++i)
        around[i] += static_cast<float>(sign[g]) * value[i - first];
    first = last;
  }
  return votes;
}

}  // namespace tessera
