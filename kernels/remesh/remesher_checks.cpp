// What an operation must leave: faces that face with the reference, near it.
#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/mesh/flat_faces.h"
#include "kernels/mesh/mean_ratio.h"
#include "kernels/mesh/triangle_foot.h"
#include "kernels/remesh/remesher.h"

namespace tessera {
namespace {

constexpr double kAlongFoot = 0.4;    ///< least cosine of a face to the reference at a smooth corner
constexpr double kAlongBefore = 0.5;  ///< of a face without such a corner, to what it was
constexpr double kMinMeanRatio = 0.1;
/// Of the length: shorter edges go even where that leaves others longer than would be split.
constexpr double kSliver = 0.45;  ///< roundness below which shape counts more than valences
constexpr double kBetter = 1.1,
                 kBetterBy = 0.02;  ///< by how much roundness must grow for a flip that leaves valences
constexpr double kRoundEnough = (1.0 - kBetterBy) / kBetter;  ///< from here on it cannot
constexpr double kLinesMeet = 0.25;                           ///< targets
constexpr double kNeedle = 0.4, kLongNearNeedle = 1.8;
constexpr std::size_t kMaxNewValence = 14, kMaxBluntValence = 40;  ///< of a collapse

}  // namespace

/// \param n  normal of what the face takes the place of; zero: unknown
bool Remesher::normal_fits(const NewFace& f, const Double3& n) const {
  const Double3 own = triangle_normal(f.at[0], f.at[1], f.at[2]);
  const FaceExtent extent = face_extent(f.at[0], f.at[1], f.at[2]);
  if (extent.twice_area <= kFlatRoom * kFlatAltitude * extent.longest2) return false;
  const double length = norm(own);
  bool known = false;
  for (const std::uint32_t v : f.vertex) {
    const Double3 foot = wide(info_[v].normal);
    if (foot == Double3{}) continue;
    known = true;
    if (dot(own, foot) < kAlongFoot * length) return false;
  }
  const double along = dot(own, n), before = norm(n);
  return known ? along >= 0.0 : before == 0.0 || along >= kAlongBefore * length * before;
}

/// \param hint  a face of the reference nearby; comes back as the one that is near
bool Remesher::near_enough(const Double3& p, double limit, std::uint32_t& hint) const {
  const ReferenceSurface::Foot foot = surface_.near(p, limit * limit, limit * limit, hint);
  if (foot.slot == ReferenceSurface::kNone) return false;
  hint = foot.slot;
  return true;
}

bool Remesher::near_at_points(const NewFace& f, unsigned new_edges, double limit, std::uint32_t hint) const {
  if (!near_enough((f.at[0] + f.at[1] + f.at[2]) * (1.0 / 3.0), limit, hint)) return false;
  for (std::size_t i = 0; i < 3; ++i)
    if ((new_edges >> i & 1u) && !near_enough((f.at[i] + f.at[(i + 1) % 3]) * 0.5, limit, hint)) return false;
  return true;
}

/// The largest height of a corner over the tangent plane of another one; infinite where two corners have none.
double Remesher::bulge(const NewFace& f, std::uint32_t& hint) const {
  double height = 0.0;
  int without = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const Info& info = info_[f.vertex[i]];
    const Double3 n = wide(info.normal);
    if (n == Double3{}) {
      ++without;
      continue;
    }
    hint = info.foot;
    for (std::size_t k = 1; k < 3; ++k)
      height = std::max(height, std::fabs(dot(f.at[(i + k) % 3] - f.at[i], n)));
  }
  return without < 2 ? height : std::numeric_limits<double>::max();
}

