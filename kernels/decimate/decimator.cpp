#include "kernels/decimate/decimator.h"

#include <algorithm>
#include <cmath>

#include "octree/rounding.h"

namespace tessera {
namespace {

constexpr std::uint32_t kPartVertices = 4096;  ///< with their faces about what a second-level cache holds

}  // namespace

Decimator::Decimator(CollapseMesh& mesh, const CollapseMesh& reference,
                     std::vector<std::uint32_t> reference_vertex, const DecimateOptions& options,
                     MeshBlock& block, const Double3& origin, bool guard_all)
    : mesh_(mesh),
      block_(block),
      origin_(origin),
      options_(options),
      plain_((options.priority == DecimatePriority::kQuadric ||
              options.priority == DecimatePriority::kProbabilistic) &&
             options.placement == DecimatePlacement::kEndpoint && !(options.colour_weight > 0.0)),
      quadric_(mesh.vertices()),
      lanes_(options.tolerance > 0.0 ? options.tolerance : 1.0, options.min_mean_ratio),
      reference_vertex_(std::move(reference_vertex)),
      guard_(mesh),
      guard_all_(guard_all) {
  if (options.tolerance > 0.0)
    reference_deviation_ = ReferenceDeviation(reference, options.max_normal_deviation_deg > 0.0);
  if (options.priority == DecimatePriority::kNormalDeviation) normal_sum_.resize(mesh.vertices());
  if (options.max_normal_deviation_deg > 0.0)
    min_cosine_ = cosine_of_degrees(options.max_normal_deviation_deg);
  accumulate_quadrics();
  if (!options.allow_crossings) guard_.build(FaceBoxes::Order::kGiven);
}

/// The star, in lanes too where costs and tests are those that these have.
bool Decimator::gather(std::uint32_t u, Star& star) {
  if (!mesh_.gather(u, star)) return false;
  in_lanes_ = plain_ && lanes_.load(mesh_, u, star);
  return true;
}

Decimator::Refusal Decimator::check(std::uint32_t u, const Star& star, std::size_t at_ring) {
  const Refusal refusal = check_star(u, star, at_ring);
  if (refusal != Refusal::kNone) return refusal;
  return adds_crossing(star, at_ring) ? Refusal::kCrossing : Refusal::kNone;
}

/// All that the star, its neighbours and the reference tell.
Decimator::Refusal Decimator::check_star(std::uint32_t u, const Star& star, std::size_t at_ring) {
  moves_ = false;
  if (!is_collapse_ok(mesh_, star, at_ring)) return Refusal::kLink;
  if (in_lanes_ && options_.tolerance > 0.0 && min_cosine_ <= -1.0 && (mesh_.state(u) & kVertexCrease) == 0) {
    double deviation = 0.0;
    const StarLanes::Answer answer = lanes_.judge(at_ring, deviation);
    if (answer == StarLanes::Answer::kRefused) return Refusal::kFold;
    if (answer == StarLanes::Answer::kGood) {
      new_bound_ = rounded_up(largest_bound(star) + deviation);
      if (static_cast<double>(new_bound_) <= options_.tolerance) return Refusal::kNone;
      lay_link(star, at_ring);
      return query_reference(u, star, at_ring, false, 0.0);
    }
  }
  if (options_.placement == DecimatePlacement::kOptimal && check_optimal(u, star, at_ring)) {
    moves_ = true;
    return Refusal::kNone;
  }
  const Refusal faces = check_new_faces(mesh_, u, star, at_ring, options_.min_mean_ratio);
  if (faces != Refusal::kNone) return faces;
  return check_deviation(u, star, at_ring);
}

/// The collapse that was found legal, with its new bound.
void Decimator::remove(std::uint32_t u, const Star& star, std::size_t at_ring) {
  const std::uint32_t v = star.ring[at_ring];
  for (std::size_t i = 0; i < star.faces; ++i) {
    mesh_.face(star.corner[i] >> 2).bound = new_bound_;
    mesh_.unsettle(star.corner[i] >> 2);
  }
  // What an ear stood for now hangs on the edge that it leaves.
  if (!star.closed && star.faces == 1) {
    CollapseFace& outer = mesh_.face(mesh_.opposite(star.corner[0]) >> 2);
    outer.bound = std::fmax(outer.bound, new_bound_);
  }
  quadric_[v] += quadric_[u];
  if (!normal_sum_.empty()) normal_sum_[v] += normal_sum_[u];
  if (moves_) move_vertex(u, v);
  update_error(v);
  mesh_.collapse(star, at_ring);
  if (options_.allow_crossings) return;
  if (moves_)
    guard_.accept();
  else
    guard_.accept(star);
}

void Decimator::commit(std::uint32_t u, const Star& star, std::size_t at_ring, std::uint32_t now) {
  remove(u, star, at_ring);
  // Whoever was refused near here gets another chance; those in the queue are looked at anyway.
  const auto wake = [&](std::uint32_t w) {
    tried_[w] = 0;
    if (mesh_.state(w) & kVertexKept) return;
    if (w < first_)
      woken_[w] = 1;
    else if (w < end_ && !queue_.contains(w))
      queue_.push(w, now);
  };
  wake(star.ring[at_ring]);
  mesh_.for_each_neighbour(star.ring[at_ring], wake);
}

/// \param woken  only those in woken_
void Decimator::seed_queue(bool woken) {
  std::array<Candidate, kMaxRing + 1> list;
  Star star;
  for (std::uint32_t u = first_; u < end_; ++u) {
    if ((woken && !woken_[u]) || (mesh_.state(u) & kVertexKept)) continue;
    if (!gather(u, star)) continue;
    bool done = true;
    for (std::size_t i = 0; i < star.faces; ++i) done = done && mesh_.done(star.corner[i] >> 2);
    if (done) continue;
    if (const std::size_t n = list_candidates(u, star, list); n > 0)
      queue_.push(u, cost_class(next_candidate(list, 0, n).cost, kCostClasses));
  }
}

/// All that is left has been tried. At locked corners another block may do more. What is a crease after a first pass is
/// asked anew of the mesh as that left it; later passes change too little for that.
void Decimator::mark_done_faces(bool later) {
  const unsigned open = later ? kVertexLocked : kVertexLocked | kVertexFixed | kVertexCrease;
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
    const std::uint32_t* v = mesh_.face(f).vertex;
    if (((mesh_.state(v[0]) | mesh_.state(v[1]) | mesh_.state(v[2])) & open) == 0) mesh_.mark_done(f);
  }
}

