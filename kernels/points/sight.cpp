#include "kernels/points/sight.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "kernels/points/orientation.h"
#include "octree/vector.h"

namespace tessera {
namespace {

// Disks.
constexpr float kDiskSpread = 1.4f;   ///< radius over that of the surfel's area: neighbours leave no gap
constexpr float kLeastRadius = 2.5f;  ///< cells
constexpr float kMostRadius = 7.0f;
constexpr float kGrazing = 0.1f;  ///< cosine; flatter disks are not met
// Looks.
constexpr float kLeastDistance = 0.5f;        ///< cells; what is nearer is the surface that is looked from
constexpr float kFrank = 0.25f;               ///< cosine; flatter looks say nothing
constexpr float kNear = 2.0f * kCoarseCells;  ///< disks reach beyond edges: what ends nearer does not vote
constexpr std::uint64_t kLooks = 1u << 20;    ///< pairs, there and back, aimed at over the whole job
constexpr std::uint64_t kPerGroup = 1024;     ///< small groups look more often
constexpr std::uint64_t kMost = 32;           ///< of a surfel that looks at all
constexpr std::size_t kAskedSensors = 8;      ///< the nearest
constexpr double kBelow = 0.1;  ///< weight of open sight downwards: nobody scans the earth from below
constexpr float kSky = 0.7f;    ///< cosine with up within which the sky is looked at: where scanners fly
// Scenes. Figures on simulated and real scans: README, "Measured".
constexpr double kShut = 0.1;  ///< share of looks into the open below which a side is shut in
constexpr double kRoom =
    0.01;  ///< share of enclosed surfels from which the job is a room; objects have 0.004
constexpr double kClear = 0.25;  ///< share of looks at the sky from which a surfel is under the sky
constexpr double kUnderSky =
    0.78;  ///< share of such surfels from which it was scanned from above: balls have 0.7,
constexpr double kOneSided = 0.5;  ///< if steep ones see less than this part of it with their darker side
constexpr double kAmid = 3.0;   ///< spread of densities (1: even) from which the scanner stood amid its scene
constexpr double kShell = 0.2;  ///< share of surfels with one side shut in from which it is an object
// Length, in mean lengths of sight, that sight of the open counts as.
constexpr double kOpenInRoom = 0.3;
constexpr double kOpenOnLand = 1.2;
constexpr double kLeastOpen = 96.0;  ///< and at least so many cells on land: roofs see the ground below
constexpr double kRoomSides = 0.25;  ///< weight of sides against `scale` in a room; there pairs do not vote,
constexpr double kSides = 0.25;      ///< for the backs of furniture see each other's fronts; elsewhere
constexpr double kSkySides =
    0.25;                       ///< from above; nor do pairs, for backs of roofs see the fronts of streets
constexpr double kPairs = 0.1;  ///< weight of pairs

constexpr std::uint64_t kEmpty = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint64_t kRegion = std::uint64_t{1} << 63;

std::uint64_t mix(std::uint64_t v) {
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9ULL;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebULL;
  return v ^ (v >> 31);
}

std::uint64_t key_of(const Int3& at) {
  return (static_cast<std::uint64_t>(at[2]) << 42) | (static_cast<std::uint64_t>(at[1]) << 21) |
         static_cast<std::uint64_t>(at[0]);
}
Int3 divided(const Int3& at, std::int32_t by) {
  return {at[0] / by, at[1] / by, at[2] / by};
}

Int3 voxel_of(const Float3& p) {
  Int3 v;
  for (std::size_t a = 0; a < 3; ++a) v[a] = static_cast<std::int32_t>(std::max(p[a], 0.0f)) / kCoarseCells;
  return v;
}

/// Random numbers that hang on a seed alone.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() { return state_ = mix(state_ + 0x9e3779b97f4a7c15ULL); }
  /// A direction, even over the sphere, no component 0.
  Float3 way() {
    for (;;) {
      const std::uint64_t b = bits();
      Float3 w;
      for (std::size_t a = 0; a < 3; ++a)
        w[a] = static_cast<float>(2 * static_cast<std::int32_t>((b >> (16 * a)) & 1023) - 1023);
      const float square = dot(w, w);
      if (square > 1023.0f * 1023.0f || square < 256.0f * 256.0f) continue;
      const float scale = 1.0f / std::sqrt(square);
      return w * scale;
    }
  }

