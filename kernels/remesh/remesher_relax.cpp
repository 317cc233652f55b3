// Relaxation along the surface: Botsch's thesis, 3.2.3.
#include <algorithm>
#include <cmath>

#include "kernels/mesh/flat_faces.h"
#include "kernels/mesh/mean_ratio.h"
#include "kernels/remesh/remesher.h"

namespace tessera {
namespace {

constexpr double kStill = 1e-3;    ///< of the length: smaller moves are not worth a look-up
constexpr double kFlatFace = 0.1;  ///< roundness
constexpr double kFlat = 0.0625;   ///< a move leaves the surface by less than this share of it (squares)
constexpr double kMinCosineMoved = 0.5;  ///< least cosine of a face to what it was before a move

}  // namespace

std::size_t Remesher::relax_all(RemeshReport& report) {
  std::size_t moved = 0;
  begin_guarding();
  for (std::uint32_t v = 0; v < info_.size(); ++v) {
    step();
    moved += relax(v, report);
  }
  report.moves += moved;
  return moved;
}

/// Where the vertex would like to be; its star is gathered.
Double3 Remesher::wish(std::uint32_t v) const {
  const Double3 at = mesh_.at(v);
  if (info_[v].line) {
    Double3 sum{};
    for (std::size_t i = 0; i < star_.ring_size(); ++i) {
      const bool line = star_.closed ? is_crease_spoke(mesh_, star_, i) : is_border_spoke(star_, i);
      if (line) sum = sum + (mesh_.at(star_.ring[i]) - at) * 0.5;
    }
    return at + sum;
  }
  // The middle of the neighbours.
  Double3 centre{}, normal{};
  const std::size_t size = star_.ring_size();
  for (std::size_t i = 0; i < size; ++i) {
    centre = centre + (mesh_.at(star_.ring[i]) - at);
  }
  for (std::size_t i = 0; i < star_.faces; ++i)
    normal =
        normal + cross(mesh_.at(star_.ring[i]) - at, mesh_.at(star_.ring[i + 1 < size ? i + 1 : 0]) - at);
  centre = centre * (1.0 / static_cast<double>(size));
  const double square = dot(normal, normal);
  return square > 0.0 ? at + centre - normal * (dot(normal, centre) / square) : at;
}

bool Remesher::relax(std::uint32_t v, RemeshReport& report) {
  if ((mesh_.state(v) & kVertexKept) || !mesh_.gather(v, star_)) return false;
  if (info_[v].foot == ReferenceSurface::kNone) return false;
  return move_if_far(v, wish(v), report);
}

bool Remesher::move_if_far(std::uint32_t v, const Double3& to, RemeshReport& report) {
  const double still = kStill * info_[v].target;
  return squared_distance(to, mesh_.at(v)) > still * still && move_vertex(v, to, report);
}

/// Whether the edges along the crease of the gathered vertex leave it by no more than chords may, or than they did.
bool Remesher::keeps_chords(std::uint32_t v, const ReferenceSurface::Foot& to) const {
  const Info& info = info_[v];
  if (!info.line || !(options_.crease_tolerance > 0.0) || (mesh_.state(v) & kVertexBorder)) return true;
  const auto off = [&](const Double3& at, std::uint32_t segment, const Double3& end) {
    return surface_.slide((at + end) * 0.5, segment).square;
  };
  const double square = options_.crease_tolerance * options_.crease_tolerance;
  for (std::size_t i = 0; i < star_.ring_size(); ++i) {
    if (!is_crease_spoke(mesh_, star_, i)) continue;
    const Double3& end = mesh_.at(star_.ring[i]);
    const double now = off(to.at, to.slot, end);
    if (now > square && now > off(mesh_.at(v), info.foot, end)) return false;
  }
  return true;
}

/// Puts the vertex, whose star is gathered, at the foot of `to` on the reference where that leaves its faces sound.
bool Remesher::move_vertex(std::uint32_t v, const Double3& to, RemeshReport& report) {
  Info info = info_[v];
  const Double3 old = mesh_.at(v);
  const double far = info.target;
  ReferenceSurface::Foot foot =
      info.line ? surface_.slide(to, info.foot)
                : surface_.near(to, far * far, kFlat * squared_distance(to, old), info.foot);
  if (foot.slot == ReferenceSurface::kNone || foot.square > far * far) return false;
  foot.at = as_put(foot.at);
  info.foot = foot.slot;
  if (!info.line) {
    const Double3 before = wide(info.normal);
    info.normal = surface_.normal(foot.slot);
    if (dot(before, wide(info.normal)) < 0.0) return false;  // the other side of a thin wall
  }
  for (std::size_t i = 0; i < star_.ring_size(); ++i)
    if (info_[star_.ring[i]].pinned) return false;
  if (!keeps_chords(v, foot)) {
    ++report.by_tolerance;
    return false;
  }
  const Info kept = info_[v];
  info_[v].normal = info.normal;
  info_[v].foot = info.foot;
  const auto refuse = [&](std::size_t& count) {
    info_[v] = kept;
    ++count;
    return false;
  };
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const std::uint32_t a = star_.ring[i], b = star_.ring[i + 1 < star_.ring_size() ? i + 1 : 0];
    const NewFace face{{v, a, b}, {foot.at, mesh_.at(a), mesh_.at(b)}};
    const Double3 p = face.at[1] - foot.at, q = face.at[2] - foot.at, side = face.at[2] - face.at[1],
                  before = cross(face.at[1] - old, face.at[2] - old), after = cross(p, q);
    const double along = dot(before, after), square_before = dot(before, before),
                 square_after = dot(after, after), sides = dot(p, p) + dot(q, q) + dot(side, side);
    // A face that is flat or lies wrong already may turn, if the reference says so.
    const bool flipped =
        along <= 0.0 || along * along < kMinCosineMoved * kMinCosineMoved * square_before * square_after;
    const auto was_flat = [&] {
      return squared_mean_ratio(old, face.at[1], face.at[2]) < kFlatFace * kFlatFace;
    };
    if (flipped && !(normal_fits(face, {}) &&
                     (was_flat() || !normal_fits({{v, a, b}, {old, face.at[1], face.at[2]}}, {}))))
      return refuse(report.by_fold);
    // Nor may it all but vanish.
    if (square_after < 0.04 * square_before ||
        (12.0 * square_after < kFlatFace * kFlatFace * sides * sides && !was_flat()))
      return refuse(report.by_fold);
    const double flat = kFlatRoom * kFlatAltitude * sides;  // faces that are flat already come here too
    if (square_after <= flat * flat) return refuse(report.by_fold);
    const bool last = !star_.closed && i + 1 == star_.faces;
    if (!within(face, last ? 5u : 1u)) return refuse(report.by_tolerance);
  }
  if (guarding() && guard_.move_adds(star_, foot.at)) return refuse(report.by_crossing);
  mesh_.node(v).at = foot.at;
  if (guarded_) guard_.accept();
  info_[v].moved = true;
  set_target(info_[v], foot.at);
  return true;
}

}  // namespace tessera
