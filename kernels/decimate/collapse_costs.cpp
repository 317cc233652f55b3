#include "kernels/decimate/collapse_costs.h"

#include <cmath>
#include <utility>

#include "kernels/decimate/collapse_legality.h"
#include "kernels/mesh/mean_ratio.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// A cost that no candidate reaches: the collapse folds.
constexpr double kNoCost = 0x1p+900;

bool has_plain_costs(const DecimateOptions& o) {
  return (o.priority == DecimatePriority::kQuadric || o.priority == DecimatePriority::kProbabilistic) &&
         o.placement == DecimatePlacement::kEndpoint && !(o.colour_weight > 0.0);
}

}  // namespace

const CollapseCandidate& CandidateList::next(std::size_t i) {
  std::size_t minimum = i;
  for (std::size_t j = i + 1; j < size; ++j)
    if (item[j].cost < item[minimum].cost ||
        (item[j].cost == item[minimum].cost && item[j].vertex < item[minimum].vertex))
      minimum = j;
  std::swap(item[i], item[minimum]);
  return item[i];
}

CollapseCosts::CollapseCosts(CollapseMesh& mesh, const MeshBlock& block, const Double3& origin,
                             const DecimateOptions& options)
    : mesh_(mesh),
      block_(block),
      origin_(origin),
      options_(options),
      plain_(has_plain_costs(options)),
      quadric_(mesh.vertices()) {
  if (options.priority == DecimatePriority::kNormalDeviation) normal_sum_.resize(mesh.vertices());
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) add_face(f);
  for (std::uint32_t v = 0; v < mesh_.vertices(); ++v) update_error(v);
}

/// The quadric of the face's plane, a third of the area to each corner.
void CollapseCosts::add_face(std::uint32_t f) {
  const std::uint32_t* v = mesh_.face(f).vertex;
  const Double3 p[3] = {mesh_.at(v[0]), mesh_.at(v[1]), mesh_.at(v[2])};
  const Double3 normal = triangle_normal(p[0], p[1], p[2]);
  const double twice_area = norm(normal);
  if (!(twice_area > 0.0)) return;
  area_ += 0.5 * twice_area;
  const Double3 n = normal * (1.0 / twice_area);
  const double weight = twice_area / 6.0;
  const double noise = options_.noise > 0.0 ? options_.noise : options_.tolerance / 8.0;
  const Quadric q =
      options_.priority == DecimatePriority::kProbabilistic
          ? uncertain_plane_quadric(n, p[0], weight, noise * noise, noise * noise / (0.5 * twice_area))
          : plane_quadric(n, p[0], weight);
  for (std::size_t i = 0; i < 3; ++i) {
    quadric_[v[i]] += q;
    if (!normal_sum_.empty()) normal_sum_[v[i]] += {n * weight, weight};
  }
  if ((mesh_.face(f).state & (7u * kStateBorder | 7u * kStateCrease)) != 0) add_walls(f, p, n);
}

/// Borders and creases hold their line: a plane through the edge, at right angles to the face with the normal n.
void CollapseCosts::add_walls(std::uint32_t f, const Double3* p, const Double3& n) {
  for (std::uint32_t i = 0; i < 3; ++i) {
    const std::uint32_t c = 4 * f + i;
    if (!mesh_.border_edge(c) && !mesh_.crease_edge(c)) continue;
    const std::uint32_t a = (i + 1) % 3, b = (i + 2) % 3;
    const Double3 edge = p[b] - p[a], across = cross(edge, n);
    const double length2 = dot(edge, edge);
    if (!(length2 > 0.0)) continue;
    const Quadric wall = plane_quadric(across * (1.0 / norm(across)), p[a], length2);
    quadric_[mesh_.face(f).vertex[a]] += wall;
    quadric_[mesh_.face(f).vertex[b]] += wall;
  }
}

