// The end of the loop: faces with a sharp angle one by one.
#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/remesh/remesher.h"
#include "kernels/remesh/triangle_quality.h"

namespace tessera {
namespace {

constexpr double kHeight = 0.8660254037844386;  ///< of an equilateral triangle, in edges
constexpr int kMendRounds = 2;
// Squared cosines of angles, as sharpness() gives them.
constexpr double kSharp = 0.75;            ///< 30 degrees
constexpr double kSharpAtCreases = 0.794;  ///< 27
constexpr double kCap = 0.97;              ///< 10
constexpr double kCapHeight = 0.05;        ///< targets: a line moves by less where a cap on it goes
constexpr double kEarHeight = 0.1;  ///< of a cap with both its other edges on the border: no line moves
constexpr double kFlipGain = 0.01, kMoveGain = 0.005;
constexpr double kLongCollapse = 1.6;                        ///< targets: no edge gets longer by a collapse
constexpr double kStrongFinishCrease = 0.70710678118654752;  ///< cosine of its turn: others yield to shape

}  // namespace

/// Of the faces around the gathered star if its centre were at p.
double Remesher::star_sharpness(const Double3& p) const {
  double maximum = 0.0;
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const std::uint32_t a = star_.ring[i], b = star_.ring[i + 1 < star_.ring_size() ? i + 1 : 0];
    maximum = std::max(maximum, sharpness(p, mesh_.at(a), mesh_.at(b)));
  }
  return maximum;
}

void Remesher::finish(RemeshReport& report) {
  flip_all(report);
  even_cells(report);
  for (int i = 0; i < kMendRounds; ++i) mend_all(report);
}

double Remesher::sharpness_of(std::uint32_t f) const {
  const CollapseFace& face = mesh_.face(f);
  if (face.state & kStateDead) return 0.0;
  return sharpness(mesh_.at(face.vertex[0]), mesh_.at(face.vertex[1]), mesh_.at(face.vertex[2]));
}

void Remesher::mend_all(RemeshReport& report) {
  count_valences();
  begin_guarding();
  mending_ = true;
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
    step();
    if (sharpness_of(f) <= kSharp) continue;
    mend(f, report);
    if (sharpness_of(f) <= kSharpAtCreases) continue;
    bool released = false;
    for (std::uint32_t i = 0; i < 3; ++i) released |= release_weak_creases(mesh_.face(f).vertex[i]);
    if (released) mend(f, report);
  }
  mending_ = false;
}

/// The face loses its sharp angle to a flip, a move of a corner, or a collapse of its shortest edge, as far as each makes the
/// sharpest angle around less sharp.
void Remesher::mend(std::uint32_t f, RemeshReport& report) {
  flip_sharp(f, report);
  for (std::uint32_t i = 0; i < 3 && sharpness_of(f) > kSharp; ++i)
    shift_sharp(mesh_.face(f).vertex[i], report);
  if (sharpness_of(f) > kSharp) collapse_sharp(f, report);
  if (sharpness_of(f) > kCap) flip_cap(f, report);
}

/// Creases at the vertex that turn little are none any more: noise, where they leave no room for a sound face. Not where chords
/// have to keep to creases.
bool Remesher::release_weak_creases(std::uint32_t v) {
  if (options_.crease_tolerance > 0.0) return false;
  if ((mesh_.state(v) & (kVertexLocked | kVertexDead)) || !mesh_.gather(v, star_)) return false;
  std::vector<std::uint32_t> weak;
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const std::uint32_t c = prev_corner(star_.corner[i]),
                        o = mesh_.opposite(c);  // across from it: v to ring[i]
    if (!mesh_.crease_edge(c) || o == kNoCorner) continue;
    if (mesh_.state(star_.ring[i]) & kVertexLocked) continue;
    if (info_[star_.ring[i]].pinned) continue;
    const auto normal = [&](std::uint32_t f) {
      const std::uint32_t* t = mesh_.face(f).vertex;
      return triangle_normal(mesh_.at(t[0]), mesh_.at(t[1]), mesh_.at(t[2]));
    };
    const Double3 m = normal(c >> 2), n = normal(o >> 2);
    if (dot(m, n) > kStrongFinishCrease * norm(m) * norm(n)) weak.push_back(static_cast<std::uint32_t>(i));
  }
  for (const std::uint32_t i : weak) {
    const std::uint32_t c = prev_corner(star_.corner[i]);
    mesh_.unmark_crease(mesh_.opposite(c));
    mesh_.unmark_crease(c);
  }
  if (weak.empty()) return false;
  std::vector<std::uint32_t> around = {v};
  for (const std::uint32_t i : weak) around.push_back(star_.ring[i]);
  for (const std::uint32_t w : around)
    if (!(mesh_.state(w) & kVertexBorder)) count_lines(w);
  return true;
}

