#include "kernels/decimate/colour_guard.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

constexpr double kColourNoise = 0.25;  ///< of the tolerance

std::array<double, 3> colour_of(std::uint32_t rgba) {
  return {static_cast<double>(rgba & 255u), static_cast<double>(rgba >> 8 & 255u),
          static_cast<double>(rgba >> 16 & 255u)};
}

double most_apart(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::max({std::fabs(a[0] - b[0]), std::fabs(a[1] - b[1]), std::fabs(a[2] - b[2])});
}

}  // namespace

double auto_colour_tolerance(const MeshBlock& mesh) {
  constexpr std::uint64_t kTimes = 4, kLeast = 8;
  std::array<std::uint64_t, 256> count{};  // inner edges twice
  for (const auto& f : mesh.faces)
    for (std::size_t k = 0; k < 3; ++k)
      ++count[static_cast<std::size_t>(
          most_apart(colour_of(mesh.rgba[f[k]]), colour_of(mesh.rgba[f[k == 2 ? 0 : k + 1]])))];
  const std::uint64_t all = 3 * mesh.faces.size();
  std::uint64_t level = 0, below = count[0];
  while (10 * below < 9 * all) below += count[++level];
  return kTimes * level > 255 ? 0.0 : static_cast<double>(std::max(kTimes * level, kLeast));
}

ColourGuard::ColourGuard(const CollapseMesh& mesh, const MeshBlock& block, double tolerance)
    : mesh_(mesh), block_(block), tolerance_(block.rgba.empty() ? 0.0 : tolerance) {
  if (!asks()) return;
  changed_.assign(mesh.vertices(), 0.0f);
  kept_.assign(mesh.vertices(), 0);
}

bool ColourGuard::allows(std::uint32_t u, const Star& star, std::size_t at) {
  if (!asks()) return true;
  const double before = static_cast<double>(changed_[u]), left = tolerance_ - before;
  const std::size_t size = star.ring_size();
  const Colour own = colour(u);
  // All that may be interpolated lies between the least and the most of the ring.
  double most = 0.0;
  for (std::size_t i = 0; i < size; ++i) ring_[i].colour = colour(star.ring[i]);
  for (std::size_t k = 0; k < 3; ++k) {
    double above = -255.0, below = -255.0;
    for (std::size_t i = 0; i < size; ++i) {
      const double change = ring_[i].colour[k] - own[k];
      above = std::max(above, change), below = std::max(below, -change);
    }
    if (above < -left || below < -left) return false;
    most = std::max({most, above, below});
  }
  last_ = {};
  if (before == 0.0 && most <= kColourNoise * tolerance_) return true;
  if (!flatten(u, star)) return false;
  const double change = std::max(change_at_foot(own, star, at), change_at_crossings(own, star, at));
  if (change > left) return false;
  last_.levels = static_cast<float>(before + (change > kColourNoise * tolerance_ ? change : 0.0));
  return true;
}

/// Lays the ring into the plane that the star's faces have in the mean, its centre at 0. \return false where they have none
bool ColourGuard::flatten(std::uint32_t u, const Star& star) {
  const Double3& centre = mesh_.at(u);
  Double3 normal{};
  for (std::size_t i = 0; i < star.faces; ++i)
    normal = normal + triangle_normal(centre, mesh_.at(star.ring[i]), mesh_.at(star.ring[star.following(i)]));
  const double length = norm(normal);
  if (!(length > 0.0)) return false;
  normal = normal * (1.0 / length);
  const Double3 ex = any_orthogonal(normal), ey = cross(normal, ex);
  for (std::size_t i = 0; i < star.ring_size(); ++i) {
    const Double3 spoke = mesh_.at(star.ring[i]) - centre;
    ring_[i].x = dot(spoke, ex), ring_[i].y = dot(spoke, ey);
  }
  return true;
}