/// A smooth surface with these normals at the corners bulges out of the face by a third of that height: where twice as
/// much is within the tolerance nothing is looked up.
/// \param new_edges  bit i: the edge from corner i to the next one is new, and no other face is asked about it
bool Remesher::within(const NewFace& f, unsigned new_edges) const {
  if (!(options_.tolerance > 0.0) && min_normal_cosine_ < -0.5) return true;
  std::uint32_t hint = ReferenceSurface::kNone;
  const double height = bulge(f, hint), limit = options_.tolerance;
  if (limit > 0.0 && !(height * (2.0 / 3.0) < limit) && !near_at_points(f, new_edges, limit, hint))
    return false;
  if (min_normal_cosine_ < -0.5) return true;
  const Double3 centre = (f.at[0] + f.at[1] + f.at[2]) * (1.0 / 3.0), side = f.at[1] - f.at[0];
  const ReferenceSurface::Foot foot =
      surface_.near(centre, std::numeric_limits<double>::max(), 0.01 * dot(side, side), hint);
  if (foot.slot == ReferenceSurface::kNone) return true;
  const Double3 own = triangle_normal(f.at[0], f.at[1], f.at[2]);
  return dot(own, wide(surface_.normal(foot.slot))) >= min_normal_cosine_ * norm(own);
}

/// How far lines give way to the shape of faces: as far as chords may leave creases, where that is asked for.
double Remesher::yielding(double distance) const {
  return options_.crease_tolerance > 0.0 ? std::min(distance, options_.crease_tolerance) : distance;
}

/// Two corners so near to each other that no sound face has room between them become one, as far as the tolerance allows:
/// u goes, unless it is the end of lines that make a shape at this size.
bool Remesher::corners_merge(std::uint32_t u, std::uint32_t v) const {
  const unsigned both = mesh_.state(u) & mesh_.state(v), any = mesh_.state(u) | mesh_.state(v);
  const double minimum = yielding(kNeedle * target(u, v));
  return (both & kVertexFixed) && !(any & (kVertexLocked | kVertexDead)) && !info_[u].lasting &&
         square_of(u, v) < minimum * minimum;
}

/// Two lines so near to each other that no sound face has room between them become one, face by face, where nothing else
/// helps.
bool Remesher::lines_meet(std::uint32_t u, std::uint32_t v) const {
  const double minimum = yielding(kLinesMeet * target(u, v));
  return (mending_ || blunting_) && (mesh_.state(v) & (kVertexCrease | kVertexFixed | kVertexBorder)) &&
         !(mesh_.state(v) & kVertexLocked) && square_of(u, v) < minimum * minimum;
}

/// Of u into v, no edge longer than `longest` targets; leaves the star of u and the place of v in it.
Remesher::Refusal Remesher::check_collapse(std::uint32_t u, std::uint32_t v, double longest,
                                           std::size_t& at) {
  const Refusal refusal = check_star(u, v, longest, at);
  if (refusal != Refusal::kNone || !guarding()) return refusal;
  return guard_.collapse_adds(star_, at) ? Refusal::kCrossing : Refusal::kNone;
}

/// All that the star, its neighbours and the reference tell.
Remesher::Refusal Remesher::check_star(std::uint32_t u, std::uint32_t v, double longest, std::size_t& at) {
  if ((mesh_.state(v) & kVertexPinched) || ((mesh_.state(u) & kVertexKept) && !corners_merge(u, v)) ||
      !mesh_.gather(u, star_))
    return Refusal::kLink;
  for (at = 0; at < star_.ring_size() && star_.ring[at] != v;) ++at;
  if (at == star_.ring_size() || !keeps_lines(u, at) || !keeps_lengths(u, at, longest) ||
      !keeps_valences(at) || !is_collapse_ok(mesh_, star_, at))
    return Refusal::kLink;
  const Refusal refusal = check_moved_faces(u, at);
  if (refusal != Refusal::kNone) return refusal;
  return is_line_near(u, at) ? Refusal::kNone : Refusal::kTolerance;
}

/// Whether u stays on its border or its crease, unless two lines become one.
bool Remesher::keeps_lines(std::uint32_t u, std::size_t at) const {
  const std::uint8_t state = mesh_.state(u);
  const bool border = (state & kVertexBorder) != 0;
  if (border && !is_border_spoke(star_, at)) return false;
  return !(state & (kVertexCrease | kVertexFixed)) || border || is_crease_spoke(mesh_, star_, at) ||
         lines_meet(u, star_.ring[at]);
}

