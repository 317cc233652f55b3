#include "kernels/blends/fishbone_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <unordered_map>

namespace tessera {
namespace {

constexpr int kMaxRounds = 40;  ///< of planes and fits; each leaves about a third of what the spine is off
/// Of the half width: moves of the spine from round to round that end it.
constexpr double kConverged = 1e-8;
constexpr double kConvergedNoise = 0.01;  ///< or of the rms distance of vertices to their profiles
constexpr double kWaversNoise = 2.0, kWaversShare = 0.85,
                 kSameNoise = 0.99;   ///< as much as a round ago: it wavers
constexpr int kPatientRounds = 3;     ///< in which ribs that fit badly may get better planes
constexpr double kWindow = 1.5;       ///< ribs to each side whose vertices a rib sees
constexpr std::size_t kMinFlank = 3;  ///< vertices of a rib on each flank
constexpr int kProfileSmooths = 12, kSpineSmooths = 16;
constexpr double kFlankEdges = 3.0,
                 kFlankShare = 0.8;  ///< how much of the flanks is looked at: edges, half widths
constexpr double kOffFitEdges = 1.5, kOffShare = 0.35;  ///< vertices farther off are of something else
constexpr double kProfileFacing = 0.2;  ///< cosine between a vertex's normal and the profile's
constexpr double kNearCurve = 3.0;      ///< of half the band and a flank
constexpr double kBadRib = 3.0;         ///< of the median rms: the blend has ended
constexpr double kFine = 0.02;          ///< of an edge: a rib that fits so well is never bad
constexpr double kRough = 0.3;          ///< of the flank: what lies so far off a line on average is no flank
constexpr double kMinApart = 0.15;      ///< of the spacing: ends of ribs

/// Ribs by cells of their origins: every cell has those of its neighbours, too.
class NearRibs {
 public:
  NearRibs(const RibPlanes& planes, double radius) : planes_(planes), cell_(radius) {
    for (std::uint32_t i = 0; i < planes.size(); ++i) {
      const Cell c = cell(planes[i].origin);
      for (std::int64_t z = c[2] - 1; z <= c[2] + 1; ++z)
        for (std::int64_t y = c[1] - 1; y <= c[1] + 1; ++y)
          for (std::int64_t x = c[0] - 1; x <= c[0] + 1; ++x) cells_[{x, y, z}].push_back(i);
    }
  }
  /// The nearest one within reach, -1: none.
  std::int64_t nearest(const Double3& p) const {
    const auto at = cells_.find(cell(p));
    if (at == cells_.end()) return -1;
    std::int64_t best = -1;
    double square = cell_ * cell_;
    for (const std::uint32_t i : at->second) {
      const double d = squared_distance(planes_[i].origin, p);
      if (d < square || (d == square && i < best)) square = d, best = i;
    }
    return best;
  }