 private:
  std::uint64_t state_;
};

}  // namespace

SurfelScene::SurfelScene(std::span<const JobSurfel> surfels) : surfels_(surfels) {
  struct Item {
    std::uint64_t brick;
    std::uint32_t voxel;
    std::uint32_t surfel;
  };
  std::vector<Item> items(surfels.size());
  for (std::uint32_t i = 0; i < surfels.size(); ++i) {
    const Int3 v = voxel_of(surfels[i].position);
    std::int32_t inside = 0;
    for (std::size_t a = 3; a-- > 0;) {
      inside = inside * kVoxels + v[a] % kVoxels;
      end_[a] = std::max(end_[a], v[a] + 1);
    }
    items[i] = {key_of(divided(v, kVoxels)), static_cast<std::uint32_t>(inside), i};
  }
  std::sort(items.begin(), items.end(), [](const Item& l, const Item& r) {
    if (l.brick != r.brick) return l.brick < r.brick;
    return l.voxel != r.voxel ? l.voxel < r.voxel : l.surfel < r.surfel;
  });
  std::vector<std::uint64_t> keys;
  order_.reserve(items.size());
  for (std::size_t i = 0; i < items.size(); ++i) {
    const bool new_brick = i == 0 || items[i].brick != items[i - 1].brick;
    if (new_brick) {
      keys.push_back(items[i].brick);
      bricks_.emplace_back();
    }
    if (new_brick || items[i].voxel != items[i - 1].voxel) {
      bricks_.back().occupied[items[i].voxel / 64] |= std::uint64_t{1} << (items[i].voxel % 64);
      voxel_begin_.push_back(static_cast<std::uint32_t>(i));
    }
    order_.push_back(items[i].surfel);
  }
  voxel_begin_.push_back(static_cast<std::uint32_t>(items.size()));
  std::uint32_t before = 0;
  for (Brick& b : bricks_)
    for (std::size_t w = 0; w < b.occupied.size(); ++w) {
      b.before[w] = before;
      before += static_cast<std::uint32_t>(std::popcount(b.occupied[w]));
    }
  slots_.assign(std::bit_ceil(3 * keys.size() + 2), {kEmpty, 0});
  for (std::uint32_t b = 0; b < keys.size(); ++b) {
    insert(keys[b], b);
    constexpr std::uint64_t kMask = (1u << 21) - 1;
    const Int3 at = {static_cast<std::int32_t>(keys[b] & kMask),
                     static_cast<std::int32_t>(keys[b] >> 21 & kMask),
                     static_cast<std::int32_t>(keys[b] >> 42)};
    insert(key_of(divided(at, kVoxels)) | kRegion, 0);
  }
}

const SurfelScene::Slot* SurfelScene::find(std::uint64_t key) const {
  for (std::size_t s = mix(key) & (slots_.size() - 1);; s = (s + 1) & (slots_.size() - 1)) {
    if (slots_[s].key == key) return &slots_[s];
    if (slots_[s].key == kEmpty) return nullptr;
  }
}

void SurfelScene::insert(std::uint64_t key, std::uint32_t brick) {
  std::size_t s = mix(key) & (slots_.size() - 1);
  while (slots_[s].key != kEmpty && slots_[s].key != key) s = (s + 1) & (slots_.size() - 1);
  slots_[s] = {key, brick};
}

