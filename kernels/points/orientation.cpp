#include "kernels/points/orientation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "octree/union_find.h"

namespace tessera {
namespace {

constexpr float kMinWeight = 0.15f;  ///< links below this weight say nothing
constexpr std::int32_t kSmooth =
    kVoteScale * 9 / 10;            ///< links above this weight join surfels without asking further
constexpr float kSameSheet = 0.7f;  ///< cosine between normals of one surfel
constexpr float kSheetDistance =
    0.75f;                       ///< cells: a point farther from a surfel's plane belongs to another sheet
constexpr float kVague = 0.07f;  ///< surface variation from which a fitted plane may stand across the surface
constexpr float kVagueWeight = 0.25f;  ///< of links that such a surfel takes part in
constexpr float kNearAxis =
    0.5f;                   ///< cosine between a plane's axis and a given normal that it is compared with
constexpr int kSheets = 4;  ///< surfels of one voxel; points that fit none join the nearest
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t kVoxels = std::size_t{kSurfelsPerBrick} * kSurfelsPerBrick * kSurfelsPerBrick;
constexpr int kCoarsePerBrick = kBrickCells / kCoarseCells;
/// Groups of a brick join to patches while about six whole links speak for it and few against.
constexpr ContractionLimits kPatchLimits = {6.0 * kVoteScale, 0.8};

std::size_t voxel_index(int x, int y, int z) {
  return (static_cast<std::size_t>(z) * kSurfelsPerBrick + static_cast<std::size_t>(y)) * kSurfelsPerBrick +
         static_cast<std::size_t>(x);
}
std::size_t voxel_index(const Surfel& s) {
  return voxel_index(s.voxel[0], s.voxel[1], s.voxel[2]);
}

int voxel_coordinate(float cells) {
  return std::clamp(static_cast<int>(std::floor(cells / kSurfelCells)), 0, kSurfelsPerBrick - 1);
}

/// Sums of a surfel in the making.
struct Sheet {
  Float3 position{};
  Float3 normal{};
  float points = 0.0f;
  bool vague = false;
  std::uint32_t next = kNone;  ///< of the same voxel
};

/// The sheets of every voxel. \param sheet_of  per point
std::vector<Surfel> make_surfels(const OrientationInput& in, std::vector<std::uint32_t>& surfel_of,
                                 std::vector<std::uint32_t>& first_surfel) {
  std::vector<std::uint32_t> head(kVoxels, kNone);
  std::vector<Sheet> sheets;
  std::vector<std::array<std::uint8_t, 3>> voxels;
  std::vector<std::uint32_t> sheet_of(in.position.size(), kNone);
  // Clear points first: at edges planes stand across, or mix both sides. The others join what is there.
  const auto take = [&](std::size_t i, bool vague) {
    const Float3& p = in.position[i];
    const Float3& n = in.normal[i];
    if (vague != (in.variation[i] > kVague) || dot(n, n) < 0.5f) return;
    const int x = voxel_coordinate(p[0]), y = voxel_coordinate(p[1]), z = voxel_coordinate(p[2]);
    std::uint32_t* slot = &head[voxel_index(x, y, z)];
    std::uint32_t nearest = kNone;
    float minimum = std::numeric_limits<float>::infinity();
    int count = 0;
    bool fits = false;
    while (*slot != kNone && !fits) {
      const Sheet& s = sheets[*slot];
      const float norm = std::sqrt(dot(s.normal, s.normal));
      const float cosine = norm > 0.0f ? std::fabs(dot(n, s.normal)) / norm : 0.0f;
      const Float3 from = {p[0] - s.position[0] / s.points, p[1] - s.position[1] / s.points,
                           p[2] - s.position[2] / s.points};
      const float off_plane = norm > 0.0f ? std::fabs(dot(from, s.normal)) / norm : 0.0f;
      fits = cosine > kSameSheet && off_plane < kSheetDistance;
      const float misfit = off_plane + 2.0f * (1.0f - cosine);
      if (fits || misfit < minimum) minimum = misfit, nearest = *slot;
      slot = &sheets[*slot].next;
      ++count;
    }
    if (!fits && count < (vague ? 1 : kSheets)) {
      nearest = static_cast<std::uint32_t>(sheets.size());
      *slot = nearest;
      sheets.push_back({});
      sheets.back().vague = vague;
      voxels.push_back(
          {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y), static_cast<std::uint8_t>(z)});
    }
    sheet_of[i] = nearest;
    Sheet& s = sheets[nearest];
    if (vague && !s.vague) return;
    const float side = dot(n, s.normal) < 0.0f ? -1.0f : 1.0f;
    for (std::size_t a = 0; a < 3; ++a) s.position[a] += p[a], s.normal[a] += side * n[a];
    s.points += 1.0f;
  };
  for (const bool vague : {false, true})
    for (std::size_t i = 0; i < in.position.size(); ++i) take(i, vague);

