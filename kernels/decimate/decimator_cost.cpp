// The continuous part of Decimator: what a collapse costs.
#include <cmath>

#include "kernels/decimate/decimator.h"
#include "kernels/mesh/mean_ratio.h"

namespace tessera {

void Decimator::accumulate_quadrics() {
  const bool uncertain = options_.priority == DecimatePriority::kProbabilistic;
  const double noise = options_.noise > 0.0 ? options_.noise : options_.tolerance / 8.0;
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
    const std::uint32_t* v = mesh_.face(f).vertex;
    const Double3 p[3] = {mesh_.at(v[0]), mesh_.at(v[1]), mesh_.at(v[2])};
    const Double3 normal = cross(p[1] - p[0], p[2] - p[0]);
    const double twice_area = norm(normal);
    if (!(twice_area > 0.0)) continue;
    area_ += 0.5 * twice_area;
    const Double3 n = normal * (1.0 / twice_area);
    // A third of the area each.
    const double weight = twice_area / 6.0;
    const Quadric q = uncertain ? uncertain_plane_quadric(n, p[0], weight, noise * noise,
                                                          noise * noise / (0.5 * twice_area))
                                : plane_quadric(n, p[0], weight);
    for (std::size_t i = 0; i < 3; ++i) {
      quadric_[v[i]] += q;
      if (!normal_sum_.empty()) normal_sum_[v[i]] += {n * weight, weight};
    }
    // Borders and creases hold their line: a plane through the edge, at right angles to the face.
    if ((mesh_.face(f).state & (7u * kStateBorder | 7u * kStateCrease)) == 0) continue;
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t c = 4 * f + i;
      if (!mesh_.border_edge(c) && !mesh_.crease_edge(c)) continue;
      const std::uint32_t a = (i + 1) % 3, b = (i + 2) % 3;
      const Double3 edge = p[b] - p[a], across = cross(edge, n);
      const double size2 = dot(edge, edge);
      if (!(size2 > 0.0)) continue;
      const Quadric wall = plane_quadric(across * (1.0 / norm(across)), p[a], size2);
      quadric_[v[a]] += wall;
      quadric_[v[b]] += wall;
    }
  }
  for (std::uint32_t v = 0; v < mesh_.vertices(); ++v) update_error(v);
}

void Decimator::update_error(std::uint32_t v) {
  CollapseVertex& node = mesh_.node(v);
  node.error = std::fmax(0.0, quadric_[v](node.at[0], node.at[1], node.at[2]));
}

/// A cost that no candidate reaches: the collapse folds.
constexpr double kNoCost = 0x1p+900;

double Decimator::cost(std::uint32_t u, const Quadric& q, const Star& star, std::size_t at_ring) {
  const std::uint32_t v = star.ring[at_ring];
  const CollapseVertex& to = mesh_.node(v);
  const Double3 edge = to.at - mesh_.at(u);
  const double edge2 = dot(edge, edge);
  double cost = 0.0;
  switch (options_.priority) {
    case DecimatePriority::kQuadric:
    case DecimatePriority::kProbabilistic:
      if (options_.placement == DecimatePlacement::kOptimal && may_move(u, v)) {
        Quadric both = q;
        both += quadric_[v];
        const Double3 p = best_position(both, u, v);
        cost = std::fmax(0.0, both(p[0], p[1], p[2]));
      } else {
        cost = endpoint_cost(q, to);
      }
      break;
    case DecimatePriority::kSampleDistance: {
      if (!bound_by_sum(u, star, at_ring)) return kNoCost;
      const double bound = static_cast<double>(new_bound_);
      cost = bound * bound;
      break;
    }
    case DecimatePriority::kNormalDeviation:
      cost = normal_cost(u, star, at_ring);
      break;
    case DecimatePriority::kMeanRatio:
      cost = worst_shape(star, at_ring) * edge2;
      break;
    case DecimatePriority::kEdgeLength:
      cost = edge2;
      break;
  }
  cost += tie_cost(edge2);
  if (options_.colour_weight > 0.0) {
    if (!bound_by_sum(u, star, at_ring)) return kNoCost;
    cost += attribute_cost(u);
  }
  return cost;
}