/// Whether no edge at ring[at] gets longer than so many targets, and no face goes that has to stay.
bool Remesher::keeps_lengths(std::uint32_t u, std::size_t at, double longest) const {
  const std::uint32_t v = star_.ring[at];
  const double needle = kNeedle * target(u, v);
  if (square_of(u, v) < needle * needle) longest = std::max(longest, kLongNearNeedle);
  for (std::size_t i = 0; i < star_.ring_size(); ++i) {
    const std::uint32_t w = star_.ring[i];
    if (info_[w].pinned) return false;
    const double maximum = longest * target(v, w);
    if (i != at && square_of(v, w) > maximum * maximum) return false;
  }
  return true;
}

/// Whether no vertex is left with fewer than three faces (one at a border), nor ring[at] with more than flips could spread.
bool Remesher::keeps_valences(std::size_t at) const {
  if (!star_.closed) return star_.faces > 1;
  if (star_.faces <= 3) return false;
  std::size_t valence = star_.faces - 4;
  mesh_.for_each_neighbour(star_.ring[at], [&](std::uint32_t) { ++valence; });
  return valence <= (blunting_ ? kMaxBluntValence : kMaxNewValence);
}

/// Of a face without area whose first corner comes from so near that rounding cannot tell: a fan of such faces, as the pole of a
/// globe leaves it, goes one by one.
bool Remesher::stays_flat(const NewFace& face, const Double3& from) {
  const Double3* at = face.at;
  const FaceExtent before = face_extent(from, at[1], at[2]);
  return before.is_flat() && face_extent(at[0], at[1], at[2]).is_flat() &&
         squared_distance(from, at[0]) <= kFlatAltitude * kFlatAltitude * before.longest2;
}

/// Whether a face whose first corner comes from there keeps its side and does not get thinner than faces may be.
bool Remesher::keeps_shape(const NewFace& face, const Double3& from) const {
  const double before = mean_ratio(from, face.at[1], face.at[2]),
               after = mean_ratio(face.at[0], face.at[1], face.at[2]);
  // The normal of a flat face says nothing.
  const Double3 n = before < kMinMeanRatio ? Double3{} : triangle_normal(from, face.at[1], face.at[2]);
  return normal_fits(face, n) && !(after < kMinMeanRatio && after < before);
}

/// The faces that stay, with ring[at] in the place of u, against the reference; what goes must lie near one of them. Of what is
/// blunted the star is asked for folds, in the place of shapes and of what faces turn by.
Remesher::Refusal Remesher::check_moved_faces(std::uint32_t u, std::size_t at) const {
  if (blunting_ && !keeps_sides(u, at)) return Refusal::kFold;
  const std::uint32_t v = star_.ring[at];
  const Double3 from = mesh_.at(u), to = mesh_.at(v);
  const double limit = options_.tolerance;
  double nearest = limit > 0.0 ? std::numeric_limits<double>::max() : 0.0;
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const std::size_t j = star_.following(i);
    if (i == at || j == at) continue;
    const std::uint32_t a = star_.ring[i], b = star_.ring[j];
    const NewFace face{{v, a, b}, {to, mesh_.at(a), mesh_.at(b)}};
    if (!blunting_ && stays_flat(face, from)) {
      nearest = 0.0;
      continue;
    }
    if (blunting_ ? gets_flat(face) : !keeps_shape(face, from)) return Refusal::kFold;
    if (!within(face, 1u)) return Refusal::kTolerance;
    if (limit > 0.0)
      nearest =
          std::min(nearest, squared_distance(from, foot_in_triangle(from, to, face.at[1], face.at[2]).at));
  }
  return nearest > limit * limit ? Refusal::kTolerance : Refusal::kNone;
}