  // In order of the voxels; then the sheets of one voxel lie side by side.
  std::vector<std::uint32_t> order(sheets.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t l, std::uint32_t r) {
    const std::size_t a = voxel_index(voxels[l][0], voxels[l][1], voxels[l][2]);
    const std::size_t b = voxel_index(voxels[r][0], voxels[r][1], voxels[r][2]);
    return a != b ? a < b : l < r;
  });
  std::vector<Surfel> surfels(sheets.size());
  std::vector<std::uint32_t> slot(sheets.size());
  first_surfel.assign(kVoxels + 1, 0);
  for (std::uint32_t k = 0; k < order.size(); ++k) {
    const Sheet& from = sheets[order[k]];
    Surfel& s = surfels[k];
    s.voxel = voxels[order[k]];
    s.vague = from.vague ? 1 : 0;
    s.points = static_cast<std::uint16_t>(std::min(from.points, 65535.0f));
    const float norm = std::sqrt(dot(from.normal, from.normal));
    for (std::size_t a = 0; a < 3; ++a) {
      s.position[a] = from.position[a] / from.points;
      s.normal[a] = norm > 0.0f ? from.normal[a] / norm : 0.0f;
    }
    slot[order[k]] = k;
    ++first_surfel[voxel_index(s) + 1];
  }
  std::partial_sum(first_surfel.begin(), first_surfel.end(), first_surfel.begin());
  surfel_of.assign(sheet_of.size(), kNone);
  for (std::size_t i = 0; i < sheet_of.size(); ++i)
    if (sheet_of[i] != kNone) surfel_of[i] = slot[sheet_of[i]];
  return surfels;
}

/// Links of every voxel with itself and the 13 neighbours ahead, places in `surfels`.
std::vector<SurfelLink> link_brick(const std::vector<Surfel>& surfels,
                                   const std::vector<std::uint32_t>& first) {
  std::vector<SurfelLink> links;
  for (std::uint32_t i = 0; i < surfels.size();) {
    const Surfel& s = surfels[i];
    const std::size_t voxel = voxel_index(s);
    const std::uint32_t end = first[voxel + 1];
    for (int d = 13; d < 27; ++d) {
      const int x = s.voxel[0] + d % 3 - 1;
      const int y = s.voxel[1] + d / 3 % 3 - 1;
      const int z = s.voxel[2] + d / 9 - 1;
      if (x < 0 || y < 0 || x >= kSurfelsPerBrick || y >= kSurfelsPerBrick || z >= kSurfelsPerBrick) continue;
      const std::size_t other = voxel_index(x, y, z);
      const std::uint32_t j = first[other];
      if (first[other + 1] == j) continue;
      const std::size_t known = links.size();
      link_voxels({&surfels[i], end - i}, {&surfels[j], first[other + 1] - j}, {0, 0, 0}, links);
      for (std::size_t l = known; l < links.size(); ++l) links[l].a += i, links[l].b += j;
    }
    i = end;
  }
  return links;
}

/// Per surfel the side that most of its points are sure of, against its normal; 0 where fewer than half are.
std::vector<std::int8_t> sure_sides(const OrientationInput& in, const std::vector<Surfel>& surfels,
                                    const std::vector<std::uint32_t>& surfel_of) {
  std::vector<std::int8_t> side(surfels.size(), 0);
  if (in.visible.empty() || in.sure >= kNeverSure) return side;
  struct Count {
    std::uint32_t points = 0, same = 0, opposite = 0;
  };
  std::vector<Count> counts(surfels.size());
  for (std::size_t i = 0; i < surfel_of.size(); ++i) {
    if (surfel_of[i] == kNone) continue;
    Count& c = counts[surfel_of[i]];
    ++c.points;
    if (std::fabs(in.visible[i]) < in.sure) continue;
    const bool same = (dot(in.normal[i], surfels[surfel_of[i]].normal) < 0.0f) == (in.visible[i] < 0.0f);
    ++(same ? c.same : c.opposite);
  }
  for (std::size_t k = 0; k < counts.size(); ++k)
    if (2 * (counts[k].same + counts[k].opposite) >= counts[k].points)
      side[k] = counts[k].same >= counts[k].opposite ? 1 : -1;
  return side;
}