 private:
  using Cell = std::array<std::int64_t, 3>;
  struct Hash {
    std::size_t operator()(const Cell& c) const {
      std::uint64_t h = 0;
      for (const std::int64_t k : c) h = (h ^ static_cast<std::uint64_t>(k)) * 0x9e3779b97f4a7c15u;
      return static_cast<std::size_t>(h ^ h >> 32);
    }
  };
  Cell cell(const Double3& p) const {
    Cell c;
    for (std::size_t k = 0; k < 3; ++k) c[k] = static_cast<std::int64_t>(std::floor(p[k] / cell_));
    return c;
  }
  const RibPlanes& planes_;
  double cell_;
  std::unordered_map<Cell, std::vector<std::uint32_t>, Hash> cells_;
};

/// The nearest rib, downhill along the spine from one that was nearest to it before the spine moved a little.
std::size_t nearest_from(const RibPlanes& planes, const Double3& p, std::size_t rib) {
  const std::size_t n = planes.size();
  double square = squared_distance(planes[rib].origin, p);
  for (const bool up : {true, false})
    for (std::size_t step = 0; step < n; ++step) {
      if (!planes.closed() && (up ? rib + 1 == n : rib == 0)) break;
      const std::size_t next = up ? (rib + 1) % n : (rib + n - 1) % n;
      const double d = squared_distance(planes[next].origin, p);
      if (!(d < square)) break;
      rib = next, square = d;
    }
  return rib;
}

bool in_order(const RibVertex& a, const RibVertex& b) {
  return a.position.rib != b.position.rib ? a.position.rib < b.position.rib : a.vertex < b.vertex;
}

/// Where vertices are beside a fishbone.
class Placing {
 public:
  Placing(const Fishbone& bone, double radius, double off)
      : bone_(bone), radius_(radius), off_(off), limit_(limit(bone, radius, off)) {}
  /// How far from the origin of its rib a vertex may be.
  static double limit(const Fishbone& bone, double radius, double off) {
    return 1.5 * (0.5 * bone.mean_arc() + radius + bone.planes.spacing()) + off;
  }
  /// \param rib  the nearest one
  std::optional<RibVertex> position(std::uint32_t v, const Double3& p, const Double3& normal,
                                    std::size_t rib) const {
    const RibPlane& plane = bone_.planes[rib];
    if (squared_distance(plane.origin, p) >= limit_ * limit_) return std::nullopt;
    const auto at = bone_.planes.locate(p, rib);
    if (!at) return std::nullopt;
    const RibProfile q = bone_.profile_at(at->rib);
    const ProfilePosition across = profile_position(q, {at->x, at->y});
    const double half = 0.5 * q.arc_length();
    if (std::fabs(across.distance) > off_ || std::fabs(across.run) > half + radius_) return std::nullopt;
    const double share = half > 0.0 ? std::clamp(0.5 + 0.5 * across.run / half, 0.0, 1.0) : 0.5;
    const Double2 n = across.zone == RibZone::kLeft    ? q.flank_normal(0)
                      : across.zone == RibZone::kRight ? q.flank_normal(1)
                                                       : q.arc_normal(share);
    if (dot(normal, plane.across * n[0] + plane.up * n[1]) < kProfileFacing) return std::nullopt;
    return RibVertex{v, *at, across};
  }

 private:
  const Fishbone& bone_;
  double radius_, off_, limit_;
};

class Fit {
 public:
  Fit(std::span<const Double3> position, std::span<const Double3> normal, const BlendCurve& curve,
      const FishboneOptions& options, Fishbone& out)
      : all_position_(position), all_normal_(normal), curve_(curve), options_(options), out_(out) {}

  FishboneOutcome run() {
    out_ = {};

    out_.convex = curve_.convex;
    out_.edge = options_.edge;
    out_.flank = std::max({kFlankEdges * options_.edge, kFlankShare * curve_.half_width, options_.min_flank,
                           options_.min_seen});
    std::vector<Double3> up = curve_.normal;
    double length = 0.0;
    const std::size_t n = curve_.centre.size(), pieces = curve_.closed ? n : n - 1;
    for (std::size_t i = 0; i < pieces; ++i) length += norm(curve_.centre[(i + 1) % n] - curve_.centre[i]);
    auto ribs = static_cast<std::size_t>(std::round(length / options_.spacing)) + (curve_.closed ? 0 : 1);
    if (n < 3 || ribs < kMinRibs) return FishboneOutcome::kTooShort;
    out_.planes = planes_across(curve_.centre, std::move(up), curve_.closed, ribs, kSpineSmooths);
    keep_near();
    bool converged = false;
    double moved = std::numeric_limits<double>::infinity(), noise = moved;
    for (int round = 0;; ++round) {
      fit_ribs(round == 0);
      const std::size_t before = this->ribs();
      if (!(round < kPatientRounds ? fill_unfound() : cut_to_sound())) return FishboneOutcome::kNoFlanks;
      smooth_profiles();
      if ((converged && before == this->ribs()) || round + 1 == kMaxRounds) break;
      const double last_noise = noise, last = moved;
      noise = mean_rms();
      moved = follow();
      // Where noise lets vertices come and go at the rim of what ribs see, spines never come to rest.
      const bool stationary =
          moved <= std::max(kConverged * (curve_.half_width + out_.edge), kConvergedNoise * noise);
      const bool wavers =
          moved <= kWaversNoise * noise && moved >= kWaversShare * last && noise >= kSameNoise * last_noise;
      converged = round >= kPatientRounds && (stationary || wavers);
    }
    RibEnds ends = rib_ends();
    const double minimum = kMinApart * out_.planes.spacing();
    if (ribs_cross(out_.planes, ends, minimum)) {
      if (!straighten_ribs(out_.planes, ends, minimum)) return FishboneOutcome::kRibsCross;
      out_.straightened = true;
      fit_ribs(false);
      if (!cut_to_sound()) return FishboneOutcome::kNoFlanks;
      smooth_profiles();
      if (ribs_cross(out_.planes, rib_ends(), 0.0)) return FishboneOutcome::kRibsCross;
    }
    return has_flanks() ? FishboneOutcome::kFound : FishboneOutcome::kNoFlanks;
  }