/// A vertex that took over lines of another one is a corner, unless it goes on two of them as before.
void Remesher::recount_lines(std::uint32_t v) {
  if ((mesh_.state(v) & (kVertexLocked | kVertexFixed)) || !mesh_.gather(v, star_)) return;
  int creases = 0;
  for (std::size_t i = 0; i < star_.faces; ++i) creases += mesh_.crease_edge(prev_corner(star_.corner[i]));
  if (creases == ((mesh_.state(v) & kVertexCrease) ? 2 : 0)) return;
  mesh_.add_state(v, kVertexFixed);
  leave_line(info_[v]);
}

/// What was its foot is a segment of a line, not a face to look for others from.
void Remesher::leave_line(Info& info) {
  if (info.line) info.foot = ReferenceSurface::kNone;
  info.line = false;
}

/// What a vertex is after creases at it went.
void Remesher::count_lines(std::uint32_t v) {
  if (!mesh_.gather(v, star_)) return;
  int creases = 0;
  for (std::size_t i = 0; i < star_.faces; ++i) creases += mesh_.crease_edge(prev_corner(star_.corner[i]));
  mesh_.drop_state(v, kVertexCrease | kVertexFixed);
  Info& info = info_[v];
  leave_line(info);
  if (creases > 0) {
    mesh_.add_state(v, kVertexFixed);  // an end, or lines that met it at other angles
    return;
  }
  const ReferenceSurface::Foot foot = surface_.closest(mesh_.at(v), std::numeric_limits<double>::max());
  info.foot = foot.slot;
  if (foot.slot != ReferenceSurface::kNone) info.normal = surface_.normal(foot.slot);
}

/// The edge whose flip makes the sharper of two faces least sharp.
bool Remesher::flip_sharp(std::uint32_t f, RemeshReport& report) {
  std::uint32_t best = kNoCorner;
  double minimum = 0.0;
  for (std::uint32_t c = 4 * f; c < 4 * f + 3; ++c) {
    const std::uint32_t d = mesh_.opposite(c);
    if (d == kNoCorner || is_line(c)) continue;
    const Double3 &pu = mesh_.at(mesh_.vertex(c)), &pw = mesh_.at(mesh_.vertex(d)),
                  &pa = mesh_.at(mesh_.vertex(next_corner(c))), &pb = mesh_.at(mesh_.vertex(prev_corner(c)));
    const double gain = std::max(sharpness(pu, pa, pb), sharpness(pw, pb, pa)) -
                        std::max(sharpness(pu, pa, pw), sharpness(pw, pb, pu));
    if (gain > std::max(minimum, kFlipGain)) minimum = gain, best = c;
  }
  if (best == kNoCorner || flip_if_sound(best) != Refusal::kNone) return false;
  ++report.flips;
  return true;
}

/// A flat face whose longest edge is a crease, its apex all but on it: the crease goes through the apex instead.
bool Remesher::flip_cap(std::uint32_t f, RemeshReport& report) {
  const std::uint32_t c = 4 * f + longest_corner(f), d = mesh_.opposite(c);
  if (d == kNoCorner || !mesh_.crease_edge(c)) return false;
  const std::uint32_t apex = mesh_.vertex(c), a = mesh_.vertex(next_corner(c)),
                      b = mesh_.vertex(prev_corner(c));
  const Double3 along = mesh_.at(b) - mesh_.at(a);
  const double twice = norm(cross(along, mesh_.at(apex) - mesh_.at(a))), length = norm(along);
  const bool ear = mesh_.border_edge(next_corner(c)) && mesh_.border_edge(prev_corner(c));  // no line moves
  const double maximum =
      std::min(options_.tolerance > 0.0 ? 0.5 * options_.tolerance : kEarHeight * info_[apex].target,
               yielding((ear ? kEarHeight : kCapHeight) * info_[apex].target));
  if (!(twice < maximum * length) || flip_if_sound(c) != Refusal::kNone) return false;
  ++report.flips;
  // From the apex to both ends of what was the longest edge.
  for (const std::uint32_t e : {prev_corner(c), d}) {
    if (mesh_.border_edge(e)) continue;
    mesh_.mark_crease(e);
    if (mesh_.opposite(e) != kNoCorner) mesh_.mark_crease(mesh_.opposite(e));
  }
  for (const std::uint32_t v : {apex, a, b}) recount_after_cap(v);
  if (info_[apex].line && mesh_.gather(apex, star_)) move_vertex(apex, mesh_.at(apex), report);
  return true;
}

