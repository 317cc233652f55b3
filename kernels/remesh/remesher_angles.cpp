// The passes that raise the smallest angles, behind all others: Hu, Yan, Bommes, Alliez, Benes, "Error-Bounded and Feature
// Preserving Surface Remeshing with Minimal Angle Improvement", 2017. The sharpest faces come first; each gets the flip,
// move or collapse that makes the sharpest angle around less sharp, and where none does the longest edge nearby is split
// (Rivara 1984), so that the next round has another vertex to move. All of them keep to the tolerance and to what faces must
// be anywhere.
#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "kernels/remesh/place_search.h"
#include "kernels/remesh/remesher.h"
#include "kernels/remesh/triangle_quality.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr double kRoom = 0.1;  ///< degrees above what is asked for: rounding of positions takes less
constexpr int kCycles = 3;     ///< of raising and of the splits that the tolerance asks for
constexpr int kRaiseRounds = 16;
constexpr int kWithoutSplits = 4;  ///< of them, the last: what splits left is made round
constexpr int kBeforeRelease = 3;  ///< rounds that leave weak creases alone
constexpr double kGain = 1e-4;     ///< of the squared cosine: less is not worth a step
// Places are looked for in steps of shares of the mean length of the spokes.
constexpr double kFirstStep = 0.3, kLastStep = 0.01;
constexpr int kSteps = 40;
constexpr double kLongestRaised = 2.0;  ///< targets: no edge gets longer by a collapse
constexpr double kShortestSplit = 0.1;  ///< targets: of what is split
constexpr int kPath = 8;                ///< faces from a sharp one to the edge that is longest on both sides

}  // namespace

void Remesher::raise_angles(RemeshReport& report) {
  const auto above = [](double degrees) {
    const double cosine = cosine_of_degrees(degrees);
    return cosine * cosine;
  };
  const double asked = above(options_.min_angle_deg);
  sharp_above_ = asked;
  report.sharp_in = sharp_faces().size();
  sharp_above_ = above(options_.min_angle_deg + kRoom);
  // Steps keep faces near the reference, but do not ask what of the reference they leave: splits bring that back.
  const int cycles = options_.refine_beyond ? kCycles : 1;
  for (int cycle = 0; cycle < cycles; ++cycle) {
    raise_rounds(report);
    if (!options_.refine_beyond) break;
    const std::size_t splits = report.splits;
    refine(report);
    refining_ = false;
    if (report.splits == splits) break;
  }
  sharp_above_ = asked;
  count_valences();
  begin_guarding();
  mending_ = true;
  for (const std::uint32_t f : sharp_faces()) {
    RemeshReport tried = report;
    // With a tolerance to prove the last word was that of the splits.
    if (!options_.refine_beyond) raise(f, false, tried);
    const bool by_tolerance = options_.refine_beyond || tried.by_tolerance > report.by_tolerance;
    report = tried;
    if (sharpness_of(f) <= asked || is_between_lines(f)) continue;
    if (is_held(f))
      ++report.sharp_held;
    else
      report.sharp_by_tolerance += by_tolerance;
  }
  mending_ = false;
}

void Remesher::raise_rounds(RemeshReport& report) {
  changed_.assign(info_.size(), 0);
  round_ = 0;
  for (int round = 0; round < kRaiseRounds; ++round) {
    const std::vector<std::uint32_t> sharp = sharp_faces();
    if (sharp.empty()) return;
    count_valences();
    begin_guarding();
    mending_ = true;
    for (const std::uint32_t f : sharp) {
      step();
      raise(f, round >= kBeforeRelease, report);
    }
    mending_ = false;
    if (round + kWithoutSplits < kRaiseRounds) report.splits += split_sharp(report);
  }
}

/// The sharpest first, then in the order of faces.
std::vector<std::uint32_t> Remesher::sharp_faces() const {
  std::vector<std::pair<double, std::uint32_t>> found;
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
    step();
    if (const double s = sharpness_of(f); s > sharp_above_) found.emplace_back(-s, f);
  }
  std::sort(found.begin(), found.end());
  std::vector<std::uint32_t> faces;
  faces.reserve(found.size());
  for (const auto& [s, f] : found) faces.push_back(f);
  return faces;
}

/// Whether the smallest angle is one of the input: between two lines that meet at a vertex that stays.
bool Remesher::is_between_lines(std::uint32_t f) const {
  const std::uint32_t* v = mesh_.face(f).vertex;
  std::uint32_t smallest = 0;
  double minimum = std::numeric_limits<double>::max();
  for (std::uint32_t i = 0; i < 3; ++i)
    if (const double square = square_of(v[(i + 1) % 3], v[(i + 2) % 3]); square < minimum)
      minimum = square, smallest = i;
  const std::uint32_t c = 4 * f + smallest;
  return (mesh_.state(v[smallest]) & (kVertexFixed | kVertexLocked)) && is_line(next_corner(c)) &&
         is_line(prev_corner(c));
}

/// Whether no corner may move.
bool Remesher::is_held(std::uint32_t f) const {
  const std::uint32_t* v = mesh_.face(f).vertex;
  return std::any_of(v, v + 3, [&](std::uint32_t w) { return info_[w].pinned; }) ||
         std::all_of(v, v + 3, [&](std::uint32_t w) { return (mesh_.state(w) & kVertexLocked) != 0; });
}