 private:
  std::size_t ribs() const { return out_.planes.size(); }

  /// What all rounds look at: vertices as near as any rib may see.
  void keep_near() {
    const NearRibs near(out_.planes, kNearCurve * (curve_.half_width + out_.flank) + out_.planes.spacing());
    for (std::size_t v = 0; v < all_position_.size(); ++v) {
      const std::int64_t rib = near.nearest(all_position_[v]);
      if (rib < 0) continue;
      position_.push_back(all_position_[v]);
      normal_.push_back(all_normal_[v]);
      rib_.push_back(static_cast<std::uint32_t>(rib));
    }
  }

  /// Points of the vertices near rib i, in its plane.
  template <class Use>
  void for_near(const std::vector<RibVertex>& all, std::size_t i, const Use& use) const {
    const double n = static_cast<double>(ribs());
    const auto range = [&](double low, double high) {
      RibVertex key;
      key.position.rib = low;
      for (auto at = std::lower_bound(all.begin(), all.end(), key, in_order);
           at != all.end() && at->position.rib <= high; ++at)
        use(*at);
    };
    const double r = static_cast<double>(i);
    range(r - kWindow, r + kWindow);
    if (!out_.planes.closed()) return;
    if (r - kWindow < 0.0) range(r - kWindow + n, n);
    if (r + kWindow > n) range(0.0, r + kWindow - n);
  }

  void fit_ribs(bool first) {
    if (first) {
      RibProfile flat;  // until there is one: everything near counts, by x alone
      flat.angle = {-0.5, 0.5};
      out_.profiles.assign(ribs(), flat);
    }
    const double wide = curve_.half_width + out_.flank;
    std::vector<RibVertex> all;
    if (first) {
      const double radius = 2.0 * wide + out_.planes.spacing();
      for (std::uint32_t v = 0; v < position_.size(); ++v) {
        const RibPlane& plane = out_.planes[rib_[v]];
        if (squared_distance(plane.origin, position_[v]) >= radius * radius) continue;
        const auto at = out_.planes.locate(position_[v], rib_[v]);
        if (!at || std::fabs(at->x) > wide || std::fabs(at->y) > wide) continue;
        if (dot(normal_[v], plane.up) < 0.0) continue;
        all.push_back({v, *at, {}});
      }
    } else {
      const double off = kOffFitEdges * out_.edge + kOffShare * (curve_.half_width + out_.mean_arc());
      const Placing placing(out_, out_.flank, off);
      for (std::uint32_t v = 0; v < position_.size(); ++v) {
        rib_[v] = static_cast<std::uint32_t>(nearest_from(out_.planes, position_[v], rib_[v]));
        if (const auto at = placing.position(v, position_[v], normal_[v], rib_[v])) all.push_back(*at);
      }
    }
    std::sort(all.begin(), all.end(), in_order);
    fits_.assign(ribs(), {});
    std::vector<Double2> points;
    for (std::size_t i = 0; i < ribs(); ++i) {
      points.clear();
      for_near(all, i, [&](const RibVertex& v) { points.push_back({v.position.x, v.position.y}); });
      RibProfile start = out_.profiles[i];
      if (first) {
        const ProfileFit guess = guess_profile(points, curve_.half_width, out_.convex);
        if (!guess.found) continue;
        start = guess.profile;
      }
      fits_[i] = fit_profile(points, start, out_.convex);
      if (fits_[i].count[0] < kMinFlank || fits_[i].count[2] < kMinFlank) fits_[i].found = false;
    }
  }