/// Whether a line through u deviates by no more than half the tolerance, and a crease by no more than chords may: what goes,
/// and the middle of the edge that takes its place.
bool Remesher::is_line_near(std::uint32_t u, std::size_t at) const {
  const bool crease = options_.crease_tolerance > 0.0 && !(mesh_.state(u) & kVertexBorder);
  if (!info_[u].line || !(options_.tolerance > 0.0 || crease)) return true;
  std::uint32_t other = star_.ring[at];
  for (std::size_t i = 0; i < star_.ring_size(); ++i) {
    if (i == at) continue;
    const bool line = star_.closed ? is_crease_spoke(mesh_, star_, i) : is_border_spoke(star_, i);
    if (line) other = star_.ring[i];
  }
  const Double3 from = mesh_.at(u), to = mesh_.at(star_.ring[at]), end = mesh_.at(other);
  double limit = options_.tolerance > 0.0 ? 0.5 * options_.tolerance : options_.crease_tolerance;
  if (crease) limit = yielding(limit);
  const double square = limit * limit;
  return squared_distance(from, foot_in_triangle(from, to, end, end).at) <= square &&
         surface_.slide((to + end) * 0.5, info_[u].foot).square <= square;
}

void Remesher::count_valences() {
  valence_.assign(info_.size(), 0);
  for (const CollapseFace& f : mesh_.faces()) {
    if (f.state & kStateDead) continue;
    for (const std::uint32_t v : f.vertex)
      valence_[v] = static_cast<std::uint8_t>(std::min(valence_[v] + 1, 250));
  }
}

namespace {
constexpr int kFlipRounds = 3;
constexpr int kNoSay = 1000;  ///< stars that are not whole, and corners, whose angles differ
}  // namespace

/// How many more faces than a regular star the vertex of the corner has, on the side of that corner where lines part it.
int Remesher::excess(std::uint32_t v, std::uint32_t corner) const {
  if (mesh_.state(v) & (kVertexLocked | kVertexFixed)) return kNoSay;
  if (!info_[v].line) return valence_[v] - 6;
  int faces = 1;
  for (std::uint32_t c = corner; !is_line(next_corner(c)) && faces < 40; ++faces) {
    const std::uint32_t o = mesh_.opposite(next_corner(c));
    if (o == kNoCorner) break;
    c = next_corner(o);
  }
  for (std::uint32_t c = corner; !is_line(prev_corner(c)) && faces < 40; ++faces) {
    const std::uint32_t o = mesh_.opposite(prev_corner(c));
    if (o == kNoCorner) break;
    c = prev_corner(o);
  }
  return faces - 3;
}

/// All edges once, then those with something new around them. What an edge decides depends on the stars of the four
/// vertices around it, so the others would decide as before.
void Remesher::flip_all(RemeshReport& report) {
  count_valences();
  begin_guarding();
  changed_.assign(info_.size(), 0);
  for (round_ = 0; round_ < kFlipRounds; ++round_) {
    std::size_t done = 0;
    for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
      step();
      for (std::uint32_t c = 4 * f; c < 4 * f + 3; ++c) {
        const std::uint32_t o = mesh_.opposite(c);
        if (o == kNoCorner || o < c || is_line(c)) continue;
        const std::uint32_t around[4] = {mesh_.vertex(c), mesh_.vertex(next_corner(c)),
                                         mesh_.vertex(prev_corner(c)), mesh_.vertex(o)};
        if (std::all_of(around, around + 4, [&](std::uint32_t v) { return changed_[v] < round_; })) continue;
        const Refusal refusal = try_flip(c);
        if (refusal != Refusal::kLink) count(refusal, report);  // most edges are long since as they should be
        if (refusal != Refusal::kNone) continue;
        ++done;
        for (const std::uint32_t v : around) mark_changed(v);
      }
    }
    report.flips += done;
    if (done == 0) return;
  }
}

