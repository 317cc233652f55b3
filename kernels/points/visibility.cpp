#include "kernels/points/visibility.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

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
/// Of a group that is asked, however many are: a rate of so many looks leaves one in fifty without any.
constexpr std::uint64_t kLeastAsked = 4 * kMax;
constexpr std::size_t kHalvings = 32;          ///< of it at most
constexpr std::size_t kMergePairs = 1u << 18;  ///< pairs are added up from so many on
constexpr std::size_t kQueriedSensors = 8;     ///< the nearest
constexpr double kBelow = 0.1;  ///< weight of open sight downwards: nobody scans the earth from below
// Scenes. Figures on simulated and real scans: README, "Measured".
constexpr double kShut = 0.1;  ///< share of looks into the open below which a side is shut in
constexpr double kRoom =
    0.01;                      ///< share of enclosed surfels from which the job is a room; objects have 0.004
constexpr double kAmid = 3.0;  ///< spread of densities (1: even) from which the scanner stood amid its scene
/// In fewer surfels a dense part of an object spreads them as much: animals of 3,400 points to 3.5, rooms from 7.7.
constexpr std::uint64_t kTellingSurfels = 8192;
constexpr double kAmidFew = 5.5;
/// Fronts that see each other, and a spread that tells the same of a scanner among them: streets from stations on the ground have 2.0
/// to 2.6 and 0.55 to 0.59; objects with as deep folds are scanned evenly from around (1.4, 0.59), animals face outwards (3.2, 0.32).
constexpr double kAmidFacing = 1.7, kFacing = 0.5;
constexpr double kShell = 0.2;  ///< share of surfels with one side shut in from which it is an object
/// In few surfels that lie evenly gaps between rings of points open what is shut in: animals have 0.13 to 0.45.
constexpr double kShellFew = 0.1, kEven = 1.5;
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
  Views views;
  bool enclosed = false, shell = false;
};

/// A surfel that looks around.
struct LookingSurfel {
  JobSurfel surfel;
  std::uint32_t part = 0, disk = 0;
  double rate = 0.0;       ///< looks in the mean
  std::uint64_t fine = 0;  ///< surfels of its group
};

std::uint64_t seed_of(const JobSurfel& s) {
  return mix(voxel_key(coarse_voxel_of(s.position)) + (std::uint64_t{s.surfels} << 56));
}

SightRay ray_from(const LookingSurfel& l, const Float3& direction, float near) {
  SightRay ray;
  ray.from = l.surfel.position, ray.direction = direction, ray.near = near;
  ray.own_part = l.part, ray.own_disk = l.disk;
  return ray;
}

/// Surfels of groups, coarse and fine.
struct GroupSizes {
  std::uint32_t first = 0;
  std::vector<std::uint64_t> coarse, fine;

  explicit GroupSizes(std::uint32_t first_group, std::size_t count = 0)
      : first(first_group), coarse(count, 0), fine(count, 0) {}
  /// Those in [first, last).
  void add(std::span<const JobSurfel> surfels, std::uint32_t last) {
    for (const JobSurfel& s : surfels) {
      if (s.patch < first || s.patch >= last) continue;
      const std::size_t g = s.patch - first;
      if (g >= coarse.size()) coarse.resize(g + 1, 0), fine.resize(g + 1, 0);
      ++coarse[g], fine[g] += s.surfels;
    }
  }
};

/// Of every surfel of a part the disk that it is in.
std::vector<std::uint32_t> disk_numbers(std::span<const JobSurfel> surfels) {
  std::vector<std::uint32_t> of;
  const SurfelDisks disks(surfels, &of);
  return of;
}

class Looker {
 public:
  /// \param asked  the groups that look; null = all
  Looker(const SurfelParts& parts, const Float3& up, double scale, const SightRun& run,
         std::function<bool(std::uint32_t)> asked = nullptr)
      : parts_(parts),
        run_(run),
        scene_(parts, run.bytes, run.for_each),
        up_(up),
        scale_(scale),
        asked_(std::move(asked)),
        shared_(parts.first_shared, parts.shared) {
    survey();
  }

