// The passes that even lengths of edges where they adapt, behind all others: until no edge joins two vertices whose mean
// edges differ by more than is asked for (edge_ratios.h). The most uneven edges come first; each gets moves of the vertices
// around, the best flip or collapse, and where none helps the best split at its coarse end. A step is done if it makes what
// is uneven around less so, keeps to the tolerance and to what faces must be anywhere, and leaves no sharper angle than there
// was and no more faces below the angle that is kept.
#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "kernels/remesh/edge_ratios.h"
#include "kernels/remesh/place_search.h"
#include "kernels/remesh/remesher.h"
#include "kernels/remesh/triangle_quality.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr double kEvenRoom = 1e-3;    ///< below the ratio asked for: rounding of positions takes less
constexpr double kAimedBelow = 0.04;  ///< below it: steps go on to there
constexpr int kEvenRounds = 10, kRoundsWithSplits = 7;  ///< behind the last splits what these left is evened
constexpr std::array<double, 3> kSoundAngles = {30.0, 25.0, 0.0};  ///< degrees: kept one after the other
constexpr double kKeptRoom = 0.05;    ///< degrees: rounding of positions takes less
constexpr double kEvenGain = 1e-5;    ///< of the cost: less is not worth a step
constexpr double kLongestEven = 2.0;  ///< mean edges: no edge gets longer by a collapse
// Places are looked for in steps of shares of the mean length of the spokes.
constexpr double kFirstEvenStep = 0.2, kLastEvenStep = 0.02;
constexpr int kEvenSteps = 24;

}  // namespace

/// Of some faces: how many have too small an angle, and the squared cosine of the smallest.
struct Remesher::Sharpest {
  std::size_t faces = 0,
              least = 0;  ///< below the angle that steps keep now, and below the one that all of them keep
  double sharpest = 0.0;
  void add(double sharpness, double kept, double always) {
    faces += sharpness > kept;
    least += sharpness > always;
    sharpest = std::max(sharpest, sharpness);
  }
  /// Of what a step leaves in the place of `before`.
  [[nodiscard]] bool is_sound_after(const Sharpest& before, double kept) const {
    return faces <= before.faces && least <= before.least &&
           (sharpest <= kept || sharpest <= before.sharpest);
  }
};

/// A step that has not been done: a flip or a split of the edge across from a corner, or the collapse of a vertex into another
/// one.
struct Remesher::EvenStep {
  double adds;
  std::uint32_t corner, from, to;  ///< kNoCorner, or no vertices
};

void Remesher::even_lengths(RemeshReport& report) {
  // Steps lose nothing of the reference that is near enough: no split has to bring it back in the end.
  std::optional<CoveredPoints> covered;
  if (options_.refine_beyond)
    covered_ = &covered.emplace(mesh_, surface_.vertices(), surface_.faces(), options_.tolerance);
  std::vector<std::uint8_t> whole(info_.size());
  for (std::uint32_t v = 0; v < whole.size(); ++v) whole[v] = info_[v].whole;
  EdgeRatios ratios(mesh_, std::move(whole), options_.max_length_ratio - kAimedBelow);
  ratios_ = &ratios;
  // Edges are as long as they are wanted: nothing is asked of the field of lengths any more.
  for (std::uint32_t v = 0; v < info_.size(); ++v) info_[v].target = static_cast<float>(ratios.mean(v));
  report.uneven_in = uneven_edges().size();
  even_rounds(report);
  tell_uneven(report);
  ratios_ = nullptr;
  covered_ = nullptr;
}