/// The centre's colour against what the new faces show in its place: in the one that it is farthest in, or least far outside of.
double ColourGuard::change_at_foot(const Colour& own, const Star& star, std::size_t at) {
  const Corner& v = ring_[at];
  double farthest = -std::numeric_limits<double>::infinity(), weight[3] = {};
  std::size_t face = at;
  for (std::size_t i = 0; i < star.faces; ++i) {
    const std::size_t j = star.following(i);
    if (i == at || j == at) continue;
    const Corner &a = ring_[i], &b = ring_[j];
    const double wa = b.x * v.y - b.y * v.x, wb = v.x * a.y - v.y * a.x, wv = a.x * b.y - a.y * b.x;
    const double inside = std::min({wa, wb, wv});
    if (!(inside > farthest)) continue;
    farthest = inside, face = i;
    weight[0] = std::max(wa, 0.0), weight[1] = std::max(wb, 0.0), weight[2] = std::max(wv, 0.0);
  }
  last_.heir = {star.ring[at], star.ring[at], star.ring[at]};
  if (face == at) return 0.0;  // no new face
  const std::size_t after = star.following(face);
  last_.heir = {star.ring[face], star.ring[after], star.ring[at]};
  const double sum = weight[0] + weight[1] + weight[2];
  if (!(sum > 0.0)) return std::numeric_limits<double>::infinity();
  double change = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double seen =
        (weight[0] * ring_[face].colour[k] + weight[1] * ring_[after].colour[k] + weight[2] * v.colour[k]) /
        sum;
    change = std::max(change, std::fabs(own[k] - seen));
  }
  return change;
}

/// Old and new colours where edges from the centre cross those that star.ring[at] gets: between two fans over one polygon
/// what is linear in the faces of both differs most there or at the centre.
double ColourGuard::change_at_crossings(const Colour& own, const Star& star, std::size_t at) const {
  const std::size_t size = star.ring_size();
  const Corner& v = ring_[at];
  double change = 0.0;
  for (std::size_t j = 0; j < size; ++j) {
    const std::size_t apart = j > at ? j - at : at - j;
    if (apart < 2 || (star.closed && apart + 1 == size)) continue;  // edges that there are already
    const double nx = ring_[j].x - v.x, ny = ring_[j].y - v.y;
    for (std::size_t i = 0; i < size; ++i) {
      if (i == at || i == j) continue;
      const Corner& spoke = ring_[i];
      const double per = spoke.x * ny - spoke.y * nx;
      // Where both lines meet, as shares of the spoke and of the new edge.
      const double t = (v.x * ny - v.y * nx) / per, s = (v.x * spoke.y - v.y * spoke.x) / per;
      if (!(t > 0.0 && t < 1.0 && s > 0.0 && s < 1.0)) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        const double before = (1.0 - t) * own[k] + t * spoke.colour[k];
        const double after = (1.0 - s) * v.colour[k] + s * ring_[j].colour[k];
        change = std::max(change, std::fabs(after - before));
      }
    }
  }
  return change;
}

bool ColourGuard::allows_blend(std::uint32_t u, std::uint32_t v, double along) {
  if (!asks()) return true;
  const double change = most_apart(colour(u), colour(v));
  const double at_u = static_cast<double>(changed_[u]) + along * change,
               at_v = static_cast<double>(changed_[v]) + (1.0 - along) * change;
  if (std::max(at_u, at_v) > tolerance_) return false;
  const bool noise = change <= kColourNoise * tolerance_;
  last_ = {noise ? std::max(changed_[u], changed_[v]) : static_cast<float>(std::max(at_u, at_v)), {v, v, v}};
  return true;
}

ColourGuard::Colour ColourGuard::colour(std::uint32_t v) const {
  return colour_of(block_.rgba[mesh_.block_vertex(v)]);
}

void ColourGuard::accept() {
  if (last_.levels > 0.0f)
    for (const std::uint32_t v : last_.heir) changed_[v] = std::max(changed_[v], last_.levels);
}

std::size_t ColourGuard::kept() const {
  std::size_t count = 0;
  for (std::uint32_t v = 0; v < kept_.size(); ++v) count += kept_[v] != 0 && !(mesh_.state(v) & kVertexDead);
  return count;
}

void ColourGuard::compact(const std::vector<std::uint32_t>& kept) {
  if (!asks()) return;
  for (std::size_t i = 0; i < kept.size(); ++i) changed_[i] = changed_[kept[i]];
  changed_.resize(kept.size());
  kept_.assign(kept.size(), 0);  // only the queue tells, after the last sweep
}

}  // namespace tessera