/// Hangs together what is sure.
SignedUnionFind join_sure(const std::vector<std::int8_t>& sure, std::uint32_t first_sure) {
  const auto n = static_cast<std::uint32_t>(sure.size());
  SignedUnionFind sets(n);
  for (std::uint32_t i = first_sure + 1; i < n; ++i)
    if (sure[i] != 0) sets.hang(i, first_sure, sure[i] * sure[first_sure]);
  return sets;
}

/// Joins what a smooth link joins. \return whether it says the same as those before
bool join_smooth(const SurfelLink& l, SignedUnionFind& sets) {
  const SignedUnionFind::SignedRoot a = sets.find(l.a), b = sets.find(l.b);
  const int sign = a.sign * b.sign * (l.vote < 0 ? -1 : 1);
  if (a.root == b.root) return sign > 0;
  sets.hang(std::max(a.root, b.root), std::min(a.root, b.root), sign);
  return true;
}

/// What smooth links join, strongest first. Where all of them say the same, as mostly, no order makes a difference.
SignedUnionFind join_smooth(const std::vector<SurfelLink>& links, const std::vector<std::int8_t>& sure,
                            std::uint32_t first_sure) {
  SignedUnionFind sets = join_sure(sure, first_sure);
  bool agree = true;
  for (const SurfelLink& l : links)
    if (std::abs(l.vote) >= kSmooth && !(agree = join_smooth(l, sets))) break;
  if (agree) return sets;
  std::vector<SurfelLink> smooth;
  for (const SurfelLink& l : links)
    if (std::abs(l.vote) >= kSmooth) smooth.push_back(l);
  std::sort(smooth.begin(), smooth.end(), [](const SurfelLink& l, const SurfelLink& r) {
    const std::int32_t lw = std::abs(l.vote), rw = std::abs(r.vote);
    if (lw != rw) return lw > rw;
    return l.a != r.a ? l.a < r.a : l.b < r.b;
  });
  sets = join_sure(sure, first_sure);
  for (const SurfelLink& l : smooth) join_smooth(l, sets);
  return sets;
}

/// Joins what is sure; then what smooth links join, strongest first; then what many links agree on. Where sides are
/// sure, whatever links carry them to hangs on them. Returns group and sign per surfel.
/// \param sure  of sure_sides
void join_surfels(const std::vector<Surfel>& surfels, const std::vector<std::int8_t>& sure,
                  const std::vector<SurfelLink>& links, std::vector<std::uint32_t>& group,
                  std::vector<std::int8_t>& sign, std::vector<PatchVote>& votes) {
  const auto n = static_cast<std::uint32_t>(surfels.size());
  const auto first_sure = static_cast<std::uint32_t>(
      std::find_if(sure.begin(), sure.end(), [](std::int8_t s) { return s != 0; }) - sure.begin());
  SignedUnionFind sets = join_smooth(links, sure, first_sure);
  // Votes between the groups, every link counted.
  std::vector<std::uint32_t> number(n, kNone);
  std::uint32_t groups = 0;
  group.resize(n), sign.resize(n);
  for (std::uint32_t i = 0; i < n; ++i) {
    const SignedUnionFind::SignedRoot at = sets.find(i);
    if (number[at.root] == kNone) number[at.root] = groups++;
    group[i] = number[at.root];
    sign[i] = static_cast<std::int8_t>(at.sign);
  }
  std::vector<std::uint64_t> weight(groups, 0);
  for (std::uint32_t i = 0; i < n; ++i) ++weight[group[i]];
  const auto collect = [&] {
    votes.clear();
    for (const SurfelLink& l : links) {
      std::uint32_t a = group[l.a], b = group[l.b];
      if (a == b) continue;
      if (a > b) std::swap(a, b);
      const std::int32_t vote = l.vote * sign[l.a] * sign[l.b];
      votes.push_back({a, b, std::max(vote, 0), std::max(-vote, 0)});
    }
    merge_votes(votes);
  };
  collect();
  const Contraction tree = contract_signs(weight, votes, first_sure < n ? ContractionLimits{} : kPatchLimits);
  std::vector<std::uint32_t> top(groups);
  std::vector<std::int8_t> relation(groups, 1);
  for (const std::uint32_t g : tree.joined_last) {
    const std::uint32_t p = tree.parent[g];
    top[g] = p == g ? g : top[p];
    relation[g] = static_cast<std::int8_t>(p == g ? 1 : relation[p] * tree.relation[g]);
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    sign[i] = static_cast<std::int8_t>(sign[i] * relation[group[i]]);
    group[i] = top[group[i]];
  }
  // More patches in a brick than 16 bits name is dust: it all goes into the last one, undecided among itself.
  number.assign(n, kNone);
  std::uint32_t patches = 0;
  for (std::uint32_t i = 0; i < n; ++i) {
    if (number[group[i]] == kNone) number[group[i]] = std::min<std::uint32_t>(patches++, kGivenPatch - 1);
    group[i] = number[group[i]];
  }
  collect();
}

