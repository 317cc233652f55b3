// Decimator: cheap collapses in the order of places, before the queue.
#include <algorithm>
#include <cmath>

#include "kernels/decimate/decimator.h"
#include "octree/rounding.h"

namespace tessera {
namespace {

constexpr int kSweeps = 6;
/// Limits of the cost, in tolerance^2 x the mean area of a vertex; the last is 8.
constexpr double kFirstLimit = 0x1p-12, kLimitGrowth = 8.0;
constexpr double kMaxBound = 0.25;  ///< of the tolerance
/// A coarse reference saves nothing with more than a half of the vertices.
constexpr std::size_t kMinGain = 2;
/// A star whose faces turn by less from its first one is nearly flat.
constexpr double kTrustedCosine = 0.7;
constexpr float kTouched = -1.0f, kRefused = 0x1p+100f;

}  // namespace

/// In a first pass, where nothing has moved yet; not where every collapse must be asked of the reference, nor where
/// classes of cost are counted or limited.
bool Decimator::sweeps() const {
  for (const CollapseFace& f : mesh_.faces())
    if (f.bound > 0.0f) return false;
  return options_.sweep && options_.tolerance > 0.0 && min_cosine_ <= -1.0 &&
         options_.max_cost_class + 1 == kCostClasses && options_.placement == DecimatePlacement::kEndpoint &&
         options_.priority == DecimatePriority::kQuadric;
}

void Decimator::sweep_all(DecimateReport& report) {
  double limit =
      kFirstLimit * options_.tolerance * options_.tolerance * area_ / static_cast<double>(mesh_.vertices());
  const std::size_t before = mesh_.vertices();
  std::vector<float> minimum(mesh_.vertices(), 0.0f);
  std::size_t removed = report.collapses;
  for (int i = 0; i < kSweeps; ++i, limit *= kLimitGrowth) {
    sweep(limit, minimum, report);
    if (i + 1 < kSweeps && 2 * (report.collapses - removed) < mesh_.vertices()) continue;
    compact(minimum);
    removed = report.collapses;
  }
  if (mesh_.vertices() * kMinGain > before) return;
  coarse_deviation_ = ReferenceDeviation(mesh_);
  coarse_witness_.assign(mesh_.vertices(), kNoCorner);
}

/// \param minimum  per vertex: what its best collapse costs as long as its star is as it is
void Decimator::sweep(double max_cost, std::vector<float>& minimum, DecimateReport& report) {
  Star star;
  for (std::uint32_t u = 0; u < mesh_.vertices(); ++u) {
    if (minimum[u] == kTouched) {
      minimum[u] = 0.0f;
      continue;
    }
    // Creases are held to half the tolerance, by tests of their own.
    if (static_cast<double>(minimum[u]) >= max_cost || (mesh_.state(u) & (kVertexKept | kVertexCrease)))
      continue;
    if (!gather(u, star)) continue;
    const StarLanes::Cheapest best = find_cheapest(u, star);
    minimum[u] = static_cast<float>(best.cost);
    if (!(best.cost < max_cost)) continue;
    ++report.candidates;
    if (!check_cheap(u, star, best.at) || (!trusts(u, star) && adds_crossing(star, best.at))) {
      minimum[u] = kRefused;
      continue;
    }
    remove(u, star, best.at);
    ++report.collapses;
    report.cost_histogram[cost_class(best.cost, kCostClasses)] += star.closed ? 2 : 1;
    for (std::size_t i = 0; i < star.ring_size(); ++i)
      minimum[star.ring[i]] = star.ring[i] > u ? kTouched : 0.0f;
  }
}

/// Sweeps move the surface by little: faces hardly come to cross others but where it bends or another sheet lies against it. The
/// first is seen here, which spares most collapses the search, the second in the result.
bool Decimator::trusts(std::uint32_t u, const Star& star) {
  if (guard_all_) return false;
  const Double3& centre = mesh_.at(u);
  Double3 first{};
  double first_square = 0.0;
  for (std::size_t i = 0; i < star.faces; ++i) {
    const std::size_t j = i + 1 < star.ring_size() ? i + 1 : 0;
    const Double3 n = cross(mesh_.at(star.ring[i]) - centre, mesh_.at(star.ring[j]) - centre);
    if (i == 0) {
      first = n, first_square = dot(n, n);
      continue;
    }
    const double along = dot(first, n);
    if (along <= 0.0 || along * along < kTrustedCosine * kTrustedCosine * first_square * dot(n, n))
      return false;
  }
  trusted_ = true;
  return true;
}

/// The cheapest collapse that lines allow; one of kRefused where there is none.
StarLanes::Cheapest Decimator::find_cheapest(std::uint32_t u, const Star& star) {
  if (in_lanes_) {
    const StarLanes::Cheapest best = lanes_.cheapest(quadric_[u], mesh_.at(u));
    if (follows_lines(mesh_, u, star, best.at)) return best;
  }
  StarLanes::Cheapest best{static_cast<double>(kRefused), 0};
  const Quadric q = quadric_[u];
  const Double3 from = mesh_.at(u);
  for (std::size_t i = 0; i < star.ring_size(); ++i) {
    if (!follows_lines(mesh_, u, star, i)) continue;
    const double c = plain_ ? plain_cost(q, from, star.ring[i]) : cost(u, q, star, i);
    if (c < best.cost) best = {c, i};
  }
  return best;
}

bool Decimator::check_cheap(std::uint32_t u, const Star& star, std::size_t at_ring) {
  moves_ = false;
  if (!is_collapse_ok(mesh_, star, at_ring)) return false;
  const double maximum = kMaxBound * options_.tolerance;
  if (in_lanes_) {
    double deviation = 0.0;
    const StarLanes::Answer answer = lanes_.judge(at_ring, deviation);
    if (answer == StarLanes::Answer::kRefused) return false;
    if (answer == StarLanes::Answer::kGood) {
      new_bound_ = rounded_up(largest_bound(star) + deviation);
      return static_cast<double>(new_bound_) <= maximum;
    }
  }
  return check_new_faces(mesh_, u, star, at_ring, options_.min_mean_ratio) == Refusal::kNone &&
         bound_by_sum(u, star, at_ring) && static_cast<double>(new_bound_) <= maximum;
}

void Decimator::compact(std::vector<float>& minimum) {
  std::vector<std::uint32_t> kept;
  mesh_.compact(kept);
  for (std::size_t i = 0; i < kept.size(); ++i) {
    quadric_[i] = quadric_[kept[i]];
    minimum[i] = minimum[kept[i]];
    reference_vertex_[i] = reference_vertex_[kept[i]];
  }
  if (!options_.allow_crossings) guard_.build(FaceBoxes::Order::kGiven);
  quadric_.resize(kept.size()), minimum.resize(kept.size()), reference_vertex_.resize(kept.size());
}

}  // namespace tessera