/// L2 deviation of the new normals from those of all original faces that the two vertices stand for: the sum of
/// area |n - m|^2 over original normals m, for each new face by its share. (Cohen-Steiner, Alliez, Desbrun 2004.)
double Decimator::normal_cost(std::uint32_t u, const Star& star, std::size_t at_ring) const {
  const std::size_t k = star.faces, size = star.ring_size();
  const Double3 pv = mesh_.at(star.ring[at_ring]);
  NormalSum sum = normal_sum_[u];
  sum += normal_sum_[star.ring[at_ring]];
  double area = 0.0, along = 0.0;
  for (std::size_t i = 0; i < k; ++i) {
    const std::size_t j = i + 1 < size ? i + 1 : 0;
    if (i == at_ring || j == at_ring) continue;
    const Double3 normal = cross(mesh_.at(star.ring[i]) - pv, mesh_.at(star.ring[j]) - pv);
    area += norm(normal);
    along += dot(normal, sum.normal);
  }
  return area > 0.0 ? std::fmax(0.0, 2.0 * (sum.area - along / area)) : 0.0;
}

/// 1 - the smallest roundness of the new faces.
double Decimator::worst_shape(const Star& star, std::size_t at_ring) const {
  const std::size_t k = star.faces, size = star.ring_size();
  const Double3 pv = mesh_.at(star.ring[at_ring]);
  double worst = 1.0;
  for (std::size_t i = 0; i < k; ++i) {
    const std::size_t j = i + 1 < size ? i + 1 : 0;
    if (i != at_ring && j != at_ring)
      worst = std::fmin(worst, mean_ratio(pv, mesh_.at(star.ring[i]), mesh_.at(star.ring[j])));
  }
  return 1.0 - worst;
}

/// What is lost of the attributes of u: their difference to what the new faces interpolate in its place, squared, as
/// the lengths that they are worth, by the area of u. \pre bound_by_sum() has found the place
double Decimator::attribute_cost(std::uint32_t u) const {
  const std::uint32_t corner[3] = {foot_.a, foot_.b, foot_.c};
  const double weight[3] = {foot_.wa, foot_.wb, 1.0 - foot_.wa - foot_.wb};
  double square = 0.0;
  if (!block_.rgba.empty()) {
    for (unsigned shift = 0; shift < 24; shift += 8) {
      double difference = static_cast<double>(block_.rgba[mesh_.block_vertex(u)] >> shift & 255u);
      for (std::size_t i = 0; i < 3; ++i)
        difference -=
            weight[i] * static_cast<double>(block_.rgba[mesh_.block_vertex(corner[i])] >> shift & 255u);
      difference *= options_.colour_weight / 255.0;
      square += difference * difference;
    }
  }
  // The trace of a sum of plane quadrics is the area that they stand for.
  const Quadric& q = quadric_[u];
  return square * (q.xx + q.yy + q.zz);
}

/// In no order: next_candidate() finds the one that is due, and few get their turn.
std::size_t Decimator::list_candidates(std::uint32_t u, const Star& star,
                                       std::array<Candidate, kMaxRing + 1>& list) {
  std::size_t n = 0;
  const Quadric q = quadric_[u];
  const Double3 from = mesh_.at(u);
  if (in_lanes_) {
    std::array<double, 8> costs;
    lanes_.costs(q, from, costs);
    for (std::size_t i = 0; i < star.ring_size(); ++i)
      if (follows_lines(mesh_, u, star, i))
        list[n++] = {costs[i], star.ring[i], static_cast<std::uint32_t>(i)};
    return n;
  }
  for (std::size_t i = 0; i < star.ring_size(); ++i) {
    if (!follows_lines(mesh_, u, star, i)) continue;
    const double c = plain_ ? plain_cost(q, from, star.ring[i]) : cost(u, q, star, i);
    if (c < kNoCost) list[n++] = {c, star.ring[i], static_cast<std::uint32_t>(i)};
  }
  return n;
}

}  // namespace tessera