void Remesher::raise(std::uint32_t f, bool last_resort, RemeshReport& report) {
  const auto is_sharp = [&] { return sharpness_of(f) > sharp_above_; };
  if (!is_sharp() || is_held(f)) return;
  const auto corners = [&] {
    const std::uint32_t* v = mesh_.face(f).vertex;
    return std::array<std::uint32_t, 3>{v[0], v[1], v[2]};
  };
  const auto place_corners = [&] {
    for (const std::uint32_t v : corners())
      if (is_sharp()) place_best(v, report);
  };
  const auto try_all = [&] {
    flip_sharp(f, report);
    place_corners();
    if (is_sharp()) collapse_best(f, report);
    if (!is_sharp()) return;
    // The neighbours make room.
    std::vector<std::uint32_t> around;
    for (const std::uint32_t v : corners())
      mesh_.for_each_neighbour(v, [&](std::uint32_t w) { around.push_back(w); });
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    for (const std::uint32_t w : around) place_best(w, report);
    place_corners();
  };
  if (!is_between_lines(f)) try_all();
  if (!last_resort || !is_sharp()) return;
  bool released = false;
  for (const std::uint32_t v : corners()) released |= release_weak_creases(v);
  if (released && !is_between_lines(f)) try_all();
}

/// Where the centre of the gathered star may go: in the plane across its normal, or along its line.
std::pair<Double3, Double3> Remesher::directions_at(std::uint32_t v) const {
  const Double3 old = mesh_.at(v);
  Double3 normal{}, ends[2] = {old, old};
  std::size_t line_ends = 0;
  for (std::size_t i = 0; i < star_.ring_size(); ++i) {
    const Double3 spoke = mesh_.at(star_.ring[i]) - old;
    if (i < star_.faces) normal = normal + cross(spoke, mesh_.at(star_.ring[star_.following(i)]) - old);
    const bool line = star_.closed ? is_crease_spoke(mesh_, star_, i) : is_border_spoke(star_, i);
    if (info_[v].line && line && line_ends < 2) ends[line_ends++] = mesh_.at(star_.ring[i]);
  }
  Double3 x = unit_or_zero(ends[1] - ends[0]);
  Double3 y{};
  if (!info_[v].line) {
    normal = unit_or_zero(normal);
    x = mesh_.at(star_.ring[0]) - old;
    x = unit_or_zero(x - normal * dot(x, normal));
    y = cross(normal, x);
  }
  return {x, y};
}

/// Where the sharpest angle around the gathered star is least sharp.
Double3 Remesher::best_place(std::uint32_t v) const {
  const Double3 old = mesh_.at(v);
  const std::size_t size = star_.ring_size();
  double length = 0.0;
  for (std::size_t i = 0; i < size; ++i)
    length += norm(mesh_.at(star_.ring[i]) - old) / static_cast<double>(size);
  return search_place(old, directions_at(v), {kFirstStep * length, kLastStep * length, kSteps, kGain},
                      star_sharpness(old), [&](const Double3& p) { return star_sharpness(p); });
}

bool Remesher::place_best(std::uint32_t v, RemeshReport& report) {
  if ((mesh_.state(v) & kVertexKept) || !mesh_.gather(v, star_)) return false;
  if (info_[v].foot == ReferenceSurface::kNone) return false;
  const Double3 old = mesh_.at(v), best = best_place(v);
  if (best == old) return false;
  const double before = star_sharpness(old);
  for (const double share : {1.0, 0.5, 0.25})
    if (move_if_rounder(v, old + (best - old) * share, before, report)) return true;
  return false;
}

/// Of both directions of the three edges the one that leaves the least sharp faces.
bool Remesher::collapse_best(std::uint32_t f, RemeshReport& report) {
  struct Candidate {
    double after;
    std::uint32_t u, v;
  };
  std::vector<Candidate> candidates;
  const std::uint32_t* t = mesh_.face(f).vertex;
  for (std::uint32_t i = 0; i < 3; ++i)
    for (std::uint32_t k = 1; k < 3; ++k) {
      const std::uint32_t u = t[i], v = t[(i + k) % 3];
      if (!mesh_.gather(u, star_)) continue;
      const double before = star_sharpness(mesh_.at(u));
      const double after = sharpness_without(v);
      if (after < before - kGain) candidates.push_back({after, u, v});
    }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.after < b.after; });
  for (const Candidate& c : candidates) {
    std::size_t at = 0;
    const Refusal refusal = check_collapse(c.u, c.v, kLongestRaised, at);
    count(refusal, report);
    if (refusal != Refusal::kNone) continue;
    collapse(at);
    recount_lines(c.v);
    ++report.collapses;
    return true;
  }
  return false;
}

/// Across from the edge at the end of the path of ever longer ones; kNoCorner where that stays.
std::uint32_t Remesher::corner_to_split(std::uint32_t f) const {
  std::uint32_t c = 4 * f + longest_corner(f);
  for (int i = 0; i < kPath; ++i) {
    const std::uint32_t o = mesh_.opposite(c);
    if (o == kNoCorner) break;
    const std::uint32_t next = 4 * (o >> 2) + longest_corner(o >> 2);
    if (next == o) break;
    c = next;
  }
  const std::uint32_t a = mesh_.vertex(next_corner(c)), b = mesh_.vertex(prev_corner(c));
  if (mesh_.opposite(c) == kNoCorner && !mesh_.border_edge(c)) return kNoCorner;
  const double minimum = kShortestSplit * target(a, b);
  return square_of(a, b) > minimum * minimum ? c : kNoCorner;
}

std::size_t Remesher::split_sharp(RemeshReport& report) {
  std::size_t done = 0;
  for (const std::uint32_t f : sharp_faces()) {
    step();
    if (sharpness_of(f) <= sharp_above_ || is_between_lines(f) || is_held(f)) continue;
    const std::uint32_t c = corner_to_split(f);
    if (c != kNoCorner) done += split_if_free(edge_at(c), report);
  }
  return done;
}

}  // namespace tessera
