// Edges far shorter than they should be that no other test lets go: needles, and shapes smaller than an edge. The normal of
// a face there is noise, and so is what it turns by: faces around are asked for folds instead.
// After Botsch and Kobbelt, "A Robust Procedure to Eliminate Degenerate Faces from Triangle Meshes", 2001.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "kernels/mesh/flat_faces.h"
#include "kernels/remesh/remesher.h"

namespace tessera {
namespace {

constexpr double kBluntBelow = 0.4;  ///< targets
constexpr int kBluntRounds = 4;      ///< after the first iteration
constexpr double kNoNormal = 0.01;   ///< targets: the normal of a lower face is noise
constexpr double kFoldFrom = -0.35;  ///< cosine between normals across an edge: beyond, the faces fold
constexpr double kRounding = 1e-9;
constexpr double kWallFace = 0.1;  ///< squared targets: a larger face is one side of a wall

struct Facing {
  Double3 normal{};  ///< unit; zero where it says nothing
  double area = 0.0;
};

Facing facing_of(const Double3& a, const Double3& b, const Double3& c, double target) {
  const FaceExtent extent = face_extent(a, b, c);
  if (!(extent.twice_area > kNoNormal * target * std::sqrt(extent.longest2))) return {};
  return {unit_or_zero(triangle_normal(a, b, c)), 0.5 * extent.twice_area};
}

double fold_between(const Facing& a, const Facing& b) {
  if (a.area == 0.0 || b.area == 0.0) return 0.0;
  return std::max(0.0, kFoldFrom - dot(a.normal, b.normal));
}

}  // namespace

/// What is far too short goes where that folds nothing and stays within the tolerance, however long edges get: they are
/// split again.
std::size_t Remesher::blunt(int rounds, RemeshReport& report) {
  const std::size_t before = report.collapses;
  blunting_ = true;
  collapse_short({kBluntBelow, std::numeric_limits<float>::max()}, std::max(rounds, kBluntRounds), report);
  blunting_ = false;
  return report.collapses - before;
}

/// Whether the collapse of u, whose star is gathered, into ring[at] leaves the edges in and around the star no more folded, in
/// all, than they are.
bool Remesher::folds_no_more(std::uint32_t u, std::size_t at) const {
  const std::uint32_t v = star_.ring[at];
  const Double3 from = mesh_.at(u), to = mesh_.at(v);
  const double unit = target(u, v);
  double before = 0.0, after = 0.0;
  Facing old, now, first_old, first_now;
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const std::size_t j = star_.following(i);
    const Double3 &a = mesh_.at(star_.ring[i]), &b = mesh_.at(star_.ring[j]);
    Facing beyond;
    if (const std::uint32_t o = mesh_.opposite(star_.corner[i]); o != kNoCorner) {
      const std::uint32_t* t = mesh_.face(o >> 2).vertex;
      beyond = facing_of(mesh_.at(t[0]), mesh_.at(t[1]), mesh_.at(t[2]), unit);
    }
    // In the place of a face that goes comes what lies beyond it; the edge between the two that go is no more.
    const bool goes = i == at || j == at;
    const Facing next_old = facing_of(from, a, b, unit), next_now = goes ? beyond : facing_of(to, a, b, unit);
    before += fold_between(next_old, beyond);
    if (!goes) after += fold_between(next_now, beyond);
    if (i > 0) before += fold_between(old, next_old);
    if (i > 0 && i != at) after += fold_between(now, next_now);
    if (i == 0) first_old = next_old, first_now = next_now;
    old = next_old, now = next_now;
  }
  if (star_.closed) {
    before += fold_between(old, first_old);
    if (at > 0) after += fold_between(now, first_now);
  }
  return after <= before + kRounding;
}

/// Whether no two sides of a wall get a corner in common that its rim kept apart: u's, whose star is gathered, and ring[at]'s.
bool Remesher::keeps_walls(std::uint32_t u, std::size_t at) const {
  const std::uint32_t v = star_.ring[at];
  const double unit = target(u, v), wall = kWallFace * unit * unit;
  std::array<Double3, kMaxRing> sides;
  std::size_t count = 0;
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const std::size_t j = star_.following(i);
    if (i == at || j == at) continue;
    const Facing f = facing_of(mesh_.at(v), mesh_.at(star_.ring[i]), mesh_.at(star_.ring[j]), unit);
    if (f.area > wall) sides[count++] = f.normal;
  }
  const std::uint32_t first = mesh_.corner(v);
  for (std::uint32_t c = first; count > 0;) {
    const std::uint32_t* t = mesh_.face(c >> 2).vertex;
    const Facing f = facing_of(mesh_.at(t[0]), mesh_.at(t[1]), mesh_.at(t[2]), unit);
    const bool goes = t[0] == u || t[1] == u || t[2] == u;
    if (!goes && f.area > wall && std::any_of(sides.begin(), sides.begin() + count, [&](const Double3& side) {
          return dot(side, f.normal) < kFoldFrom;
        }))
      return false;
    const std::uint32_t o = mesh_.opposite(next_corner(c));
    if (o == kNoCorner || next_corner(o) == first) break;
    c = next_corner(o);
  }
  return true;
}

/// Whether the star of u, gathered, may be blunted by its collapse into ring[at].
bool Remesher::keeps_sides(std::uint32_t u, std::size_t at) const {
  return folds_no_more(u, at) && keeps_walls(u, at);
}

/// Whether a face is too low to be told from a line.
bool Remesher::gets_flat(const NewFace& face) {
  const FaceExtent extent = face_extent(face.at[0], face.at[1], face.at[2]);
  return extent.twice_area <= kFlatRoom * kFlatAltitude * extent.longest2;
}

}  // namespace tessera