/// The most uneven first, then in the order of faces. The first end is the one with the shorter edges.
std::vector<std::array<std::uint32_t, 2>> Remesher::uneven_edges() const {
  std::vector<std::pair<double, std::uint32_t>> found;
  const double most = options_.max_length_ratio - kEvenRoom;
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
    step();
    if (mesh_.face(f).state & kStateDead) continue;
    for (std::uint32_t c = 4 * f; c < 4 * f + 3; ++c) {
      const std::uint32_t o = mesh_.opposite(c);
      if (o != kNoCorner && o < c) continue;
      const double ratio = ratios_->ratio(mesh_.vertex(next_corner(c)), mesh_.vertex(prev_corner(c)));
      if (ratio > most) found.emplace_back(-ratio, c);
    }
  }
  std::sort(found.begin(), found.end());
  std::vector<std::array<std::uint32_t, 2>> edges;
  edges.reserve(found.size());
  for (const auto& [ratio, c] : found) {
    const std::uint32_t a = mesh_.vertex(next_corner(c)), b = mesh_.vertex(prev_corner(c));
    edges.push_back(ratios_->mean(a) <= ratios_->mean(b) ? std::array{a, b} : std::array{b, a});
  }
  return edges;
}

/// Whether there still is an edge between them, and it is uneven.
bool Remesher::is_uneven(std::uint32_t a, std::uint32_t b) const {
  if ((mesh_.state(a) | mesh_.state(b)) & kVertexDead) return false;
  if (!(ratios_->ratio(a, b) > options_.max_length_ratio - kEvenRoom)) return false;
  bool joined = false;
  mesh_.for_each_neighbour(a, [&](std::uint32_t w) { joined |= w == b; });
  return joined;
}

void Remesher::renew_mean(std::uint32_t v) {
  ratios_->renew(v);
  if (!(mesh_.state(v) & kVertexDead)) info_[v].target = static_cast<float>(ratios_->mean(v));
}

void Remesher::renew_around(std::uint32_t v) {
  renew_mean(v);
  mesh_.for_each_neighbour(v, [&](std::uint32_t w) { renew_mean(w); });
}

void Remesher::even_rounds(RemeshReport& report) {
  changed_.assign(info_.size(), 0);
  round_ = 0;
  const auto sharpness_below = [](double degrees) {
    const double cosine = cosine_of_degrees(degrees + kKeptRoom);
    return cosine * cosine;
  };
  always_sharpness_ = sharpness_below(options_.kept_angle_deg);
  // Angles that are better than they have to be are given up where nothing else helps.
  for (const double sound : kSoundAngles) {
    kept_sharpness_ = sharpness_below(std::max(sound, options_.kept_angle_deg));
    const bool last = sound == kSoundAngles.back();
    for (int round = 0; round < kEvenRounds && even_round(round < kRoundsWithSplits, last, report); ++round) {
    }
  }
}

/// \param last  beside faces that stay no angle is given up for what they do not let be even
/// \returns whether there was something to do, and a step did some of it
bool Remesher::even_round(bool splits, bool last, RemeshReport& report) {
  const std::vector<std::array<std::uint32_t, 2>> uneven = uneven_edges();
  if (uneven.empty()) return false;
  count_valences();
  begin_guarding();
  locked_.resize(info_.size(), 0);
  std::size_t done = 0;
  for (const auto& [a, b] : uneven) {
    step();
    if (!is_uneven(a, b) || (last && is_held_uneven(a, b))) continue;
    const std::size_t refused = report.by_tolerance;
    done += even_edge(a, b, report);
    locked_[a] = locked_[b] = report.by_tolerance > refused;
  }
  if (splits) done += split_uneven(last, report);
  return done > 0;
}

/// \returns the number of steps
std::size_t Remesher::even_edge(std::uint32_t a, std::uint32_t b, RemeshReport& report) {
  std::size_t done = 0;
  const auto place_all = [&](std::span<const std::uint32_t> vertices) {
    for (const std::uint32_t v : vertices)
      if (is_uneven(a, b)) done += place_even(v, report);
  };
  const std::array<std::uint32_t, 2> ends = {a, b};
  const auto around = [&] {
    std::vector<std::uint32_t> found = {a, b};
    for (const std::uint32_t v : ends)
      mesh_.for_each_neighbour(v, [&](std::uint32_t w) { found.push_back(w); });
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  };
  place_all(ends);
  if (is_uneven(a, b)) done += flip_or_collapse(ends, report);
  if (!is_uneven(a, b)) return done;
  place_all(around());
  if (is_uneven(a, b)) done += flip_or_collapse(around(), report);
  place_all(ends);
  return done;
}