  VisibilityVotes run(std::optional<SceneKind> known) {
    for (std::uint32_t p = 0; p < parts_.parts.size(); ++p) choose_lookers(p, [] {});
    std::vector<PatchVote> pairs;
    const std::vector<Answer> answers = look(pairs);
    return result(known, answers, std::move(pairs));
  }

  std::vector<GroupView> views(SceneKind scene, double sight) {
    std::vector<GroupView> out;
    GroupViews seen;
    const auto flush = [&] {
      std::vector<PatchVote> pairs;
      add_up(look(pairs), seen);
      lookers_.clear();
    };
    const auto tell_below = [&](std::uint32_t group) {
      const auto end = seen.lower_bound(group);
      for (auto at = seen.begin(); at != end; ++at)
        out.push_back({at->first, lean(at->second.first, scene, sight)});
      seen.erase(seen.begin(), end);
    };
    // Groups end with their part, so what is held does not grow with their number.
    for (std::uint32_t p = 0; p < parts_.parts.size(); ++p)
      choose_lookers(p, [&] {
        if (lookers_.size() < kMaxLooks / kMax) return;
        flush();
        tell_below(parts_.parts[p].first_group);
      });
    flush();
    tell_below(SurfelDisks::kNobody);
    return out;
  }

 private:
  /// \param pairs  groups that see each other, merged
  std::vector<Answer> look(std::vector<PatchVote>& pairs) {
    std::vector<Answer> answers(lookers_.size());
    std::vector<SightRay> rays;
    const std::size_t batch = std::max<std::uint64_t>(run_.lookers, 1);
    for (std::size_t first = 0; first < lookers_.size(); first += batch) {
      const std::size_t count = std::min(batch, lookers_.size() - first);
      const std::span<Answer> out(answers.data() + first, count);
      look_around(std::span(lookers_).subspan(first, count), rays, out, pairs);
      if (pairs.size() > kMergePairs) merge_votes(pairs);
    }
    merge_votes(pairs);
    return answers;
  }

  /// Looks of a surfel in the mean, while its group of so many has `per_group`.
  double rate(std::uint64_t members, double per_group) const {
    return std::min(std::max(static_cast<double>(kLooks) / static_cast<double>(surfels_),
                             per_group / static_cast<double>(members)),
                    static_cast<double>(kMax));
  }

  void add_looks(const GroupSizes& groups, std::array<double, kHalvings>& all) const {
    for (const std::uint64_t members : groups.coarse)
      for (std::size_t k = 0; k < kHalvings && members > 0; ++k)
        all[k] += static_cast<double>(members) * rate(members, halved(k));
  }

  static double halved(std::size_t times) {
    return std::ldexp(static_cast<double>(kPerGroup), -static_cast<int>(times));
  }

  /// What is asked of all surfels. Few surfels look often rather than many seldom: what shuts a surfel in shows in many
  /// looks only. Where groups are too many for their share of looks, as in a crown of leaves, all of them get less.
  void survey() {
    if (!asked_)
      for (const SurfelParts::Part& p : parts_.parts) surfels_ += p.surfels;
    std::array<double, kHalvings> all{};  // looks, per halving of per_group; without it they are kLooks
    for (std::size_t p = 0; p < parts_.parts.size(); ++p) {
      std::vector<JobSurfel> surfels = parts_.load(p);
      scene_.add(p, surfels);
      if (asked_) {
        std::erase_if(surfels, [&](const JobSurfel& s) { return !asked_(s.patch); });
        surfels_ += surfels.size();
      }
      for (const JobSurfel& s : surfels) {
        const double points = double{s.points}, weight = s.surfels;
        none_ += weight, once_ += weight * points, twice_ += weight * points * points;
        fine_ += s.surfels;
      }
      GroupSizes sizes(parts_.parts[p].first_group);
      sizes.add(surfels, parts_.first_shared);
      shared_.add(surfels, SurfelDisks::kNobody);
      add_looks(sizes, all);
      for (const std::uint64_t members : sizes.coarse) groups_ += members > 0 ? 1 : 0;
    }
    add_looks(shared_, all);
    scene_.finish();
    const auto most = static_cast<double>(std::max(kMaxLooks, asked_ ? kLeastAsked * groups_ : 0));
    std::size_t k = 0;
    while (k + 1 < kHalvings && all[k] > most) ++k;
    per_group_ = halved(k);
  }