Remesher::Refusal Remesher::try_flip(std::uint32_t c) {
  const std::uint32_t d = mesh_.opposite(c), u = mesh_.vertex(c), w = mesh_.vertex(d),
                      a = mesh_.vertex(next_corner(c)), b = mesh_.vertex(prev_corner(c));
  const std::pair<std::uint32_t, std::uint32_t> losing[2] = {{a, next_corner(c)}, {b, prev_corner(c)}},
                                                gaining[2] = {{u, c}, {w, d}};
  int change = 0;
  for (const auto& [v, corner] : losing) {
    const int e = excess(v, corner);
    if (e != kNoSay) change += 1 - 2 * e;
  }
  for (const auto& [v, corner] : gaining) {
    const int e = excess(v, corner);
    if (e != kNoSay) change += 1 + 2 * e;
  }
  const Double3 &pu = mesh_.at(u), &pw = mesh_.at(w), &pa = mesh_.at(a), &pb = mesh_.at(b);
  const double square_before = std::min(squared_mean_ratio(pu, pa, pb), squared_mean_ratio(pw, pb, pa));
  // Most edges: nothing to gain.
  if (square_before >= kSliver * kSliver &&
      (change > 0 || (change == 0 && square_before >= kRoundEnough * kRoundEnough)))
    return Refusal::kLink;
  const double before = std::sqrt(square_before),
               after = std::min(mean_ratio(pu, pa, pw), mean_ratio(pw, pb, pu));
  // Valences that stay as good must pay in shape; better ones may cost some, which relaxation makes up for.
  const bool sliver = before < kSliver && after > 1.5 * before;
  if (!sliver && (change > 0    ? true
                  : change == 0 ? after < kBetter * before + kBetterBy
                                : after < 0.35 && after < before))
    return Refusal::kLink;
  return flip_if_sound(c);
}

/// If neither connectivity nor surface object.
Remesher::Refusal Remesher::flip_if_sound(std::uint32_t c) {
  const std::uint32_t d = mesh_.opposite(c), u = mesh_.vertex(c), w = mesh_.vertex(d),
                      a = mesh_.vertex(next_corner(c)), b = mesh_.vertex(prev_corner(c));
  const Double3 &pu = mesh_.at(u), &pw = mesh_.at(w), &pa = mesh_.at(a), &pb = mesh_.at(b);
  if (info_[u].pinned || info_[w].pinned || info_[a].pinned || info_[b].pinned) return Refusal::kLink;
  for (const std::uint32_t v : {a, b})
    if (!(mesh_.state(v) & kVertexLocked) && valence_[v] <= ((mesh_.state(v) & kVertexOpen) ? 1 : 3))
      return Refusal::kLink;
  // One of the new ends sees all its neighbours: the new edge must not exist.
  const bool u_knows = (mesh_.state(u) & kVertexLocked) == 0;
  if (!u_knows && (mesh_.state(w) & kVertexLocked)) return Refusal::kLink;
  bool exists = u == w;
  mesh_.for_each_neighbour(u_knows ? u : w, [&](std::uint32_t n) { exists |= n == (u_knows ? w : u); });
  if (exists) return Refusal::kLink;
  const Double3 n = triangle_normal(pu, pa, pb) + triangle_normal(pw, pb, pa);
  const NewFace one{{u, a, w}, {pu, pa, pw}}, two{{w, b, u}, {pw, pb, pu}};
  if (!normal_fits(one, n) || !normal_fits(two, n) ||
      !(dot(triangle_normal(pu, pa, pw), triangle_normal(pw, pb, pu)) > 0.0))
    return Refusal::kFold;
  if (!within(one, 4u) || !within(two, 0u)) return Refusal::kTolerance;
  if (guarding() && guard_.flip_adds(c)) return Refusal::kCrossing;
  mesh_.flip(c);
  if (guarded_) guard_.accept();
  --valence_[a], --valence_[b];
  ++valence_[u], ++valence_[w];
  return Refusal::kNone;
}

}  // namespace tessera
