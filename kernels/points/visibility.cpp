#include "kernels/points/visibility.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "kernels/points/orientation.h"
#include "octree/portable_math.h"
#include "octree/vector.h"

namespace tessera {
namespace {

// Looks.
constexpr float kMinDistance = 0.5f;          ///< cells; what is nearer is the surface that is looked from
constexpr float kGrazing = 0.1f;              ///< cosine; flatter looks at a sensor are left out
constexpr float kFrank = 0.25f;               ///< cosine; flatter looks say nothing
constexpr float kNear = 2.0f * kCoarseCells;  ///< disks reach beyond edges: what ends nearer does not vote
constexpr std::uint64_t kLooks = 1u << 19;    ///< pairs, there and back, aimed at over the whole job
constexpr std::uint64_t kMaxLooks = 2 * kLooks;
constexpr std::uint64_t kPerGroup = 1024;  ///< small groups look more often, while the most allows it
constexpr std::uint64_t kMax = 32;         ///< of a surfel that looks at all
constexpr std::size_t kLookersPerPart = 128;
constexpr std::size_t kQueriedSensors = 8;  ///< the nearest
constexpr double kBelow = 0.1;  ///< weight of open sight downwards: nobody scans the earth from below
// Scenes. Figures on simulated and real scans: README, "Measured".
constexpr double kShut = 0.1;  ///< share of looks into the open below which a side is shut in
constexpr double kRoom =
    0.01;                      ///< share of enclosed surfels from which the job is a room; objects have 0.004
constexpr double kAmid = 3.0;  ///< spread of densities (1: even) from which the scanner stood amid its scene
/// In fewer surfels a dense part of an object spreads them as much: animals of 3,400 points to 3.5, rooms from 7.7.
constexpr std::uint64_t kTellingSurfels = 8192;
constexpr double kAmidFew = 5.5;
constexpr double kShell = 0.2;  ///< share of surfels with one side shut in from which it is an object
// Length, in mean lengths of sight, that sight of the open counts as.
constexpr double kOpenInRoom = 0.3;
constexpr double kOpenOnLand = 1.2;
constexpr double kMinOpen = 96.0;    ///< and at least so many cells on land: roofs see the ground below
constexpr double kRoomSides = 0.25;  ///< weight of sides against `scale` in a room; there pairs do not vote,
constexpr double kSides = 0.25;      ///< for the backs of furniture see each other's fronts; elsewhere
constexpr double kPairs = 0.1;       ///< weight of pairs

/// Random numbers that hang on a seed alone.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() { return state_ = mix(state_); }
  /// A direction, even over the sphere, no component 0.
  Float3 direction() {
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

/// What a surfel sees; front first. Shares of its looks.
struct Views {
  std::array<double, 2> open{};    ///< looks that leave the job
  std::array<double, 2> bright{};  ///< the same, those downwards count less
  std::array<double, 2> ended{};   ///< looks that end on something
  std::array<double, 2> deep{};    ///< and their length, cells
};

/// Whole part of a rate, and one more by chance.
std::uint64_t rounded(double rate, std::uint64_t bits) {
  const auto whole = static_cast<std::uint64_t>(rate);
  return whole + (static_cast<double>(bits >> 40) < (rate - static_cast<double>(whole)) * 0x1p24 ? 1 : 0);
}

/// What one surfel says after its looks.
struct Answer {
  std::uint32_t group = 0;
  double weight = 0.0;  ///< of one look
  Views views;
  bool enclosed = false, shell = false;
};

class Looker {
 public:
  Looker(std::span<const JobSurfel> surfels, std::size_t groups, const Float3& up, double scale)
      : surfels_(surfels), scene_(surfels), up_(up), scale_(scale), members_(groups, 0), all_(groups, 0) {
    for (const JobSurfel& s : surfels) ++members_[s.patch], all_[s.patch] += s.surfels;
    choose_lookers();
  }

  VisibilityVotes run(std::optional<SceneKind> known, const ForEach& for_each) {
    const std::size_t parts = (lookers_.size() + kLookersPerPart - 1) / kLookersPerPart;
    std::vector<Answer> answers(lookers_.size());
    std::vector<std::vector<PatchVote>> pairs(parts);
    for_each(parts, [&](std::size_t part) {
      const std::size_t end = std::min(lookers_.size(), (part + 1) * kLookersPerPart);
      for (std::size_t k = part * kLookersPerPart; k < end; ++k)
        answers[k] = look_around(lookers_[k], pairs[part]);
      merge_votes(pairs[part]);
    });
    std::vector<PatchVote> merged;
    for (const std::vector<PatchVote>& p : pairs) merged.insert(merged.end(), p.begin(), p.end());
    merge_votes(merged);
    return result(known, answers, std::move(merged));
  }

 private:
  /// Looks of a surfel in the mean, while its group has `per_group`.
  double rate(const JobSurfel& s, double per_group) const {
    return std::min(std::max(static_cast<double>(kLooks) / static_cast<double>(surfels_.size()),
                             per_group / static_cast<double>(members_[s.patch])),
                    static_cast<double>(kMax));
  }

  /// Few surfels look often rather than many seldom: what shuts a surfel in shows in many looks only. Where groups are
  /// too many for their share of looks, as in a crown of leaves, all of them get less.
  void choose_lookers() {
    for (per_group_ = static_cast<double>(kPerGroup);; per_group_ /= 2.0) {  // without it they are kLooks
      double all = 0.0;
      for (const JobSurfel& s : surfels_) all += rate(s, per_group_);
      if (all <= static_cast<double>(kMaxLooks)) break;
    }
    for (std::uint32_t i = 0; i < surfels_.size(); ++i)
      if (scene_.disk_of(i) != SurfelScene::kNobody &&
          rounded(rate(surfels_[i], per_group_) / static_cast<double>(kMax), seed_of(surfels_[i])) != 0)
        lookers_.push_back(i);
  }

  static std::uint64_t seed_of(const JobSurfel& s) {
    return mix(voxel_key(coarse_voxel_of(s.position)) + (std::uint64_t{s.surfels} << 56));
  }

  /// Calls see(side, way) for kMax directions there and back.
  template <class See>
  void each_direction(const JobSurfel& s, See&& see) const {
    const float area = norm(s.area);
    Dice dice(seed_of(s));
    for (std::uint64_t k = 0; k < kMax;) {
      Float3 direction = dice.direction();
      const float cosine = dot(s.area, direction) / area;
      if (std::fabs(cosine) < kFrank) continue;
      ++k;
      if (cosine < 0.0f) direction = {-direction[0], -direction[1], -direction[2]};
      see(std::size_t{0}, direction);
      see(std::size_t{1}, Float3{-direction[0], -direction[1], -direction[2]});
    }
  }

  Answer look_around(std::uint32_t i, std::vector<PatchVote>& pairs) const {
    const JobSurfel& s = surfels_[i];
    Answer out;
    out.group = s.patch;
    out.weight = s.surfels / rate(s, per_group_);
    const auto vote = static_cast<std::int64_t>(std::floor(kPairs * scale_ * out.weight / 2.0 + 0.5));
    Views& seen = out.views;
    each_direction(s, [&](std::size_t side, const Float3& direction) {
      const SurfelScene::Visibility visibility =
          scene_.look(s.position, direction, kMinDistance, kFar, scene_.disk_of(i));
      if (!visibility.met) {
        seen.open[side] += 1.0;
        seen.bright[side] += dot(direction, up_) > 0.0f ? 1.0 : kBelow;
        return;
      }
      seen.ended[side] += 1.0;
      seen.deep[side] += static_cast<double>(visibility.distance);
      const std::uint32_t other = scene_.patch_of(visibility.disk);
      if (other == SurfelScene::kNobody || other == s.patch || visibility.distance < kNear ||
          std::fabs(visibility.cosine) < kFrank)
        return;
      const bool same = (side == 0) == (visibility.cosine > 0.0f);
      pairs.push_back({std::min(s.patch, other), std::max(s.patch, other), same ? vote : 0, same ? 0 : vote});
    });
    const auto all = static_cast<double>(kMax);
    const bool shut = seen.open[0] <= kShut * all && seen.open[1] <= kShut * all;
    out.enclosed = shut && enclosed(i);
    out.shell = !shut && std::min(seen.open[0], seen.open[1]) <= kShut * all;
    return out;
  }

  /// Layers of one surface, scanned several times, do not enclose each other: looks begin beyond them.
  bool enclosed(std::uint32_t i) const {
    std::array<double, 2> open{};
    each_direction(surfels_[i], [&](std::size_t side, const Float3& direction) {
      open[side] +=
          scene_.look(surfels_[i].position, direction, kNear, kFar, scene_.disk_of(i)).met ? 0.0 : 1.0;
    });
    return std::max(open[0], open[1]) <= kShut * static_cast<double>(kMax);
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

  VisibilityVotes result(std::optional<SceneKind> known, const std::vector<Answer>& answers,
                         std::vector<PatchVote> pairs) const {
    VisibilityVotes out;
    std::vector<Views> views(members_.size());
    double looked = 0.0, enclosed = 0.0, shells = 0.0;
    for (const Answer& a : answers) {
      looked += a.weight;
      enclosed += a.enclosed ? a.weight : 0.0, shells += a.shell ? a.weight : 0.0;
      Views& sum = views[a.group];
      for (std::size_t side = 0; side < 2; ++side) {
        sum.open[side] += a.weight * a.views.open[side];
        sum.bright[side] += a.weight * a.views.bright[side];
        sum.ended[side] += a.weight * a.views.ended[side];
        sum.deep[side] += a.weight * a.views.deep[side];
      }
    }
    double ended = 0.0, deep = 0.0;
    for (const Views& v : views) ended += v.ended[0] + v.ended[1], deep += v.deep[0] + v.deep[1];
    const double mean = ended > 0.0 ? deep / ended : 0.0;
    out.enclosed = looked > 0.0 ? enclosed / looked : 0.0;
    out.shells = looked > 0.0 ? shells / looked : 0.0;
    out.density_spread = density_spread();
    const bool shell = out.shells > kShell;
    const std::uint64_t fine = std::accumulate(all_.begin(), all_.end(), std::uint64_t{0});
    if (known)
      out.scene = *known;
    else if (out.enclosed > kRoom ||
             (shell && out.density_spread > (fine >= kTellingSurfels ? kAmid : kAmidFew)))
      out.scene = SceneKind::kRoom;
    else
      out.scene = shell ? SceneKind::kObject : SceneKind::kLand;
    const bool room = out.scene == SceneKind::kRoom;
    if (!room) out.pairs = std::move(pairs);
    const double sides = room ? kRoomSides : kSides;
    const double as = room ? kOpenInRoom * mean : std::max(kMinOpen, kOpenOnLand * mean);
    for (std::uint32_t g = 0; g < views.size(); ++g) {
      std::array<double, 2> worth{};
      for (std::size_t side = 0; side < 2; ++side) {
        const Views& v = views[g];
        worth[side] = out.scene == SceneKind::kObject ? v.bright[side] : v.deep[side] + as * v.bright[side];
      }
      const double sum = worth[0] + worth[1];
      const double lean = sum > 0.0 ? (worth[0] - worth[1]) / sum : 0.0;
      const auto vote = static_cast<std::int64_t>(
          std::floor(sides * scale_ * static_cast<double>(all_[g]) * std::fabs(lean) + 0.5));
      if (vote > 0)
        out.sides.push_back(
            {g, static_cast<std::uint32_t>(views.size()), lean > 0.0 ? vote : 0, lean > 0.0 ? 0 : vote});
    }
    return out;
  }

  static constexpr float kFar = std::numeric_limits<float>::infinity();
  std::span<const JobSurfel> surfels_;
  SurfelScene scene_;
  Float3 up_;
  double scale_;
  double per_group_ = 0.0;
  std::vector<std::uint64_t> members_;  ///< coarse surfels of a group
  std::vector<std::uint64_t> all_;      ///< and fine ones
  std::vector<std::uint32_t> lookers_;
};

}  // namespace

VisibilityVotes vote_by_visibility(std::span<const JobSurfel> surfels, std::size_t groups, const Float3& up,
                                   double scale, std::optional<SceneKind> known, const ForEach& for_each) {
  return Looker(surfels, groups, up, scale).run(known, for_each);
}

std::vector<PatchVote> vote_by_sensors(std::span<const JobSurfel> surfels, std::size_t groups,
                                       std::span<const Float3> sensors, double scale) {
  std::vector<PatchVote> votes(groups);
  for (std::uint32_t g = 0; g < groups; ++g) votes[g] = {g, static_cast<std::uint32_t>(groups), 0, 0};
  std::vector<std::uint64_t> members(groups, 0);
  for (const JobSurfel& s : surfels) ++members[s.patch];
  const SurfelScene scene(surfels);
  std::vector<std::pair<float, std::uint32_t>> near(sensors.size());
  const std::size_t requested = std::min(sensors.size(), kQueriedSensors);
  for (std::uint32_t i = 0; i < surfels.size(); ++i) {
    const JobSurfel& s = surfels[i];
    const float area = norm(s.area);
    if (!(area > 0.0f)) continue;
    const double rate = std::min(
        1.0, std::max(2.0 * static_cast<double>(kLooks) / static_cast<double>(surfels.size() * requested),
                      static_cast<double>(kPerGroup) / static_cast<double>(members[s.patch])));
    const std::uint64_t seed = mix(voxel_key(coarse_voxel_of(s.position)) + (std::uint64_t{s.surfels} << 56));
    if (rounded(rate, seed) == 0) continue;
    for (std::uint32_t k = 0; k < sensors.size(); ++k) {
      const Float3 to = sensors[k] - s.position;
      near[k] = {dot(to, to), k};
    }
    std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(requested), near.end());
    float first = 0.0f;  // squared distance of the nearest sensor that is not hidden
    for (std::size_t k = 0; k < requested && near[k].first > 0.0f; ++k) {
      const Float3& at = sensors[near[k].second];
      const float distance = std::sqrt(near[k].first);
      Float3 direction;
      for (std::size_t a = 0; a < 3; ++a) {
        direction[a] = (at[a] - s.position[a]) / distance;
        if (std::fabs(direction[a]) < 1e-6f) direction[a] = 1e-6f;
      }
      const float cosine = dot(s.area, direction) / area;
      if (std::fabs(cosine) < kGrazing) continue;
      if (scene.look(s.position, direction, kNear / 4.0f, distance, scene.disk_of(i)).met) continue;
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