void SurfelScene::meet(std::uint32_t voxel, const Float3& from, const Float3& way, float near,
                       std::uint32_t own, Sight& best) const {
  for (std::uint32_t k = voxel_begin_[voxel]; k < voxel_begin_[voxel + 1]; ++k) {
    const std::uint32_t i = order_[k];
    const JobSurfel& s = surfels_[i];
    const float area = norm(s.area);
    if (i == own || !(area > 0.0f)) continue;
    const float cosine = -dot(s.area, way) / area;
    if (std::fabs(cosine) < kGrazing) continue;
    const Float3 to = s.position - from;
    const float distance = -dot(s.area, to) / (area * cosine);
    if (distance < near || (best.met && distance >= best.distance)) continue;
    const Float3 off = to - way * distance;
    const float radius = std::clamp(kDiskSpread * std::sqrt(area * 0.31830989f), kLeastRadius, kMostRadius);
    if (dot(off, off) <= radius * radius) best = {true, i, distance, cosine};
  }
}

SurfelScene::Sight SurfelScene::look(const Float3& from, const Float3& way, float near, float far,
                                     std::uint32_t own) const {
  const Float3 per = {1.0f / way[0], 1.0f / way[1], 1.0f / way[2]};
  Int3 voxel = voxel_of(from);
  Int3 brick = {-1, -1, -1}, region = {-1, -1, -1};
  const Slot* here = nullptr;
  bool any = false;
  for (;;) {
    if (const Int3 at = divided(voxel, kVoxels); at != brick) {
      brick = at;
      if (const Int3 around = divided(at, kVoxels); around != region) {
        region = around;
        any = find(key_of(around) | kRegion) != nullptr;
      }
      here = any ? find(key_of(at)) : nullptr;
    }
    if (here) {
      const Brick& b = bricks_[here->brick];
      const auto row = static_cast<std::uint32_t>((voxel[1] % kVoxels) * kVoxels + voxel[0] % kVoxels);
      const std::uint64_t word = b.occupied[static_cast<std::size_t>(voxel[2] % kVoxels)];
      const std::uint64_t bit = std::uint64_t{1} << row;
      if ((word & bit) != 0) {
        Sight sight;
        meet(b.before[static_cast<std::size_t>(voxel[2] % kVoxels)] +
                 static_cast<std::uint32_t>(std::popcount(word & (bit - 1))),
             from, way, near, own, sight);
        if (sight.met) return sight.distance <= far ? sight : Sight{};
      }
    }
    // On to the next voxel, or past the whole brick or region where that is empty.
    const std::int32_t size = here ? 1 : any ? kVoxels : kVoxels * kVoxels;
    float leave = std::numeric_limits<float>::infinity();
    std::size_t through = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::int32_t corner = voxel[a] / size * size + (way[a] > 0.0f ? size : 0);
      const float t = (static_cast<float>(corner * kCoarseCells) - from[a]) * per[a];
      if (t < leave) leave = t, through = a;
    }
    if (leave > far) return {};
    for (std::size_t a = 0; a < 3; ++a) {
      const std::int32_t low = voxel[a] / size * size;
      if (a == through) {
        voxel[a] = way[a] > 0.0f ? low + size : low - 1;
      } else if (size > 1) {
        const float p = (from[a] + leave * way[a]) / kCoarseCells;
        voxel[a] = std::clamp(static_cast<std::int32_t>(std::max(p, 0.0f)), low, low + size - 1);
      }
    }
    if (voxel[through] < 0 || voxel[through] >= end_[through]) return {};
  }
}

namespace {

/// What a surfel sees; front first. Shares of its looks.
struct Views {
  std::array<double, 2> open{};    ///< looks that leave the job
  std::array<double, 2> bright{};  ///< the same, those downwards count less
  std::array<double, 2> ended{};   ///< looks that end on something
  std::array<double, 2> deep{};    ///< and their length, cells
  std::array<double, 2> sky{};     ///< open looks at the sky, by their squared cosines
};

/// Whole part of a rate, and one more by chance.
std::uint64_t rounded(double rate, std::uint64_t bits) {
  const auto whole = static_cast<std::uint64_t>(rate);
  return whole + (static_cast<double>(bits >> 40) < (rate - static_cast<double>(whole)) * 0x1p24 ? 1 : 0);
}

class Looker {
 public:
  Looker(std::span<const JobSurfel> surfels, std::size_t groups, const Float3& up, double scale)
      : surfels_(surfels),
        scene_(surfels),
        up_(up),
        scale_(scale),
        views_(groups),
        members_(groups, 0),
        all_(groups, 0) {
    for (const JobSurfel& s : surfels) ++members_[s.patch], all_[s.patch] += s.surfels;
  }

