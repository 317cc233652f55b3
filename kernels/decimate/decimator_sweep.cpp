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
  return options_.sweep && options_.tolerance > 0.0 && !tolerance_.asks_normals() &&
         options_.max_cost_class + 1 == kCostClasses && options_.placement == DecimatePlacement::kEndpoint &&
         options_.priority == DecimatePriority::kQuadric;
}

void Decimator::sweep_all(DecimateReport& report) {
  double limit = kFirstLimit * options_.tolerance * options_.tolerance * costs_.area() /
                 static_cast<double>(mesh_.vertices());
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
  tolerance_.set_coarse();
}

/// \param minimum  per vertex: what its best collapse costs as long as its star is as it is
void Decimator::sweep(double max_cost, std::vector<float>& minimum, DecimateReport& report) {
  CandidateStar s(options_);
  for (std::uint32_t u = 0; u < mesh_.vertices(); ++u) {
    if (minimum[u] == kTouched) {
      minimum[u] = 0.0f;
      continue;
    }
    // Creases are held to half the tolerance, by tests of their own.
    if (static_cast<double>(minimum[u]) >= max_cost || (mesh_.state(u) & (kVertexKept | kVertexCrease)))
      continue;
    if (!costs_.gather(u, s)) continue;
    const StarLanes::Cheapest best = costs_.cheapest(s, static_cast<double>(kRefused));
    minimum[u] = static_cast<float>(best.cost);
    if (!(best.cost < max_cost)) continue;
    ++report.candidates;
    Verdict verdict = check_cheap(s, best.at);
    if (verdict.refusal == CollapseRefusal::kNone && !colours_.allows(u, s.star, best.at))
      verdict.refusal = CollapseRefusal::kColour;
    if (verdict.refusal == CollapseRefusal::kNone) {
      verdict.asked = !trusts(s);
      if (verdict.asked && adds_crossing(s.star, best.at, false))
        verdict.refusal = CollapseRefusal::kCrossing;
    }
    if (verdict.refusal != CollapseRefusal::kNone) {
      minimum[u] = kRefused;
      continue;
    }
    remove(s, best.at, verdict);
    ++report.collapses;
    report.cost_histogram[cost_class(best.cost, kCostClasses)] += s.star.closed ? 2 : 1;
    for (std::size_t i = 0; i < s.star.ring_size(); ++i)
      minimum[s.star.ring[i]] = s.star.ring[i] > u ? kTouched : 0.0f;
  }
}

/// Sweeps move the surface by little: faces hardly come to cross others but where it bends or another sheet lies against it. The
/// first is seen here, which spares most collapses the search, the second in what is left of these faces in the result.
bool Decimator::trusts(const CandidateStar& s) const {
  if (guard_all_) return false;
  if (s.in_lanes && s.lanes.is_surely_flat(static_cast<float>(kTrustedCosine))) return true;
  const Double3& centre = mesh_.at(s.centre);
  Double3 first{};
  double first_square = 0.0;
  for (std::size_t i = 0; i < s.star.faces; ++i) {
    const Double3 n =
        triangle_normal(centre, mesh_.at(s.star.ring[i]), mesh_.at(s.star.ring[s.star.following(i)]));
    if (i == 0) {
      first = n, first_square = dot(n, n);
      continue;
    }
    const double along = dot(first, n);
    if (along <= 0.0 || along * along < kTrustedCosine * kTrustedCosine * first_square * dot(n, n))
      return false;
  }
  return true;
}

/// Legal where the sum of bounds stays far within the tolerance: nothing else is asked.
Decimator::Verdict Decimator::check_cheap(const CandidateStar& s, std::size_t at) {
  if (!is_collapse_ok(mesh_, s.star, at)) return {CollapseRefusal::kLink};
  const auto within = [&](float bound) {
    const bool good = static_cast<double>(bound) <= kMaxBound * options_.tolerance;
    return Verdict{good ? CollapseRefusal::kNone : CollapseRefusal::kTolerance, bound};
  };
  if (s.in_lanes) {
    double deviation = 0.0;
    const StarLanes::Answer answer = s.lanes.judge(at, deviation);
    if (answer == StarLanes::Answer::kRefused) return {CollapseRefusal::kFold};
    if (answer == StarLanes::Answer::kGood)
      return within(rounded_up(max_face_bound(mesh_, s.star) + deviation));
  }
  const CollapseRefusal faces = check_new_faces(mesh_, s.centre, s.star, at, options_.min_mean_ratio);
  if (faces != CollapseRefusal::kNone) return {faces};
  const auto sum = bound_by_sum(mesh_, s.centre, s.star, at, sides_);
  return sum ? within(sum->bound) : Verdict{CollapseRefusal::kFold};
}

void Decimator::compact(std::vector<float>& minimum) {
  std::vector<std::uint32_t> kept;
  mesh_.compact(kept);
  for (std::size_t i = 0; i < kept.size(); ++i) minimum[i] = minimum[kept[i]];
  minimum.resize(kept.size());
  costs_.compact(kept);
  colours_.compact(kept);
  tolerance_.compact(kept);
  if (!options_.allow_crossings) guard_.renew(FaceBoxes::Order::kGiven);
}

}  // namespace tessera