/// 0..5: the axis that a normal is nearest to, and its sign.
int facing(const Float3& n) {
  int axis = 0;
  for (int a = 1; a < 3; ++a)
    if (std::fabs(n[static_cast<std::size_t>(a)]) > std::fabs(n[static_cast<std::size_t>(axis)])) axis = a;
  return 2 * axis + (n[static_cast<std::size_t>(axis)] < 0.0f ? 1 : 0);
}

std::vector<CoarseSurfel> thin(const std::vector<Surfel>& surfels) {
  struct Item {
    std::uint64_t key;
    std::uint32_t surfel;
  };
  std::vector<Item> items(surfels.size());
  for (std::uint32_t i = 0; i < surfels.size(); ++i) {
    const Surfel& s = surfels[i];
    constexpr int kStep = kCoarseCells / kSurfelCells;
    const int voxel =
        (s.voxel[2] / kStep * kCoarsePerBrick + s.voxel[1] / kStep) * kCoarsePerBrick + s.voxel[0] / kStep;
    items[i] = {(static_cast<std::uint64_t>(voxel) << 32) | (std::uint64_t{s.patch} << 8) |
                    static_cast<std::uint64_t>(facing(s.normal)),
                i};
  }
  std::sort(items.begin(), items.end(), [](const Item& l, const Item& r) {
    return l.key != r.key ? l.key < r.key : l.surfel < r.surfel;
  });
  // Scans that lie one over the other share the area of their voxel.
  std::vector<float> share(surfels.size(), 1.0f);
  for (std::size_t i = 0; i < surfels.size(); ++i)
    for (std::size_t j = i; j-- > 0 && surfels[j].voxel == surfels[i].voxel;)
      if (surfels[j].patch == surfels[i].patch && facing(surfels[j].normal) == facing(surfels[i].normal))
        share[i] += 1.0f, share[j] += 1.0f;
  std::vector<CoarseSurfel> coarse;
  for (std::size_t i = 0; i < items.size(); ++i) {
    const Surfel& s = surfels[items[i].surfel];
    if (i == 0 || items[i].key != items[i - 1].key) {
      coarse.emplace_back();
      coarse.back().patch = s.patch;
    }
    CoarseSurfel& c = coarse.back();
    // Of a plane of area A, voxels of edge e see A (|nx| + |ny| + |nz|) / e^2.
    const float cut = std::fabs(s.normal[0]) + std::fabs(s.normal[1]) + std::fabs(s.normal[2]);
    const float area = kSurfelCells * kSurfelCells / std::max(cut, 1.0f) / share[items[i].surfel];
    for (std::size_t a = 0; a < 3; ++a) c.position[a] += s.position[a], c.area[a] += area * s.normal[a];
    ++c.surfels;
  }
  for (CoarseSurfel& c : coarse)
    for (float& p : c.position) p /= static_cast<float>(c.surfels);
  return coarse;
}

}  // namespace

