// Decimator: collapses into the minimum of the quadric.
#include <algorithm>
#include <cmath>

#include "kernels/decimate/decimator.h"
#include "kernels/mesh/mean_ratio.h"
#include "octree/rounding.h"
#include "octree/vector.h"

namespace tessera {

/// Both ends are free inside the surface, and the reference is known there.
bool Decimator::may_move(std::uint32_t u, std::uint32_t v) const {
  constexpr unsigned kPinned = kVertexKept | kVertexBorder | kVertexCrease | kVertexOpen | kVertexPinched;
  return ((mesh_.state(u) | mesh_.state(v)) & kPinned) == 0;
}

/// The minimum of the quadric, or the middle of the edge where it is not well determined or far off.
Double3 Decimator::best_position(const Quadric& q, std::uint32_t u, std::uint32_t v) const {
  const Double3 a = mesh_.at(u), b = mesh_.at(v), middle = (a + b) * 0.5, edge = b - a;
  Double3 p{};
  if (!quadric_minimum(q, p) || dot(p - middle, p - middle) > 4.0 * dot(edge, edge)) p = middle;
  return as_stored(p);
}

/// As the file will hold it.
Double3 Decimator::as_stored(const Double3& p) const {
  if (!options_.float_positions) return p;
  const auto round = [](double local, double origin) {
    return static_cast<double>(static_cast<float>(local + origin)) - origin;
  };
  return {round(p[0], origin_[0]), round(p[1], origin_[1]), round(p[2], origin_[2])};
}

/// Tries the collapse of the edge into the minimum: both stars become one fan around it.
bool Decimator::check_optimal(std::uint32_t u, const Star& star, std::size_t at_ring) {
  const std::uint32_t v = star.ring[at_ring];
  if (!may_move(u, v) || !mesh_.gather(v, other_star_)) return false;
  const std::size_t k = star.faces, m = other_star_.faces;
  if (k + m > kMaxRing) return false;
  std::size_t from_v = 0;
  while (other_star_.ring[from_v] != u) ++from_v;
  Quadric both = quadric_[u];
  both += quadric_[v];
  const Double3 p = best_position(both, u, v);
  // The rim: around u from behind v to before v, then around v in the same way.
  LinkLoop& loop = loops_[0];
  loop.clear();
  loop.at[loop.size++] = {0, 0, 0};
  const auto add = [&](const Star& s, std::size_t i, const Double3& centre) {
    const Double3 a = mesh_.at(s.ring[i]), b = mesh_.at(s.ring[i + 1 < s.faces ? i + 1 : 0]);
    const Double3 old_normal = cross(a - centre, b - centre), new_normal = cross(a - p, b - p);
    const double old_area = norm(old_normal), new_area = norm(new_normal);
    if (!(new_area > 0.0) || dot(old_normal, new_normal) < 0.2 * old_area * new_area) return false;
    if (mean_ratio(p, a, b) < options_.min_mean_ratio) return false;
    const std::uint64_t bit = std::uint64_t{1} << loop.size;
    if (mesh_.crease_edge(s.corner[i])) loop.creases |= bit;
    if (mesh_.border_edge(s.corner[i])) loop.borders |= bit;
    if (mesh_.state(s.ring[i]) & (kVertexBorder | kVertexCrease | kVertexFixed)) loop.ends |= bit;
    loop.at[loop.size++] = a - p;
    return true;
  };
  for (std::size_t n = 1; n + 1 < k; ++n)
    if (!add(star, (at_ring + n) % k, mesh_.at(u))) return false;
  for (std::size_t n = 1; n + 1 < m; ++n)
    if (!add(other_star_, (from_v + n) % m, mesh_.at(v))) return false;
  target_ = p;
  if (!(options_.tolerance > 0.0)) {
    new_bound_ = 0.0f;
    return true;
  }
  const auto distance2 = [&](std::uint32_t w) { return dot(mesh_.at(w) - p, mesh_.at(w) - p); };
  const bool near_u = distance2(u) < distance2(v);
  double deviation = 0.0;
  if (min_cosine_ <= -1.0 && edge_deviation(loop, mesh_.at(u) - p, mesh_.at(v) - p, k - 2, deviation)) {
    double bound = 0.0;
    for (const Star* s : {&star, static_cast<const Star*>(&other_star_)})
      for (std::size_t i = 0; i < s->faces; ++i)
        bound = std::fmax(bound, static_cast<double>(mesh_.face(s->corner[i] >> 2).bound));
    new_bound_ = rounded_up(bound + deviation * (1.0 + 1e-12));
    if (static_cast<double>(new_bound_) <= options_.tolerance) {
      if (near_u) reference_vertex_[v] = reference_vertex_[u];
      return true;
    }
  }
  ReferenceDeviation::Query query;
  query.origin = p;
  query.limit = options_.tolerance;
  query.min_cosine = min_cosine_;
  query.free_corners = query.inner_centre = query.cross_creases = true;
  for (const std::uint32_t w : {near_u ? u : v, near_u ? v : u}) {
    query.seed = reference_vertex_[w];
    if (query.seed == kNoCorner) continue;
    ++exact_tests_;
    const ReferenceDeviation::Result result = reference_deviation_.measure(loop, query);
    if (result.answer != ReferenceDeviation::Answer::kWithin) continue;
    ++exact_accepted_;
    new_bound_ = rounded_up(result.deviation);
    reference_vertex_[v] = query.seed;
    return static_cast<double>(new_bound_) <= options_.tolerance;
  }
  return false;
}

/// Puts v where check_optimal() found its place; attributes blend along the edge.
void Decimator::move_vertex(std::uint32_t u, std::uint32_t v) {
  for (std::size_t i = 0; i < other_star_.faces; ++i)
    mesh_.face(other_star_.corner[i] >> 2).bound = new_bound_;
  const Double3 a = mesh_.at(u), edge = mesh_.at(v) - a;
  const double size2 = dot(edge, edge);
  const double t = size2 > 0.0 ? std::clamp(dot(target_ - a, edge) / size2, 0.0, 1.0) : 1.0;
  const std::uint32_t from = mesh_.block_vertex(u), to = mesh_.block_vertex(v);
  mesh_.node(v).at = target_;
  block_.position[to] = target_ + origin_;
  if (options_.float_positions)
    for (double& c : block_.position[to]) c = static_cast<double>(static_cast<float>(c));
  if (!block_.rgba.empty()) {
    std::uint32_t blend = 0;
    for (unsigned shift = 0; shift < 32; shift += 8) {
      const double c = (1.0 - t) * static_cast<double>(block_.rgba[from] >> shift & 255u) +
                       t * static_cast<double>(block_.rgba[to] >> shift & 255u);
      blend |= static_cast<std::uint32_t>(c + 0.5) << shift;
    }
    block_.rgba[to] = blend;
  }
}

}  // namespace tessera