void CollapseCosts::update_error(std::uint32_t v) {
  CollapseVertex& node = mesh_.node(v);
  node.error = std::fmax(0.0, quadric_[v](node.at[0], node.at[1], node.at[2]));
}

void CollapseCosts::merge(std::uint32_t u, std::uint32_t v) {
  quadric_[v] += quadric_[u];
  if (!normal_sum_.empty()) normal_sum_[v] += normal_sum_[u];
  update_error(v);
}

void CollapseCosts::compact(const std::vector<std::uint32_t>& kept) {
  for (std::size_t i = 0; i < kept.size(); ++i) quadric_[i] = quadric_[kept[i]];
  quadric_.resize(kept.size());
}

bool CollapseCosts::gather(std::uint32_t u, CandidateStar& s) const {
  if (!mesh_.gather(u, s.star)) return false;
  s.centre = u;
  s.in_lanes = plain_ && s.lanes.load(mesh_, u, s.star);
  return true;
}

void CollapseCosts::list(const CandidateStar& s, CandidateList& list) {
  const Quadric q = quadric_[s.centre];
  const Double3 from = mesh_.at(s.centre);
  std::array<double, 8> costs;
  if (s.in_lanes) s.lanes.costs(q, from, costs);
  list.size = 0;
  for (std::size_t i = 0; i < s.star.ring_size(); ++i) {
    if (!follows_lines(mesh_, s.centre, s.star, i)) continue;
    const double c = s.in_lanes ? costs[i] : cost(s, q, from, i);
    if (c < kNoCost) list.item[list.size++] = {c, s.star.ring[i], static_cast<std::uint32_t>(i)};
  }
}

StarLanes::Cheapest CollapseCosts::cheapest(const CandidateStar& s, double none) {
  const Quadric q = quadric_[s.centre];
  const Double3 from = mesh_.at(s.centre);
  if (s.in_lanes) {
    const StarLanes::Cheapest best = s.lanes.cheapest(q, from);
    if (follows_lines(mesh_, s.centre, s.star, best.at)) return best;
  }
  StarLanes::Cheapest best{none, 0};
  for (std::size_t i = 0; i < s.star.ring_size(); ++i) {
    if (!follows_lines(mesh_, s.centre, s.star, i)) continue;
    const double c = cost(s, q, from, i);
    if (c < best.cost) best = {c, i};
  }
  return best;
}

/// \param q  quadric of the centre, which lies at `from`
double CollapseCosts::cost(const CandidateStar& s, const Quadric& q, const Double3& from, std::size_t at) {
  const CollapseVertex& to = mesh_.node(s.star.ring[at]);
  const double squared_edge = squared_distance(to.at, from);
  if (plain_) return endpoint_cost(q, to) + tie_cost(squared_edge);
  double cost = priority_cost(s, q, squared_edge, at) + tie_cost(squared_edge);
  if (!(options_.colour_weight > 0.0) || cost >= kNoCost) return cost;
  const auto sum = bound_by_sum(mesh_, s.centre, s.star, at, sides_);
  return sum ? cost + attribute_cost(s.centre, sum->foot) : kNoCost;
}

double CollapseCosts::priority_cost(const CandidateStar& s, const Quadric& q, double squared_edge,
                                    std::size_t at) {
  const std::uint32_t v = s.star.ring[at];
  switch (options_.priority) {
    case DecimatePriority::kQuadric:
    case DecimatePriority::kProbabilistic:
      return options_.placement == DecimatePlacement::kOptimal && may_move(s.centre, v)
                 ? moved_cost(s.centre, v)
                 : endpoint_cost(q, mesh_.node(v));
    case DecimatePriority::kSampleDistance: {
      const auto sum = bound_by_sum(mesh_, s.centre, s.star, at, sides_);
      return sum ? static_cast<double>(sum->bound) * static_cast<double>(sum->bound) : kNoCost;
    }
    case DecimatePriority::kNormalDeviation:
      return normal_cost(s.centre, s.star, at);
    case DecimatePriority::kMeanRatio:
      return worst_shape(s.star, at) * squared_edge;
    case DecimatePriority::kEdgeLength:
      return squared_edge;
  }
  return kNoCost;
}