  /// \param chosen  called after each one
  template <class Chosen>
  void choose_lookers(std::uint32_t p, const Chosen& chosen) {
    const std::vector<JobSurfel> surfels = parts_.load(p);
    GroupSizes sizes(parts_.parts[p].first_group);
    sizes.add(surfels, parts_.first_shared);  // a group that looks does so as a whole
    std::vector<std::uint32_t> disks;
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      const JobSurfel& s = surfels[i];
      if (asked_ && !asked_(s.patch)) continue;
      const GroupSizes& of = s.patch >= parts_.first_shared ? shared_ : sizes;
      const double looks = rate(of.coarse[s.patch - of.first], per_group_);
      if (rounded(looks / static_cast<double>(kMax), seed_of(s)) == 0) continue;
      if (disks.empty()) disks = disk_numbers(surfels);
      if (disks[i] == SurfelDisks::kNobody) continue;
      lookers_.push_back({s, p, disks[i], looks, of.fine[s.patch - of.first]});
      chosen();
    }
  }

  /// kMax directions there and back, there first.
  static void add_rays(const LookingSurfel& l, float near, std::vector<SightRay>& rays) {
    const float area = norm(l.surfel.area);
    Dice dice(seed_of(l.surfel));
    for (std::uint64_t k = 0; k < kMax;) {
      Float3 direction = dice.direction();
      const float cosine = dot(l.surfel.area, direction) / area;
      if (std::fabs(cosine) < kFrank) continue;
      ++k;
      if (cosine < 0.0f) direction = {-direction[0], -direction[1], -direction[2]};
      rays.push_back(ray_from(l, direction, near));
      rays.push_back(ray_from(l, {-direction[0], -direction[1], -direction[2]}, near));
    }
  }

  void look_around(std::span<const LookingSurfel> lookers, std::vector<SightRay>& rays,
                   std::span<Answer> answers, std::vector<PatchVote>& pairs) {
    rays.clear();
    rays.reserve(lookers.size() * kRays);
    for (const LookingSurfel& l : lookers) add_rays(l, kMinDistance, rays);
    scene_.trace(rays);
    std::vector<std::size_t> shut;
    for (std::size_t k = 0; k < lookers.size(); ++k) {
      const std::array<double, 2> open =
          take_views(lookers[k], std::span(rays).subspan(k * kRays, kRays), answers[k].views, pairs);
      const auto most = kShut * static_cast<double>(kMax);
      if (open[0] <= most && open[1] <= most)
        shut.push_back(k);
      else
        answers[k].shell = std::min(open[0], open[1]) <= most;
    }
    // Layers of one surface, scanned several times, do not enclose each other: looks begin beyond them.
    rays.clear();
    for (const std::size_t k : shut) add_rays(lookers[k], kNear, rays);
    scene_.trace(rays);
    for (std::size_t i = 0; i < shut.size(); ++i) {
      std::array<double, 2> open{};
      for (std::size_t r = 0; r < kRays; ++r) open[r % 2] += rays[i * kRays + r].met ? 0.0 : 1.0;
      answers[shut[i]].enclosed = std::max(open[0], open[1]) <= kShut * static_cast<double>(kMax);
    }
  }

  /// \returns looks of both sides into the open
  std::array<double, 2> take_views(const LookingSurfel& l, std::span<const SightRay> rays, Views& seen,
                                   std::vector<PatchVote>& pairs) const {
    const std::uint32_t own = l.surfel.patch;
    const auto vote = static_cast<std::int64_t>(std::floor(kPairs * scale_ * weight(l) / 2.0 + 0.5));
    for (std::size_t r = 0; r < rays.size(); ++r) {
      const SightRay& ray = rays[r];
      const std::size_t side = r % 2;
      if (!ray.met) {
        seen.open[side] += 1.0;
        seen.bright[side] += dot(ray.direction, up_) > 0.0f ? 1.0 : kBelow;
        continue;
      }
      seen.ended[side] += 1.0;
      seen.deep[side] += static_cast<double>(ray.distance);
      if (ray.patch == SurfelDisks::kNobody || ray.patch == own || ray.distance < kNear ||
          std::fabs(ray.cosine) < kFrank)
        continue;
      const bool same = (side == 0) == (ray.cosine > 0.0f);
      pairs.push_back({std::min(own, ray.patch), std::max(own, ray.patch), same ? vote : 0, same ? 0 : vote});
    }
    return seen.open;
  }

  /// Of one look.
  static double weight(const LookingSurfel& l) { return l.surfel.surfels / l.rate; }

  /// Mean square of the points in a surfel over their squared mean: they thin out with the squared distance from
  /// a scanner, so it is near 1 where all stood far away.
  double density_spread() const { return once_ > 0.0 ? twice_ * none_ / (once_ * once_) : 0.0; }

  using GroupViews = std::map<std::uint32_t, std::pair<Views, std::uint64_t>>;  ///< and fine surfels

  void add_up(const std::vector<Answer>& answers, GroupViews& views) const {
    for (std::size_t k = 0; k < answers.size(); ++k) {
      const Views& seen = answers[k].views;
      const double w = weight(lookers_[k]);
      auto& [sum, fine] = views[lookers_[k].surfel.patch];
      fine = lookers_[k].fine;
      for (std::size_t side = 0; side < 2; ++side) {
        sum.open[side] += w * seen.open[side];
        sum.bright[side] += w * seen.bright[side];
        sum.ended[side] += w * seen.ended[side];
        sum.deep[side] += w * seen.deep[side];
      }
    }
  }

  /// What a group sees with one side against the other. \param sight  mean length
  static double lean(const Views& v, SceneKind scene, double sight) {
    const double as =
        scene == SceneKind::kRoom ? kOpenInRoom * sight : std::max(kMinOpen, kOpenOnLand * sight);
    std::array<double, 2> worth{};
    for (std::size_t side = 0; side < 2; ++side)
      worth[side] = scene == SceneKind::kObject ? v.bright[side] : v.deep[side] + as * v.bright[side];
    const double sum = worth[0] + worth[1];
    return sum > 0.0 ? (worth[0] - worth[1]) / sum : 0.0;
  }

  VisibilityVotes result(std::optional<SceneKind> known, const std::vector<Answer>& answers,
                         std::vector<PatchVote> pairs) const {
    VisibilityVotes out;
    double looked = 0.0, enclosed = 0.0, shells = 0.0, facing = 0.0;
    for (std::size_t k = 0; k < answers.size(); ++k) {
      const double w = weight(lookers_[k]);
      looked += w;
      enclosed += answers[k].enclosed ? w : 0.0, shells += answers[k].shell ? w : 0.0;
      const Views& v = answers[k].views;
      facing += w * std::min(v.ended[0], v.ended[1]) / static_cast<double>(kMax);
    }
    GroupViews views;
    add_up(answers, views);
    double ended = 0.0, deep = 0.0;
    for (const auto& [group, of] : views) {
      const Views& v = of.first;
      ended += v.ended[0] + v.ended[1], deep += v.deep[0] + v.deep[1];
    }
    out.sight = ended > 0.0 ? deep / ended : 0.0;
    out.enclosed = looked > 0.0 ? enclosed / looked : 0.0;
    out.shells = looked > 0.0 ? shells / looked : 0.0;
    out.facing = looked > 0.0 ? facing / looked : 0.0;
    out.density_spread = density_spread();
    const bool few = fine_ < kTellingSurfels;
    const bool shell = out.shells > (few && out.density_spread < kEven ? kShellFew : kShell);
    if (known)
      out.scene = *known;
    else if (out.enclosed > kRoom || (shell && out.density_spread > (few ? kAmidFew : kAmid)) ||
             (shell && !few && out.density_spread > kAmidFacing && out.facing > kFacing))
      out.scene = SceneKind::kRoom;
    else
      out.scene = shell ? SceneKind::kObject : SceneKind::kLand;
    const bool room = out.scene == SceneKind::kRoom;
    if (!room) out.pairs = std::move(pairs);
    const double sides = room ? kRoomSides : kSides;
    for (const auto& [group, of] : views) {
      const double leans = lean(of.first, out.scene, out.sight);
      const auto vote = static_cast<std::int64_t>(
          std::floor(sides * scale_ * static_cast<double>(of.second) * std::fabs(leans) + 0.5));
      if (vote > 0)
        out.sides.push_back({group, SurfelDisks::kNobody, leans > 0.0 ? vote : 0, leans > 0.0 ? 0 : vote});
    }
    return out;
  }

  static constexpr std::size_t kRays = 2 * kMax;
  const SurfelParts& parts_;
  const SightRun& run_;
  SurfelScene scene_;
  Float3 up_;
  double scale_;
  std::function<bool(std::uint32_t)> asked_;
  double per_group_ = 0.0;
  std::uint64_t surfels_ = 0, fine_ = 0, groups_ = 0;
  double none_ = 0.0, once_ = 0.0, twice_ = 0.0;  ///< sums of powers of the points in a surfel
  GroupSizes shared_;
  std::vector<LookingSurfel> lookers_;
};