  SightVotes run() {
    std::size_t compact_at = 1 << 16;
    for (std::uint32_t i = 0; i < surfels_.size(); ++i) {
      look_around(i);
      if (pairs_.size() > compact_at) {
        merge_votes(pairs_);
        compact_at = 2 * pairs_.size() + (1 << 16);
      }
    }
    merge_votes(pairs_);
    return result();
  }

 private:
  /// Calls see(side, way) for `looks` directions there and back.
  template <class See>
  void each_way(const JobSurfel& s, std::uint64_t seed, std::uint64_t looks, See&& see) const {
    const float area = norm(s.area);
    Dice dice(seed);
    for (std::uint64_t k = 0; k < looks;) {
      Float3 way = dice.way();
      const float cosine = dot(s.area, way) / area;
      if (std::fabs(cosine) < kFrank) continue;
      ++k;
      if (cosine < 0.0f) way = {-way[0], -way[1], -way[2]};
      see(std::size_t{0}, way);
      see(std::size_t{1}, Float3{-way[0], -way[1], -way[2]});
    }
  }

  void look_around(std::uint32_t i) {
    const JobSurfel& s = surfels_[i];
    if (!(dot(s.area, s.area) > 0.0f)) return;
    const Int3 voxel = voxel_of(s.position);
    const std::uint64_t seed = mix(key_of(voxel) + (std::uint64_t{s.surfels} << 56));
    const double rate =
        std::min(std::max(static_cast<double>(kLooks) / static_cast<double>(surfels_.size()),
                          static_cast<double>(kPerGroup) / static_cast<double>(members_[s.patch])),
                 static_cast<double>(kMost));
    // Few surfels look often rather than many seldom: what shuts a surfel in shows in many looks only.
    if (rounded(rate / static_cast<double>(kMost), seed) == 0) return;
    const std::uint64_t looks = kMost;
    const double weight = s.surfels / rate;
    const auto vote = static_cast<std::int64_t>(std::floor(kPairs * scale_ * weight / 2.0 + 0.5));
    Views seen;
    each_way(s, seed, looks, [&](std::size_t side, const Float3& way) {
      const SurfelScene::Sight sight = scene_.look(s.position, way, kLeastDistance, kFar, i);
      if (!sight.met) {
        seen.open[side] += 1.0;
        seen.bright[side] += dot(way, up_) > 0.0f ? 1.0 : kBelow;
        return;
      }
      seen.ended[side] += 1.0;
      seen.deep[side] += static_cast<double>(sight.distance);
      const std::uint32_t other = surfels_[sight.surfel].patch;
      if (other == s.patch || sight.distance < kNear || std::fabs(sight.cosine) < kFrank) return;
      const bool same = (side == 0) == (sight.cosine > 0.0f);
      pairs_.push_back(
          {std::min(s.patch, other), std::max(s.patch, other), same ? vote : 0, same ? 0 : vote});
    });
    const auto all = static_cast<double>(looks);
    const bool shut = seen.open[0] <= kShut * all && seen.open[1] <= kShut * all;
    if (shut && enclosed(i, seed, looks)) enclosed_ += weight * all;
    if (!shut && std::min(seen.open[0], seen.open[1]) <= kShut * all) shell_ += weight * all;
    looked_ += weight * all;
    look_up(i, seed, looks, weight);
    Views& sum = views_[s.patch];
    for (std::size_t side = 0; side < 2; ++side) {
      sum.open[side] += weight * seen.open[side];
      sum.bright[side] += weight * seen.bright[side];
      sum.ended[side] += weight * seen.ended[side];
      sum.deep[side] += weight * seen.deep[side];
    }
  }