/// Of the faces around the gathered star, were its centre at p.
Remesher::Sharpest Remesher::sharpest_around(const Double3& p) const {
  Sharpest sharp;
  for (std::size_t i = 0; i < star_.faces; ++i)
    sharp.add(sharpness(p, mesh_.at(star_.ring[i]), mesh_.at(star_.ring[star_.following(i)])),
              kept_sharpness_, always_sharpness_);
  return sharp;
}

/// The vertex, to where its edges and those of its neighbours are least uneven.
bool Remesher::place_even(std::uint32_t v, RemeshReport& report) {
  if ((mesh_.state(v) & kVertexKept) || !mesh_.gather(v, star_)) return false;
  if (info_[v].foot == ReferenceSurface::kNone) return false;
  const double before = ratios_->open_star(v, star_);
  if (before == EdgeRatios::kNoRatio || !(before > kEvenGain)) return false;
  const Double3 old = mesh_.at(v);
  const Sharpest sharp = sharpest_around(old);
  const auto is_sound = [&](const Double3& p) {
    return sharpest_around(p).is_sound_after(sharp, kept_sharpness_);
  };
  const double length = ratios_->mean(v);
  const Double3 best = search_place(old, directions_at(v),
                                    {kFirstEvenStep * length, kLastEvenStep * length, kEvenSteps, kEvenGain},
                                    before, [&](const Double3& p) {
                                      const double costs = ratios_->move_costs(p);
                                      return costs < before && is_sound(p) ? costs : EdgeRatios::kNoRatio;
                                    });
  if (best == old) return false;
  const std::vector<std::uint32_t> faces = faces_of_star();
  for (const double share : {1.0, 0.5, 0.25})
    if (move_if(v, old + (best - old) * share, report, [&] {
          return ratios_->move_costs(mesh_.at(v)) < before - kEvenGain && is_sound(mesh_.at(v)) &&
                 keeps_near(faces, faces_at(faces), report);
        })) {
      hand_points_on(faces, faces);
      renew_around(v);
      return true;
    }
  return false;
}

/// Of all flips and collapses at vertices the one that makes lengths most even.
bool Remesher::flip_or_collapse(std::span<const std::uint32_t> vertices, RemeshReport& report) {
  std::vector<EvenStep> steps;
  std::vector<std::uint32_t> corners;  // across from edges
  std::vector<std::array<std::uint32_t, 2>> pairs;
  for (const std::uint32_t v : vertices) {
    mesh_.for_each_neighbour(v, [&](std::uint32_t w) {
      pairs.push_back({v, w});
      pairs.push_back({w, v});
    });
    if (!mesh_.gather(v, star_)) continue;
    for (std::size_t i = 0; i < star_.faces; ++i)
      for (const std::uint32_t c : {star_.corner[i], prev_corner(star_.corner[i])})
        if (const std::uint32_t d = mesh_.opposite(c); d != kNoCorner && !is_line(c))
          corners.push_back(std::min(c, d));
  }
  const auto make_unique = [](auto& list) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  };
  make_unique(corners);
  make_unique(pairs);
  for (const std::uint32_t c : corners)
    if (const double adds = ratios_->flip_adds(c); adds < -kEvenGain)
      steps.push_back({adds, c, kNoCorner, kNoCorner});
  for (const auto& [u, v] : pairs) {
    if ((mesh_.state(u) & kVertexKept) || !mesh_.gather(u, star_)) continue;
    std::size_t at = 0;
    while (at < star_.ring_size() && star_.ring[at] != v) ++at;
    if (at == star_.ring_size()) continue;
    if (const double adds = ratios_->collapse_adds(star_, at); adds < -kEvenGain)
      steps.push_back({adds, kNoCorner, u, v});
  }
  std::stable_sort(steps.begin(), steps.end(),
                   [](const EvenStep& l, const EvenStep& r) { return l.adds < r.adds; });
  return std::any_of(steps.begin(), steps.end(), [&](const EvenStep& s) {
    return s.corner != kNoCorner ? flip_even(s.corner, report) : collapse_even(s.from, s.to, report);
  });
}