/// The sensors that surfels ask: the nearest.
class SensorVotes {
 public:
  SensorVotes(const SurfelParts& parts, std::span<const Float3> sensors, double scale, const SightRun& run)
      : parts_(parts),
        sensors_(sensors),
        scale_(scale),
        run_(run),
        scene_(parts, run.bytes, run.for_each),
        asked_(std::min(sensors.size(), kQueriedSensors)) {
    for (std::size_t p = 0; p < parts.parts.size(); ++p) {
      scene_.add(p, parts.load(p));
      surfels_ += parts.parts[p].surfels;
    }
    scene_.finish();
  }

  std::vector<PatchVote> votes_of(std::uint32_t part) {
    const std::vector<JobSurfel> surfels = parts_.load(part);
    const std::uint32_t first = parts_.parts[part].first_group;
    GroupSizes sizes(first);
    sizes.add(surfels, SurfelDisks::kNobody);
    const std::vector<std::uint32_t> disks = disk_numbers(surfels);
    std::vector<PatchVote> votes(sizes.coarse.size());
    for (std::uint32_t g = 0; g < votes.size(); ++g) votes[g] = {first + g, SurfelDisks::kNobody, 0, 0};
    std::vector<Look> looks;
    std::vector<SightRay> rays;
    const std::size_t batch = std::max<std::uint64_t>(run_.lookers * 2 * kMax, asked_);
    for (std::size_t i = 0; i <= surfels.size(); ++i) {
      if (i == surfels.size() || rays.size() + asked_ > batch) {
        scene_.trace(rays);
        for (const Look& look : looks) add_votes(look, rays, votes[look.group - first]);
        looks.clear(), rays.clear();
      }
      if (i == surfels.size() || !has_direction(surfels[i])) continue;
      const double rate =
          std::min(1.0, std::max(2.0 * static_cast<double>(kLooks) / static_cast<double>(surfels_ * asked_),
                                 static_cast<double>(kPerGroup) /
                                     static_cast<double>(sizes.coarse[surfels[i].patch - first])));
      if (rounded(rate, seed_of(surfels[i])) == 0) continue;
      look_out({surfels[i], part, disks[i], rate, 0}, looks, rays);
    }
    std::erase_if(votes, [](const PatchVote& v) { return v.same == v.opposite; });
    return votes;
  }