  /// Ribs that were not found take after the nearest one that was.
  bool fill_unfound() {
    const std::size_t n = ribs();
    bool any = false;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t off = 0; off < n; ++off) {
        const std::size_t a = std::min(i + off, n - 1), b = i >= off ? i - off : 0;
        if (!fits_[a].found && !fits_[b].found) continue;
        out_.profiles[i] = fits_[fits_[b].found ? b : a].profile;
        any = true;
        break;
      }
    }
    return any;
  }

  /// Of ribs that were not found, or fit badly, the longest run between them stays.
  bool cut_to_sound() {
    std::vector<double> rms;
    for (const ProfileFit& f : fits_)
      if (f.found) rms.push_back(f.rms);
    if (rms.size() < kMinRibs) return false;
    std::nth_element(rms.begin(), rms.begin() + static_cast<std::ptrdiff_t>(rms.size() / 2), rms.end());
    const double maximum = std::max(kBadRib * rms[rms.size() / 2], kFine * out_.edge);
    const std::size_t n = ribs();
    std::vector<std::uint8_t> sound(n);
    std::size_t bad = 0;
    for (std::size_t i = 0; i < n; ++i) bad += !(sound[i] = fits_[i].found && fits_[i].rms <= maximum);
    if (bad == 0) {
      for (std::size_t i = 0; i < n; ++i) out_.profiles[i] = fits_[i].profile;
      return true;
    }
    const bool closed = out_.planes.closed();
    const auto [begin, best] = longest_run(sound, closed);
    if (best < kMinRibs) return false;
    std::vector<ProfileFit> fits;
    for (std::size_t i = begin; i < begin + best; ++i) fits.push_back(fits_[i % n]);
    for (std::uint32_t& r : rib_) {
      const std::size_t from = closed ? (r + n - begin % n) % n : r < begin ? 0 : r - begin;
      r = static_cast<std::uint32_t>(from < best ? from : closed && from - best > n - from ? 0 : best - 1);
    }
    fits_ = std::move(fits);
    out_.keep(begin, best);
    for (std::size_t i = 0; i < best; ++i) out_.profiles[i] = fits_[i].profile;
    return true;
  }

  void smooth_profiles() {
    const bool closed = out_.planes.closed();
    std::vector<double> value(ribs());
    const auto smooth = [&](auto&& of) {
      for (std::size_t i = 0; i < ribs(); ++i) value[i] = of(out_.profiles[i]);
      smooth_line(value, closed, kProfileSmooths);
      for (std::size_t i = 0; i < ribs(); ++i) of(out_.profiles[i]) = value[i];
    };
    for (std::size_t k = 0; k < 2; ++k) {
      smooth([k](RibProfile& p) -> double& { return p.angle[k]; });
      smooth([k](RibProfile& p) -> double& { return p.offset[k]; });
    }
    smooth([](RibProfile& p) -> double& { return p.radius; });
  }

  /// Planes across the middle of what was found. \returns how far they moved
  double follow() {
    std::vector<Double3> spine(ribs()), up(ribs());
    const RibPlanes before = out_.planes;
    for (std::size_t i = 0; i < ribs(); ++i) {
      const Double2 m = out_.profiles[i].middle(), n = out_.profiles[i].arc_normal(0.5);
      spine[i] = out_.planes.at(i, m[0], m[1]);
      up[i] = out_.planes[i].across * n[0] + out_.planes[i].up * n[1];
    }
    out_.planes = planes_across(std::move(spine), std::move(up), out_.planes.closed(), ribs(), kSpineSmooths);
    // The same profiles seen from the new origins: the middle of the arc is (0, 0), its normal is up.
    for (RibProfile& p : out_.profiles) {
      const double middle = p.middle_angle();
      const Double2 m = p.middle();
      for (std::size_t k = 0; k < 2; ++k) {
        const Double2 n = p.flank_normal(k);
        p.offset[k] -= n[0] * m[0] + n[1] * m[1];
      }
      p.angle[0] -= middle, p.angle[1] -= middle;
    }
    double maximum = 0.0;
    for (std::size_t i = 0; i < ribs(); ++i) {
      const Double3 off = out_.planes[i].origin - before[i].origin;
      maximum = std::max({maximum, std::fabs(dot(off, before[i].across)), std::fabs(dot(off, before[i].up))});
    }
    return maximum;
  }

