#include "kernels/orientation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace tessera {
namespace {

constexpr float kConfident = 0.3f;       ///< links below this weight join nothing
constexpr float kVoteScale = 4096.0f;
constexpr int kFlipRounds = 8;
constexpr std::size_t kVoxels = std::size_t{kSurfelsPerBrick} * kSurfelsPerBrick * kSurfelsPerBrick;

float dot(const Float3& a, const Float3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// Union-find that also keeps the sign of every element relative to its root; roots are minimal.
class SignedForest {
 public:
  explicit SignedForest(std::size_t n) : parent_(n), sign_(n, 1) {
    std::iota(parent_.begin(), parent_.end(), 0u);
  }
  std::uint32_t root(std::uint32_t v, int& sign) {
    std::uint32_t r = v;
    int to_root = 1;
    while (parent_[r] != r) {
      to_root *= sign_[r];
      r = parent_[r];
    }
    sign = to_root;
    while (parent_[v] != v) {  // compress
      const std::uint32_t next = parent_[v];
      const int own = sign_[v];
      parent_[v] = r;
      sign_[v] = static_cast<std::int8_t>(to_root);
      to_root *= own;
      v = next;
    }
    return r;
  }
  /// Joins two trees so that sign(a) * sign(b) = relation. False when they are one tree already.
  bool join(std::uint32_t a, std::uint32_t b, int relation) {
    int sa = 1;
    int sb = 1;
    std::uint32_t ra = root(a, sa);
    std::uint32_t rb = root(b, sb);
    if (ra == rb) return false;
    if (ra > rb) std::swap(ra, rb);
    parent_[rb] = ra;
    sign_[rb] = static_cast<std::int8_t>(sa * sb * relation);
    return true;
  }

 private:
  std::vector<std::uint32_t> parent_;
  std::vector<std::int8_t> sign_;
};

std::size_t voxel_index(int x, int y, int z) {
  return (static_cast<std::size_t>(z) * kSurfelsPerBrick + static_cast<std::size_t>(y)) * kSurfelsPerBrick +
         static_cast<std::size_t>(x);
}

int voxel_coordinate(float cells) {
  return std::clamp(static_cast<int>(std::floor(cells / kSurfelCells)), 0, kSurfelsPerBrick - 1);
}

struct Link {
  std::int32_t vote;
  std::uint32_t a, b;
};

}  // namespace

std::int32_t link_vote(const Surfel& a, const Surfel& b, const Float3& offset) {
  const float length = std::sqrt(dot(offset, offset));
  if (!(length > 0.0f)) return 0;
  const Float3 e = {offset[0] / length, offset[1] / length, offset[2] / length};
  const float ae = dot(a.normal, e);
  const float be = dot(b.normal, e);
  const float carried = dot(a.normal, b.normal) - 2.0f * ae * be;
  // Across a gap between two sheets the offset runs along the normals: such links say little.
  const float steep = std::max(ae * ae, be * be);
  const float weight = std::fabs(carried) * (1.0f - 0.9f * steep);
  if (weight < kConfident) return 0;
  const auto vote = static_cast<std::int32_t>(std::floor(weight * kVoteScale + 0.5f));
  return carried < 0.0f ? -vote : vote;
}

BrickOrientation orient_brick(std::span<const Float3> position, std::span<const Float3> normal) {
  BrickOrientation out;
  out.normal.assign(normal.begin(), normal.end());
  out.patch.assign(position.size(), kNoPatch);

  // Surfels: mean position and mean axis of the points of each voxel, the first point's normal giving the side.
  std::vector<std::int32_t> surfel_of(kVoxels, -1);
  std::vector<std::uint32_t> point_surfel(position.size(), std::numeric_limits<std::uint32_t>::max());
  std::vector<Surfel> surfels;
  for (std::size_t i = 0; i < position.size(); ++i) {
    if (dot(normal[i], normal[i]) < 0.5f) continue;
    const int x = voxel_coordinate(position[i][0]);
    const int y = voxel_coordinate(position[i][1]);
    const int z = voxel_coordinate(position[i][2]);
    std::int32_t& slot = surfel_of[voxel_index(x, y, z)];
    if (slot < 0) {
      slot = static_cast<std::int32_t>(surfels.size());
      Surfel s;
      s.voxel = {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y), static_cast<std::uint8_t>(z)};
      surfels.push_back(s);
    }
    point_surfel[i] = static_cast<std::uint32_t>(slot);
    Surfel& s = surfels[static_cast<std::size_t>(slot)];
    const float side = s.points > 0 && dot(normal[i], s.normal) < 0.0f ? -1.0f : 1.0f;
    for (std::size_t a = 0; a < 3; ++a) {
      s.position[a] += position[i][a];
      s.normal[a] += side * normal[i][a];
    }
    if (s.points < 0xffff) ++s.points;
  }
  for (Surfel& s : surfels) {
    const float norm = std::sqrt(dot(s.normal, s.normal));
    for (std::size_t a = 0; a < 3; ++a) {
      s.position[a] /= static_cast<float>(s.points);
      s.normal[a] = norm > 0.0f ? s.normal[a] / norm : 0.0f;
    }
  }