 private:
  /// Rays of one surfel, nearest sensor first.
  struct Look {
    std::uint32_t group = 0;
    std::size_t first = 0, last = 0;
    double weight = 0.0;
    Float3 area{};
    std::array<float, kQueriedSensors> square{};  ///< distance of the sensors that rays go to
  };

  static bool has_direction(const JobSurfel& s) { return norm(s.area) > 0.0f; }

  void look_out(const LookingSurfel& l, std::vector<Look>& looks, std::vector<SightRay>& rays) {
    const JobSurfel& s = l.surfel;
    near_.resize(sensors_.size());
    for (std::uint32_t k = 0; k < sensors_.size(); ++k) {
      const Float3 to = sensors_[k] - s.position;
      near_[k] = {dot(to, to), k};
    }
    std::partial_sort(near_.begin(), near_.begin() + static_cast<std::ptrdiff_t>(asked_), near_.end());
    Look look = {s.patch, rays.size(), rays.size(), scale_ * s.surfels / l.rate, s.area, {}};
    const float area = norm(s.area);
    for (std::size_t k = 0; k < asked_ && near_[k].first > 0.0f; ++k) {
      const Float3& at = sensors_[near_[k].second];
      const float distance = std::sqrt(near_[k].first);
      Float3 direction;
      for (std::size_t a = 0; a < 3; ++a) {
        direction[a] = (at[a] - s.position[a]) / distance;
        if (std::fabs(direction[a]) < 1e-6f) direction[a] = 1e-6f;
      }
      if (std::fabs(dot(s.area, direction) / area) < kGrazing) continue;
      SightRay ray = ray_from(l, direction, kNear / 4.0f);
      ray.far = distance;
      look.square[rays.size() - look.first] = near_[k].first;
      rays.push_back(ray);
    }
    look.last = rays.size();
    looks.push_back(look);
  }