void Decimator::run(DecimateReport& report) {
  const bool later = std::any_of(mesh_.faces().begin(), mesh_.faces().end(),
                                 [](const CollapseFace& f) { return (f.state & kStateDone) != 0; });
  const bool swept = sweeps();
  if (swept) sweep_all(report);
  const auto n = static_cast<std::uint32_t>(mesh_.vertices());
  tried_.assign(n, 0);
  if (options_.tolerance > 0.0) witness_.assign(n, kNoCorner);
  queue_ = CostQueue<kCostClasses>(n);
  const bool parts = swept && n > kPartVertices;
  if (parts) woken_.assign(n, 0);
  for (; parts && first_ < n; first_ = end_) {
    end_ = std::min(n, first_ + kPartVertices);
    seed_queue(false);
    empty_queue(report);
  }
  first_ = 0, end_ = n;
  seed_queue(parts);
  empty_queue(report);
  if (report.stop == DecimateStop::kNoLegalCollapse) mark_done_faces(later);
  report.exact_tests = exact_tests_;
  report.exact_accepted = exact_accepted_;
  report.reference_faces_walked = reference_deviation_.walked();
}

/// Collapses until no candidate of the vertices first_ to end_ is left.
void Decimator::empty_queue(DecimateReport& report) {
  std::array<Candidate, kMaxRing + 1> list;
  Star star;
  std::uint32_t u = 0, now = 0;
  while (queue_.pop(u, now)) {
    if (now > options_.max_cost_class) {
      report.stop = DecimateStop::kCostLimit;
      break;
    }
    if ((mesh_.state(u) & kVertexDead) || !gather(u, star)) continue;
    const std::size_t n = list_candidates(u, star, list);
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint32_t cls = cost_class(next_candidate(list, i, n).cost, kCostClasses);
      if (cls < tried_[u]) continue;
      if (cls > now) {
        tried_[u] = static_cast<std::uint16_t>(cls);
        queue_.push(u, cls);
        break;
      }
      ++report.candidates;
      const Refusal refusal = check(u, star, list[i].at);
      if (refusal == Refusal::kNone) {
        commit(u, star, list[i].at, now);
        ++report.collapses;
        const bool closed = star.closed;
        report.cost_histogram[now] += closed ? 2 : 1;
        break;
      }
      report.by_link += refusal == Refusal::kLink;
      report.by_fold += refusal == Refusal::kFold;
      report.by_shape += refusal == Refusal::kShape;
      report.by_normal += refusal == Refusal::kNormal;
      report.by_tolerance += refusal == Refusal::kTolerance;
      report.by_crossing += refusal == Refusal::kCrossing;
    }
  }
}

}  // namespace tessera