  /// Looks at the sky. \param weight  of one look
  void look_up(std::uint32_t i, std::uint64_t seed, std::uint64_t looks, double weight) {
    const JobSurfel& s = surfels_[i];
    const float area = norm(s.area);
    Dice dice(mix(seed));
    std::array<double, 2> all{}, open{}, sky{};
    for (std::uint64_t k = 0; k < looks;) {
      const Float3 way = dice.way();
      if (dot(way, up_) < kSky) continue;
      ++k;
      const float cosine = dot(s.area, way) / area;
      if (std::fabs(cosine) < kGrazing) continue;
      const std::size_t side = cosine > 0.0f ? 0 : 1;
      all[side] += 1.0;
      if (scene_.look(s.position, way, kLeastDistance, kFar, i).met) continue;
      open[side] += 1.0;
      sky[side] += static_cast<double>(cosine * cosine);
    }
    for (std::size_t side = 0; side < 2; ++side) views_[s.patch].sky[side] += weight * sky[side];
    const double worth = weight * static_cast<double>(looks);
    looked_up_ += worth;
    if (open[0] + open[1] > kClear * (all[0] + all[1])) under_sky_ += worth;
    if (all[0] == 0.0 || all[1] == 0.0) return;  // not steep: the sky is on one side
    const double front = open[0] / all[0], back = open[1] / all[1];
    darker_ += worth * std::min(front, back);
    brighter_ += worth * std::max(front, back);
  }

  /// Layers of one surface, scanned several times, do not enclose each other: looks begin beyond them.
  bool enclosed(std::uint32_t i, std::uint64_t seed, std::uint64_t looks) const {
    std::array<double, 2> open{};
    each_way(surfels_[i], seed, looks, [&](std::size_t side, const Float3& way) {
      open[side] += scene_.look(surfels_[i].position, way, kNear, kFar, i).met ? 0.0 : 1.0;
    });
    return std::max(open[0], open[1]) <= kShut * static_cast<double>(looks);
  }

  /// Mean square of the points in a surfel over their squared mean: they thin out with the squared distance from
  /// a scanner, so it is near 1 where all stood far away.
  double density_spread() const {
    double none = 0.0, once = 0.0, twice = 0.0;
    for (const JobSurfel& s : surfels_) {
      const double points = double{s.points}, weight = s.surfels;
      none += weight, once += weight * points, twice += weight * points * points;
    }
    return once > 0.0 ? twice * none / (once * once) : 0.0;
  }

  SightVotes result() {
    SightVotes out;
    double ended = 0.0, deep = 0.0;
    for (const Views& v : views_) ended += v.ended[0] + v.ended[1], deep += v.deep[0] + v.deep[1];
    const double mean = ended > 0.0 ? deep / ended : 0.0;
    out.enclosed = looked_ > 0.0 ? enclosed_ / looked_ : 0.0;
    const bool shell = shell_ > kShell * looked_;
    if (out.enclosed > kRoom || (shell && density_spread() > kAmid))
      out.scene = SceneKind::kRoom;
    else if (under_sky_ > kUnderSky * looked_up_ && darker_ <= kOneSided * brighter_)
      out.scene = SceneKind::kFromAbove;
    else
      out.scene = shell ? SceneKind::kObject : SceneKind::kLand;
    const bool room = out.scene == SceneKind::kRoom;
    const bool above = out.scene == SceneKind::kFromAbove;
    if (!room && !above) out.pairs = std::move(pairs_);
    const double sides = room ? kRoomSides : above ? kSkySides : kSides;
    const double as = room ? kOpenInRoom * mean : std::max(kLeastOpen, kOpenOnLand * mean);
    for (std::uint32_t g = 0; g < views_.size(); ++g) {
      std::array<double, 2> worth{};
      for (std::size_t side = 0; side < 2; ++side) {
        const Views& v = views_[g];
        worth[side] = above                             ? v.sky[side]
                      : out.scene == SceneKind::kObject ? v.bright[side]
                                                        : v.deep[side] + as * v.bright[side];
      }
      const double sum = worth[0] + worth[1];
      const double lean = sum > 0.0 ? (worth[0] - worth[1]) / sum : 0.0;
      const auto vote = static_cast<std::int64_t>(
          std::floor(sides * scale_ * static_cast<double>(all_[g]) * std::fabs(lean) + 0.5));
      if (vote > 0)
        out.sides.push_back(
            {g, static_cast<std::uint32_t>(views_.size()), lean > 0.0 ? vote : 0, lean > 0.0 ? 0 : vote});
    }
    return out;
  }