  static void add_votes(const Look& look, std::span<const SightRay> rays, PatchVote& to) {
    float first = 0.0f;  // squared distance of the nearest sensor that is not hidden
    for (std::size_t r = look.first; r < look.last; ++r) {
      const SightRay& ray = rays[r];
      if (ray.met) continue;
      const float cosine = dot(look.area, ray.direction) / norm(look.area);
      const float square = look.square[r - look.first];
      if (first == 0.0f) first = square;
      const double weight = static_cast<double>(cosine * cosine) * static_cast<double>(first / square);
      (cosine > 0.0f ? to.same : to.opposite) +=
          static_cast<std::int64_t>(std::floor(look.weight * weight + 0.5));
    }
  }

  const SurfelParts& parts_;
  std::span<const Float3> sensors_;
  double scale_;
  const SightRun& run_;
  SurfelScene scene_;
  std::size_t asked_;
  std::uint64_t surfels_ = 0;
  std::vector<std::pair<float, std::uint32_t>> near_;
};

}  // namespace

std::uint64_t sight_bytes(const SightRun& run, std::uint64_t surfels, std::uint64_t largest_part,
                          std::uint64_t bricks) {
  const std::uint64_t making = SurfelDisks::making_bytes(largest_part);
  // Lookers are drawn by chance: their number strays from the mean by a few hundred.
  const std::uint64_t lookers = std::min(surfels, kMaxLooks / kMax + 4096);
  const std::uint64_t pairs = std::min(2 * kMax * surfels, 2 * kMaxLooks);
  return std::max(2 * run.bytes, making + SurfelDisks::bytes(largest_part)) + making +
         SurfelScene::grid_bytes(bricks) +
         std::min(run.lookers, lookers) * 2 * kMax * (sizeof(SightRay) + 4) +
         lookers * (2 * sizeof(LookingSurfel) + 2 * sizeof(Answer)) + pairs * sizeof(PatchVote);
}

VisibilityVotes vote_by_visibility(const SurfelParts& parts, const Float3& up, double scale,
                                   std::optional<SceneKind> known, const SightRun& run) {
  return Looker(parts, up, scale, run).run(known);
}

std::vector<GroupView> look_from_groups(const SurfelParts& parts, const Float3& up,
                                        const std::function<bool(std::uint32_t)>& asked, double sight,
                                        const SightRun& run) {
  return Looker(parts, up, 0.0, run, asked).views(SceneKind::kRoom, sight);
}

void vote_by_sensors(const SurfelParts& parts, std::span<const Float3> sensors, double scale,
                     const SightRun& run,
                     const std::function<void(std::size_t part, std::vector<PatchVote> sides)>& take) {
  SensorVotes votes(parts, sensors, scale, run);
  for (std::uint32_t p = 0; p < parts.parts.size(); ++p) take(p, votes.votes_of(p));
}

}  // namespace tessera