double CollapseCosts::moved_cost(std::uint32_t u, std::uint32_t v) const {
  Quadric both = quadric_[u];
  both += quadric_[v];
  const Double3 p = best_position(u, v);
  return std::fmax(0.0, both(p[0], p[1], p[2]));
}

bool CollapseCosts::may_move(std::uint32_t u, std::uint32_t v) const {
  constexpr unsigned kPinned = kVertexKept | kVertexBorder | kVertexCrease | kVertexOpen | kVertexPinched;
  return ((mesh_.state(u) | mesh_.state(v)) & kPinned) == 0;
}

Double3 CollapseCosts::best_position(std::uint32_t u, std::uint32_t v) const {
  Quadric both = quadric_[u];
  both += quadric_[v];
  const Double3 a = mesh_.at(u), b = mesh_.at(v), middle = (a + b) * 0.5;
  Double3 p{};
  if (!quadric_minimum(both, p) || squared_distance(p, middle) > 4.0 * squared_distance(b, a)) p = middle;
  if (options_.float_positions)
    for (std::size_t k = 0; k < 3; ++k)
      p[k] = static_cast<double>(static_cast<float>(p[k] + origin_[k])) - origin_[k];
  return p;
}

/// L2 deviation of the new normals from those of all original faces that the two vertices stand for: the sum of
/// area |n - m|^2 over original normals m, for each new face by its share. (Cohen-Steiner, Alliez, Desbrun 2004.)
double CollapseCosts::normal_cost(std::uint32_t u, const Star& star, std::size_t at) const {
  const Double3 pv = mesh_.at(star.ring[at]);
  NormalSum sum = normal_sum_[u];
  sum += normal_sum_[star.ring[at]];
  double area = 0.0, along = 0.0;
  for (std::size_t i = 0; i < star.faces; ++i) {
    const std::size_t j = star.following(i);
    if (i == at || j == at) continue;
    const Double3 normal = triangle_normal(pv, mesh_.at(star.ring[i]), mesh_.at(star.ring[j]));
    area += norm(normal);
    along += dot(normal, sum.normal);
  }
  return area > 0.0 ? std::fmax(0.0, 2.0 * (sum.area - along / area)) : 0.0;
}

/// 1 - the smallest mean ratio of the new faces.
double CollapseCosts::worst_shape(const Star& star, std::size_t at) const {
  return 1.0 - min_mean_ratio_around(mesh_, star, mesh_.at(star.ring[at]), at);
}

/// What is lost of the attributes of u: their difference to what the new faces interpolate in its place, squared, as
/// the lengths that they are worth, by the area of u.
double CollapseCosts::attribute_cost(std::uint32_t u, const CollapseFoot& foot) const {
  if (block_.rgba.empty()) return 0.0;
  const std::uint32_t corner[3] = {foot.a, foot.b, foot.c};
  const double weight[3] = {foot.wa, foot.wb, 1.0 - foot.wa - foot.wb};
  const auto channel = [&](std::uint32_t v, unsigned shift) {
    return static_cast<double>(block_.rgba[mesh_.block_vertex(v)] >> shift & 255u);
  };
  double square = 0.0;
  for (unsigned shift = 0; shift < 24; shift += 8) {
    double difference = channel(u, shift);
    for (std::size_t i = 0; i < 3; ++i) difference -= weight[i] * channel(corner[i], shift);
    difference *= options_.colour_weight / 255.0;
    square += difference * difference;
  }
  // The trace of a sum of plane quadrics is the area that they stand for.
  const Quadric& q = quadric_[u];
  return square * (q.xx + q.yy + q.zz);
}

}  // namespace tessera