bool Remesher::flip_even(std::uint32_t c, RemeshReport& report) {
  const std::uint32_t d = mesh_.opposite(c), u = mesh_.vertex(c), w = mesh_.vertex(d),
                      a = mesh_.vertex(next_corner(c)), b = mesh_.vertex(prev_corner(c));
  const Double3 &pu = mesh_.at(u), &pw = mesh_.at(w), &pa = mesh_.at(a), &pb = mesh_.at(b);
  const std::array<std::uint32_t, 2> faces = {c >> 2, d >> 2};
  const std::array<NewFace, 2> made = {NewFace{{u, a, w}, {pu, pa, pw}}, NewFace{{w, b, u}, {pw, pb, pu}}};
  if (!keeps_angles(faces, made) || !keeps_near(faces, made, report)) return false;
  const Refusal refusal = flip_if_sound(c);
  count(refusal, report);
  if (refusal != Refusal::kNone) return false;
  hand_points_on(faces, faces);
  for (const std::uint32_t v : {u, w, a, b}) renew_mean(v);
  ++report.flips;
  return true;
}

bool Remesher::collapse_even(std::uint32_t u, std::uint32_t v, RemeshReport& report) {
  if (!mesh_.gather(u, star_)) return false;
  const std::vector<std::uint32_t> faces = faces_of_star();
  std::vector<std::uint32_t> left;
  std::vector<NewFace> made;
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const std::uint32_t x = star_.ring[i], y = star_.ring[star_.following(i)];
    if (x == v || y == v) continue;
    left.push_back(faces[i]);
    made.push_back({{v, x, y}, {mesh_.at(v), mesh_.at(x), mesh_.at(y)}});
  }
  if (made.empty() || !keeps_angles(faces, made)) return false;
  std::size_t at = 0;
  const Refusal refusal = check_collapse(u, v, kLongestEven, at);
  count(refusal, report);
  if (refusal != Refusal::kNone || !keeps_near(faces, made, report)) return false;
  const std::vector<std::uint32_t> ring(star_.ring.begin(),
                                        star_.ring.begin() + static_cast<std::ptrdiff_t>(star_.ring_size()));
  collapse(at);
  hand_points_on(faces, left);
  recount_lines(v);
  for (const std::uint32_t w : ring) renew_mean(w);
  renew_mean(u);
  ++report.collapses;
  return true;
}

/// Of the edges at the coarse end, and then of those around it, the split that makes lengths most even.
std::size_t Remesher::split_uneven(bool last, RemeshReport& report) {
  std::size_t done = 0;
  for (const auto& [a, b] : uneven_edges()) {
    step();
    if (!is_uneven(a, b) || (last && is_held_uneven(a, b)) || !mesh_.gather(b, star_)) continue;
    std::vector<EvenStep> steps;
    const auto ask = [&](std::uint32_t c) {
      if (mesh_.opposite(c) == kNoCorner && !mesh_.border_edge(c)) return;
      const Double3 middle =
          (mesh_.at(mesh_.vertex(next_corner(c))) + mesh_.at(mesh_.vertex(prev_corner(c)))) * 0.5;
      if (const double adds = ratios_->split_adds(c, middle); adds < -kEvenGain)
        steps.push_back({adds, c, kNoCorner, kNoCorner});
    };
    for (std::size_t i = 0; i < star_.faces; ++i) {
      ask(star_.corner[i]);
      ask(prev_corner(star_.corner[i]));
      if (!star_.closed && i == 0) ask(next_corner(star_.corner[i]));
    }
    std::stable_sort(steps.begin(), steps.end(),
                     [](const EvenStep& l, const EvenStep& r) { return l.adds < r.adds; });
    done += std::any_of(steps.begin(), steps.end(),
                        [&](const EvenStep& s) { return split_even(s.corner, report); });
  }
  return done;
}