std::int32_t link_vote(const Surfel& a, const Surfel& b, const Float3& offset) {
  const float length = std::sqrt(dot(offset, offset));
  if (!(length > 0.0f)) return 0;
  const Float3 e = {offset[0] / length, offset[1] / length, offset[2] / length};
  const float ae = dot(a.normal, e);
  const float be = dot(b.normal, e);
  const float carried = dot(a.normal, b.normal) - 2.0f * ae * be;
  // On an arc both normals lean by the same angle, one forward, one back. Two sheets, one over the other,
  // lean the same way; where the offset runs along the normals nothing can be said.
  const float lean = std::fabs(ae + (carried < 0.0f ? -be : be));
  const float steep = std::max(ae * ae, be * be);
  float weight = std::fabs(carried) * (1.0f - 0.9f * steep) * (1.0f - std::min(lean, 1.0f));
  if (weight < kMinWeight) return 0;
  if (a.vague + b.vague > 0) weight *= kVagueWeight;
  const auto vote = static_cast<std::int32_t>(std::floor(weight * kVoteScale + 0.5f));
  return carried < 0.0f ? -vote : vote;
}

void link_voxels(std::span<const Surfel> a, std::span<const Surfel> b, const Float3& shift,
                 std::vector<SurfelLink>& links) {
  const bool same = a.data() == b.data();
  const std::size_t known = links.size();
  for (std::uint32_t i = 0; i < a.size(); ++i)
    for (std::uint32_t j = same ? i + 1 : 0; j < b.size(); ++j) {
      const std::int32_t vote = link_vote(a[i], b[j], b[j].position + shift - a[i].position);
      if (vote != 0) links.push_back({i, j, vote});
    }
  if (same || links.size() - known < 2) return;
  const auto best = [&](const SurfelLink& l) {
    bool for_a = true, for_b = true;
    for (std::size_t k = known; k < links.size(); ++k) {
      const bool stronger = std::abs(links[k].vote) > std::abs(l.vote);
      for_a = for_a && !(stronger && links[k].a == l.a);
      for_b = for_b && !(stronger && links[k].b == l.b);
    }
    return for_a || for_b;
  };
  std::vector<SurfelLink> kept;
  for (std::size_t k = known; k < links.size(); ++k)
    if (best(links[k])) kept.push_back(links[k]);
  links.resize(known);
  links.insert(links.end(), kept.begin(), kept.end());
}

BrickOrientation orient_brick(const OrientationInput& in) {
  BrickOrientation out;
  out.normal.assign(in.normal.begin(), in.normal.end());
  out.patch.assign(in.position.size(), kNoPatch);
  std::vector<std::uint32_t> surfel_of, first, group;
  std::vector<std::int8_t> sign;
  std::vector<Surfel> surfels = make_surfels(in, surfel_of, first);
  const std::vector<SurfelLink> links = link_brick(surfels, first);
  join_surfels(surfels, sure_sides(in, surfels, surfel_of), links, group, sign, out.votes);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    surfels[i].patch = static_cast<std::uint16_t>(group[i]);
    if (sign[i] < 0) surfels[i].normal = -surfels[i].normal;
    out.patches = std::max(out.patches, static_cast<std::uint16_t>(group[i] + 1));
  }

  out.stats.resize(out.patches);
  for (const Surfel& s : surfels) ++out.stats[s.patch].surfels;
  for (std::size_t i = 0; i < in.position.size(); ++i) {
    if (surfel_of[i] == kNone) continue;
    const Surfel& s = surfels[surfel_of[i]];
    Float3& n = out.normal[i];
    out.patch[i] = s.patch;
    const bool flip = dot(n, s.normal) < 0.0f;
    if (flip) n = -n;
    PatchStats& stats = out.stats[s.patch];
    ++stats.points;
    if (!in.visible.empty()) {
      // Slanting views err: their weight falls with the square. Every surfel counts once, however many points
      // it has.
      const float c = flip ? -in.visible[i] : in.visible[i];
      const auto vote =
          static_cast<std::int64_t>(std::floor(c * c * kVoteScale / static_cast<float>(s.points) + 0.5f));
      (c < 0.0f ? stats.hidden : stats.seen) += vote;
    }
    const float length = in.given.empty() ? 0.0f : std::sqrt(dot(in.given[i], in.given[i]));
    if (length > 0.0f) {
      const float along = dot(n, in.given[i]);
      ++(along < 0.0f ? stats.disagree : stats.agree);
      if (std::fabs(along) > kNearAxis * length) ++(along < 0.0f ? stats.disagree_near : stats.agree_near);
    }
  }
  out.coarse = thin(surfels);
  for (const Surfel& s : surfels) {
    const bool touches = std::any_of(s.voxel.begin(), s.voxel.end(),
                                     [](std::uint8_t v) { return v == 0 || v == kSurfelsPerBrick - 1; });
    if (touches) out.boundary.push_back(s);
  }
  return out;
}

}  // namespace tessera