  RibEnds rib_ends() const {
    RibEnds ends;
    for (std::size_t i = 0; i < ribs(); ++i) {
      const RibProfile& p = out_.profiles[i];
      const double far = p.tangent_length() + std::max(out_.edge, options_.min_flank);
      const Double2 l = p.on_flank(0, far), r = p.on_flank(1, far);
      ends.left.push_back(out_.planes.at(i, l[0], l[1]));
      ends.right.push_back(out_.planes.at(i, r[0], r[1]));
    }
    return ends;
  }

  double mean_rms() const {
    double sum = 0.0, n = 0.0;
    for (const ProfileFit& f : fits_) sum += f.rms * f.rms, n += 1.0;
    return std::sqrt(sum / n);
  }

  bool has_flanks() {
    out_.rms = mean_rms();
    return out_.rms < kRough * std::min(out_.flank, curve_.half_width + out_.edge);
  }

  std::span<const Double3> all_position_, all_normal_;
  std::vector<Double3> position_, normal_;  ///< of those near the track
  std::vector<std::uint32_t> rib_;          ///< that was nearest to each
  const BlendCurve& curve_;
  FishboneOptions options_;
  Fishbone& out_;
  std::vector<ProfileFit> fits_;
};

}  // namespace

RibProfile Fishbone::profile_at(double rib) const {
  const std::size_t n = profiles.size();
  if (!planes.closed()) rib = std::clamp(rib, 0.0, static_cast<double>(n - 1));
  const double whole = std::floor(rib), t = rib - whole;
  const RibProfile& a = profiles[static_cast<std::size_t>(whole) % n];
  if (t == 0.0) return a;
  const RibProfile& b = profiles[(static_cast<std::size_t>(whole) + 1) % n];
  RibProfile out;
  for (std::size_t k = 0; k < 2; ++k) {
    out.angle[k] = a.angle[k] * (1.0 - t) + b.angle[k] * t;
    out.offset[k] = a.offset[k] * (1.0 - t) + b.offset[k] * t;
  }
  out.radius = a.radius * (1.0 - t) + b.radius * t;
  return out;
}

void Fishbone::keep(std::size_t first, std::size_t count) {
  std::vector<RibPlane> kept;
  std::vector<RibProfile> as_kept;
  for (std::size_t i = first; i < first + count; ++i) {
    kept.push_back(planes[i % planes.size()]);
    as_kept.push_back(profiles[i % planes.size()]);
  }
  planes = RibPlanes(std::move(kept), false);
  profiles = std::move(as_kept);
}

double Fishbone::mean_radius() const {
  double sum = 0.0;
  for (const RibProfile& p : profiles) sum += std::fabs(p.radius);
  return sum / static_cast<double>(profiles.size());
}
double Fishbone::mean_arc_angle() const {
  double sum = 0.0;
  for (const RibProfile& p : profiles) sum += p.arc_angle();
  return sum / static_cast<double>(profiles.size());
}
double Fishbone::mean_arc() const {
  double sum = 0.0;
  for (const RibProfile& p : profiles) sum += p.arc_length();
  return sum / static_cast<double>(profiles.size());
}

std::vector<RibVertex> locate_vertices(const Fishbone& bone, std::span<const Double3> position,
                                       std::span<const Double3> normal, double radius, double off) {
  const NearRibs near(bone.planes, Placing::limit(bone, radius, off));
  const Placing placing(bone, radius, off);
  std::vector<RibVertex> out;
  for (std::uint32_t v = 0; v < position.size(); ++v) {
    const std::int64_t i = near.nearest(position[v]);
    if (i < 0) continue;
    if (const auto at = placing.position(v, position[v], normal[v], static_cast<std::size_t>(i)))
      out.push_back(*at);
  }
  std::sort(out.begin(), out.end(), in_order);
  return out;
}

FishboneOutcome fit_fishbone(std::span<const Double3> position, std::span<const Double3> normal,
                             const BlendCurve& curve, const FishboneOptions& options, Fishbone& out) {
  return Fit(position, normal, curve, options, out).run();
}

}  // namespace tessera