  // Confident links to the 13 neighbours ahead, strongest first, make the patches.
  std::vector<Link> links;
  for (std::uint32_t i = 0; i < surfels.size(); ++i) {
    const Surfel& s = surfels[i];
    for (int d = 14; d < 27; ++d) {
      const int x = s.voxel[0] + d % 3 - 1;
      const int y = s.voxel[1] + d / 3 % 3 - 1;
      const int z = s.voxel[2] + d / 9 - 1;
      if (x < 0 || y < 0 || x >= kSurfelsPerBrick || y >= kSurfelsPerBrick || z >= kSurfelsPerBrick) continue;
      const std::int32_t j = surfel_of[voxel_index(x, y, z)];
      if (j < 0) continue;
      const Surfel& t = surfels[static_cast<std::size_t>(j)];
      const std::int32_t vote = link_vote(s, t, {t.position[0] - s.position[0], t.position[1] - s.position[1],
                                                 t.position[2] - s.position[2]});
      if (vote != 0) links.push_back({vote, i, static_cast<std::uint32_t>(j)});
    }
  }
  std::sort(links.begin(), links.end(), [](const Link& l, const Link& r) {
    const std::int32_t lw = std::abs(l.vote), rw = std::abs(r.vote);
    if (lw != rw) return lw > rw;
    return l.a != r.a ? l.a < r.a : l.b < r.b;
  });
  SignedForest forest(surfels.size());
  for (const Link& link : links) forest.join(link.a, link.b, link.vote < 0 ? -1 : 1);

  std::vector<std::int32_t> patch_of_root(surfels.size(), -1);
  for (std::uint32_t i = 0; i < surfels.size(); ++i) {
    int sign = 1;
    const std::uint32_t root = forest.root(i, sign);
    std::int32_t& patch = patch_of_root[root];
    if (patch < 0) {
      // More patches in a brick than 16 bits name is dust: it all goes into the last one, undecided among itself.
      patch = std::min<std::int32_t>(out.patches, kGivenPatch - 1);
      if (out.patches < kGivenPatch) ++out.patches;
    }
    surfels[i].patch = static_cast<std::uint16_t>(patch);
    for (float& c : surfels[i].normal) c *= static_cast<float>(sign);
  }

  for (std::size_t i = 0; i < position.size(); ++i) {
    if (point_surfel[i] == std::numeric_limits<std::uint32_t>::max()) continue;
    const Surfel& s = surfels[point_surfel[i]];
    out.patch[i] = s.patch;
    if (dot(out.normal[i], s.normal) < 0.0f)
      for (float& c : out.normal[i]) c = -c;
  }