bool Remesher::split_even(std::uint32_t c, RemeshReport& report) {
  const Edge e = edge_at(c);
  Info info;
  const Double3 at = split_place(e, info);
  if (!is_split_sound(c, at) || !(ratios_->split_adds(c, at) < -kEvenGain)) return false;
  const auto first = static_cast<std::uint32_t>(mesh_.faces().size()),
             middle = static_cast<std::uint32_t>(info_.size());
  std::vector<std::uint32_t> faces;
  std::vector<NewFace> made;
  for (const std::uint32_t d : {c, mesh_.opposite(c)}) {
    if (d == kNoCorner) continue;
    faces.push_back(d >> 2);
    const std::uint32_t p = mesh_.vertex(d), q = mesh_.vertex(next_corner(d)),
                        r = mesh_.vertex(prev_corner(d));
    made.push_back({{p, q, middle}, {mesh_.at(p), mesh_.at(q), at}});
    made.push_back({{p, middle, r}, {mesh_.at(p), at, mesh_.at(r)}});
  }
  info_.push_back(info);
  const bool is_sound = keeps_angles(faces, made) && keeps_near(faces, made, report);
  info_.pop_back();
  if (!is_sound || !split_if_free(e, report)) return false;
  std::vector<std::uint32_t> halves = faces;
  for (std::uint32_t f = first; f < mesh_.faces().size(); ++f) halves.push_back(f);
  hand_points_on(faces, halves);
  renew_around(middle);
  ++report.splits;
  return true;
}

/// Whether what takes the place of faces has no more of them below the angle that is kept, and none that is sharper.
bool Remesher::keeps_angles(std::span<const std::uint32_t> faces, std::span<const NewFace> made) const {
  Sharpest before, after;
  for (const std::uint32_t f : faces) before.add(sharpness_of(f), kept_sharpness_, always_sharpness_);
  for (const NewFace& f : made)
    after.add(sharpness(f.at[0], f.at[1], f.at[2]), kept_sharpness_, always_sharpness_);
  return after.is_sound_after(before, kept_sharpness_);
}

/// Whether it lies within the tolerance that is to be proven, as far as points tell, and what of the reference belonged to the
/// faces near it.
bool Remesher::keeps_near(std::span<const std::uint32_t> faces, std::span<const NewFace> made,
                          RemeshReport& report) const {
  if (!covered_) return true;
  std::vector<std::array<Double3, 3>> corners;
  for (const NewFace& f : made) corners.push_back({f.at[0], f.at[1], f.at[2]});
  const bool near = covered_->stay_near(faces, corners) &&
                    std::none_of(made.begin(), made.end(), [&](const NewFace& f) { return beyond(f); });
  report.by_tolerance += !near;
  return near;
}

void Remesher::hand_points_on(std::span<const std::uint32_t> faces, std::span<const std::uint32_t> made) {
  if (covered_) covered_->hand_on(faces, made);
}

std::vector<std::uint32_t> Remesher::faces_of_star() const {
  std::vector<std::uint32_t> faces;
  for (std::size_t i = 0; i < star_.faces; ++i) faces.push_back(star_.corner[i] >> 2);
  return faces;
}

std::vector<Remesher::NewFace> Remesher::faces_at(std::span<const std::uint32_t> faces) const {
  std::vector<NewFace> made;
  for (const std::uint32_t f : faces) {
    const std::uint32_t* v = mesh_.face(f).vertex;
    made.push_back({{v[0], v[1], v[2]}, {mesh_.at(v[0]), mesh_.at(v[1]), mesh_.at(v[2])}});
  }
  return made;
}

/// Whether a face that stays is at one of their edges.
bool Remesher::is_held_uneven(std::uint32_t a, std::uint32_t b) const {
  bool found = false;
  for (const std::uint32_t v : {a, b}) {
    found |= info_[v].pinned;
    mesh_.for_each_neighbour(v, [&](std::uint32_t w) { found |= info_[w].pinned; });
  }
  return found;
}

/// What is left, by what keeps it.
void Remesher::tell_uneven(RemeshReport& report) const {
  const auto on_line = [&](std::uint32_t v) { return info_[v].line || (mesh_.state(v) & kVertexFixed) != 0; };
  for (const auto& [a, b] : uneven_edges()) {
    if (is_held_uneven(a, b))
      ++report.uneven_held;
    else if (on_line(a) && on_line(b))
      ++report.uneven_at_lines;
    else
      report.uneven_by_tolerance += locked_[a] || locked_[b];
  }
}

}  // namespace tessera