/// Lines at the vertex have come or gone: it slides along two, is a corner of others, or none.
void Remesher::recount_after_cap(std::uint32_t v) {
  if ((mesh_.state(v) & (kVertexLocked | kVertexBorder)) || !mesh_.gather(v, star_)) return;
  const bool was_smooth = (mesh_.state(v) & (kVertexCrease | kVertexFixed)) == 0;
  int creases = 0;
  for (std::size_t i = 0; i < star_.faces; ++i) creases += mesh_.crease_edge(prev_corner(star_.corner[i]));
  if (creases == 2 && (mesh_.state(v) & kVertexCrease)) return;
  if (!(creases == 2 && was_smooth && surface_.has_lines())) {
    if (!(creases > 0 && (mesh_.state(v) & kVertexFixed))) count_lines(v);
    return;
  }
  mesh_.add_state(v, kVertexCrease);
  info_[v].line = true;
  info_[v].normal = Float3{};
  info_[v].foot = surface_.closest_on_lines(mesh_.at(v)).slot;
}

/// One corner, to the best of a few places.
bool Remesher::shift_sharp(std::uint32_t v, RemeshReport& report) {
  if ((mesh_.state(v) & kVertexKept) || !mesh_.gather(v, star_)) return false;
  if (info_[v].foot == ReferenceSurface::kNone) return false;
  const Double3 old = mesh_.at(v);
  const double before = star_sharpness(old);
  // Apexes of equilateral faces over the edges of the ring, those of sharp faces count more.
  Double3 sum{}, worst{};
  double weights = 0.0, maximum = 0.0;
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const Double3 &a = mesh_.at(star_.ring[i]),
                  &b = mesh_.at(star_.ring[i + 1 < star_.ring_size() ? i + 1 : 0]);
    const Double3 middle = (a + b) * 0.5, side = b - a, up = old - middle;
    const double square = dot(side, side);
    if (!(square > 0.0)) return false;
    const Double3 across = up - side * (dot(up, side) / square);
    const double height = norm(across);
    if (!(height > 0.0)) continue;
    const Double3 apex = middle + across * (kHeight * std::sqrt(square) / height);
    const double s = sharpness(old, a, b), w = s * s * s * s;
    sum = sum + apex * w;
    weights += w;
    if (s > maximum) maximum = s, worst = apex;
  }
  if (!(weights > 0.0)) return false;
  const Double3 middle = sum * (1.0 / weights);
  const Double3 candidates[] = {wish(v), middle, old + (worst - old) * 0.5, old + (middle - old) * 0.5,
                                old + (worst - old) * 0.25};
  const Double3* best = nullptr;
  double minimum = before - kMoveGain;
  for (const Double3& p : candidates) {
    const double s = star_sharpness(p);
    if (s < minimum) minimum = s, best = &p;
  }
  if (!best) return false;
  return move_if_rounder(v, *best, before, report);
}

bool Remesher::move_if_rounder(std::uint32_t v, const Double3& to, double before, RemeshReport& report) {
  return move_if(v, to, report, [&] { return star_sharpness(mesh_.at(v)) < before; });
}

/// Of the faces that are left of the gathered star once its vertex lies at v.
double Remesher::sharpness_without(std::uint32_t v) const {
  double after = 0.0;
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const std::uint32_t x = star_.ring[i], y = star_.ring[star_.following(i)];
    if (x != v && y != v) after = std::max(after, sharpness(mesh_.at(v), mesh_.at(x), mesh_.at(y)));
  }
  return after;
}

bool Remesher::collapse_sharp(std::uint32_t f, RemeshReport& report) {
  std::uint32_t corner = 0;
  double minimum = std::numeric_limits<double>::max();
  const std::uint32_t* t = mesh_.face(f).vertex;
  for (std::uint32_t i = 0; i < 3; ++i) {
    const double square = square_of(t[(i + 1) % 3], t[(i + 2) % 3]);
    if (square < minimum) minimum = square, corner = i;
  }
  const std::uint32_t a = t[(corner + 1) % 3], b = t[(corner + 2) % 3];
  for (const bool a_goes : {true, false}) {
    const std::uint32_t u = a_goes ? a : b, v = a_goes ? b : a;
    std::size_t at = 0;
    if (check_collapse(u, v, kLongCollapse, at) != Refusal::kNone) continue;
    if (sharpness_without(v) >= star_sharpness(mesh_.at(u))) continue;
    collapse(at);
    recount_lines(v);
    ++report.collapses;
    return true;
  }
  return false;
}

}  // namespace tessera