  // Extremes: lowest and highest coordinate per axis (1/16 cell) and the normal's component there.
  constexpr std::int32_t kUnset = std::numeric_limits<std::int32_t>::min();
  out.extremes.assign(out.patches, {});
  for (auto& e : out.extremes)
    for (std::size_t k = 0; k < 6; ++k) e[2 * k] = kUnset;
  for (const Surfel& s : surfels) {
    auto& e = out.extremes[s.patch];
    for (std::size_t a = 0; a < 3; ++a) {
      const auto at = static_cast<std::int32_t>(std::floor(s.position[a] * 16.0f));
      const auto component = static_cast<std::int32_t>(s.normal[a] * kVoteScale);
      const std::int32_t low = -at;
      if (low > e[4 * a]) e[4 * a] = low, e[4 * a + 1] = -component;
      if (at > e[4 * a + 2]) e[4 * a + 2] = at, e[4 * a + 3] = component;
    }
  }

  std::sort(surfels.begin(), surfels.end(), [](const Surfel& s, const Surfel& t) {
    return voxel_index(s.voxel[0], s.voxel[1], s.voxel[2]) < voxel_index(t.voxel[0], t.voxel[1], t.voxel[2]);
  });
  for (const Surfel& s : surfels) {
    const bool touches = std::any_of(s.voxel.begin(), s.voxel.end(),
                                     [](std::uint8_t v) { return v == 0 || v == kSurfelsPerBrick - 1; });
    if (touches) out.boundary.push_back(s);
  }
  return out;
}

SignSolution solve_signs(std::size_t patches, std::span<const PatchVote> votes) {
  SignSolution out;
  std::vector<std::uint32_t> order(votes.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto strength = [&](std::uint32_t v) { return std::abs(votes[v].same - votes[v].opposite); };
  std::sort(order.begin(), order.end(), [&](std::uint32_t l, std::uint32_t r) {
    const std::int64_t a = strength(l), b = strength(r);
    return a != b ? a > b : l < r;
  });
  SignedForest forest(patches);
  for (const std::uint32_t v : order)
    if (strength(v) > 0) forest.join(votes[v].a, votes[v].b, votes[v].same >= votes[v].opposite ? 1 : -1);
  out.sign.resize(patches);
  out.component.resize(patches);
  for (std::uint32_t p = 0; p < patches; ++p) {
    int sign = 1;
    out.component[p] = forest.root(p, sign);
    out.sign[p] = static_cast<std::int8_t>(sign);
  }

  // Adjacency both ways, then single flips that gain.
  std::vector<std::uint64_t> first(patches + 1, 0);
  for (const PatchVote& v : votes) ++first[v.a + 1], ++first[v.b + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<std::uint32_t> at(votes.size() * 2);
  std::vector<std::uint64_t> fill(first.begin(), first.end() - 1);
  for (std::uint32_t v = 0; v < votes.size(); ++v) at[fill[votes[v].a]++] = v, at[fill[votes[v].b]++] = v;
  const auto gain_of = [&](std::uint32_t p, std::int64_t& all) {
    std::int64_t broken = 0;
    all = 0;
    for (std::uint64_t k = first[p]; k < first[p + 1]; ++k) {
      const PatchVote& v = votes[at[k]];
      broken += out.sign[v.a] == out.sign[v.b] ? v.opposite : v.same;
      all += v.same + v.opposite;
    }
    return 2 * broken - all;
  };
  for (int round = 0; round < kFlipRounds; ++round) {
    bool changed = false;
    for (std::uint32_t p = 0; p < patches; ++p) {
      std::int64_t all = 0;
      if (gain_of(p, all) <= 0) continue;
      out.sign[p] = static_cast<std::int8_t>(-out.sign[p]);
      changed = true;
    }
    if (!changed) break;
  }
  out.uncertain.assign(patches, 0);
  for (std::uint32_t p = 0; p < patches; ++p) {
    std::int64_t all = 0;
    const std::int64_t broken = (gain_of(p, all) + all) / 2;
    out.uncertain[p] = 4 * broken >= all && all > 0 ? 1 : 0;
  }
  for (const PatchVote& v : votes) {
    out.frustrated_votes += static_cast<std::uint64_t>(out.sign[v.a] == out.sign[v.b] ? v.opposite : v.same);
    out.total_votes += static_cast<std::uint64_t>(v.same + v.opposite);
  }
  return out;
}

}  // namespace tessera