  static constexpr float kFar = std::numeric_limits<float>::infinity();
  std::span<const JobSurfel> surfels_;
  SurfelScene scene_;
  Float3 up_;
  double scale_;
  std::vector<Views> views_;            ///< per group
  std::vector<std::uint64_t> members_;  ///< coarse surfels of a group
  std::vector<std::uint64_t> all_;      ///< and fine ones
  std::vector<PatchVote> pairs_;
  double enclosed_ = 0.0, shell_ = 0.0, looked_ = 0.0;
  double under_sky_ = 0.0, looked_up_ = 0.0, darker_ = 0.0, brighter_ = 0.0;
};

}  // namespace

SightVotes vote_by_sight(std::span<const JobSurfel> surfels, std::size_t groups, const Float3& up,
                         double scale) {
  return Looker(surfels, groups, up, scale).run();
}

std::vector<PatchVote> vote_by_sensors(std::span<const JobSurfel> surfels, std::size_t groups,
                                       std::span<const Float3> sensors, double scale) {
  std::vector<PatchVote> votes(groups);
  for (std::uint32_t g = 0; g < groups; ++g) votes[g] = {g, static_cast<std::uint32_t>(groups), 0, 0};
  std::vector<std::uint64_t> members(groups, 0);
  for (const JobSurfel& s : surfels) ++members[s.patch];
  const SurfelScene scene(surfels);
  std::vector<std::pair<float, std::uint32_t>> near(sensors.size());
  const std::size_t asked = std::min(sensors.size(), kAskedSensors);
  for (std::uint32_t i = 0; i < surfels.size(); ++i) {
    const JobSurfel& s = surfels[i];
    const float area = norm(s.area);
    if (!(area > 0.0f)) continue;
    const double rate = std::min(
        1.0, std::max(2.0 * static_cast<double>(kLooks) / static_cast<double>(surfels.size() * asked),
                      static_cast<double>(kPerGroup) / static_cast<double>(members[s.patch])));
    const std::uint64_t seed = mix(key_of(voxel_of(s.position)) + (std::uint64_t{s.surfels} << 56));
    if (rounded(rate, seed) == 0) continue;
    for (std::uint32_t k = 0; k < sensors.size(); ++k) {
      const Float3 to = sensors[k] - s.position;
      near[k] = {dot(to, to), k};
    }
    std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(asked), near.end());
    float first = 0.0f;  // squared distance of the nearest sensor that is not hidden
    for (std::size_t k = 0; k < asked && near[k].first > 0.0f; ++k) {
      const Float3& at = sensors[near[k].second];
      const float distance = std::sqrt(near[k].first);
      Float3 way;
      for (std::size_t a = 0; a < 3; ++a) {
        way[a] = (at[a] - s.position[a]) / distance;
        if (std::fabs(way[a]) < 1e-6f) way[a] = 1e-6f;
      }
      const float cosine = dot(s.area, way) / area;
      if (std::fabs(cosine) < kGrazing) continue;
      if (scene.look(s.position, way, kNear / 4.0f, distance, i).met) continue;
      if (first == 0.0f) first = near[k].first;
      const double weight = static_cast<double>(cosine * cosine) * static_cast<double>(first / near[k].first);
      const auto vote = static_cast<std::int64_t>(std::floor(scale * s.surfels / rate * weight + 0.5));
      (cosine > 0.0f ? votes[s.patch].same : votes[s.patch].opposite) += vote;
    }
  }
  std::erase_if(votes, [](const PatchVote& v) { return v.same == v.opposite; });
  return votes;
}

}  // namespace tessera
