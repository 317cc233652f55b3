#include "kernels/decimate/decimator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "octree/rounding.h"

namespace tessera {
namespace {

constexpr std::uint32_t kPartVertices = 4096;  ///< with their faces about what a second-level cache holds

void count_refusal(CollapseRefusal refusal, DecimateReport& report) {
  report.by_link += refusal == CollapseRefusal::kLink;
  report.by_fold += refusal == CollapseRefusal::kFold;
  report.by_shape += refusal == CollapseRefusal::kShape;
  report.by_normal += refusal == CollapseRefusal::kNormal;
  report.by_colour += refusal == CollapseRefusal::kColour;
  report.by_tolerance += refusal == CollapseRefusal::kTolerance;
  report.by_crossing += refusal == CollapseRefusal::kCrossing;
}

/// Where p lies along the edge from a to b: 0 to 1.
double share_along(const Double3& a, const Double3& b, const Double3& p) {
  const Double3 edge = b - a;
  const double length2 = dot(edge, edge);
  return length2 > 0.0 ? std::clamp(dot(p - a, edge) / length2, 0.0, 1.0) : 1.0;
}

}  // namespace

Decimator::Decimator(CollapseMesh& mesh, const CollapseMesh& reference,
                     std::vector<std::uint32_t> reference_vertex, const DecimateOptions& options,
                     MeshBlock& block, const Double3& origin, bool guard_all)
    : mesh_(mesh),
      block_(block),
      origin_(origin),
      options_(options),
      costs_(mesh, block, origin, options),
      tolerance_(mesh, reference, std::move(reference_vertex), options),
      colours_(mesh, block, options.colour_tolerance),
      guard_(mesh),
      guard_all_(guard_all) {
  if (!options.allow_crossings) guard_.renew(FaceBoxes::Order::kGiven);
}

void Decimator::run(DecimateReport& report) {
  const bool later = std::any_of(mesh_.faces().begin(), mesh_.faces().end(),
                                 [](const CollapseFace& f) { return (f.state & kStateDone) != 0; });
  const bool swept = sweeps();
  if (swept) sweep_all(report);
  guard_.use_sheets();  // sweeps ask where the surface bends alone
  const auto n = static_cast<std::uint32_t>(mesh_.vertices());
  tried_.assign(n, 0);
  tolerance_.keep_witnesses();
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
  tolerance_.report(report);
  report.kept_for_colour = colours_.kept();
}

/// \param woken  only those in woken_
void Decimator::seed_queue(bool woken) {
  CandidateList list;
  CandidateStar s(options_);
  for (std::uint32_t u = first_; u < end_; ++u) {
    if ((woken && !woken_[u]) || (mesh_.state(u) & kVertexKept)) continue;
    if (!costs_.gather(u, s)) continue;
    bool done = true;
    for (std::size_t i = 0; i < s.star.faces; ++i) done = done && mesh_.done(s.star.corner[i] >> 2);
    if (done) continue;
    costs_.list(s, list);
    if (list.size > 0) queue_.push(u, cost_class(list.next(0).cost, kCostClasses));
  }
}

/// Collapses until no candidate of the vertices first_ to end_ is left.
void Decimator::empty_queue(DecimateReport& report) {
  CandidateList list;
  CandidateStar s(options_);
  std::uint32_t u = 0, now = 0;
  while (queue_.pop(u, now)) {
    if (now > options_.max_cost_class) {
      report.stop = DecimateStop::kCostLimit;
      return;
    }
    if ((mesh_.state(u) & kVertexDead) || !costs_.gather(u, s)) continue;
    costs_.list(s, list);
    try_candidates(s, list, now, report);
  }
}

/// Does the first legal collapse of class `now`; the vertex waits for the class of its next one where that is higher.
void Decimator::try_candidates(const CandidateStar& s, CandidateList& list, std::uint32_t now,
                               DecimateReport& report) {
  const std::uint32_t u = s.centre;
  colours_.keep(u, false);
  for (std::size_t i = 0; i < list.size; ++i) {
    const CollapseCandidate& candidate = list.next(i);
    const std::uint32_t cls = cost_class(candidate.cost, kCostClasses);
    if (cls < tried_[u]) continue;
    if (cls > now) {
      tried_[u] = static_cast<std::uint16_t>(cls);
      queue_.push(u, cls);
      return;
    }
    ++report.candidates;
    const Verdict verdict = check(s, candidate.at);
    if (verdict.refusal != CollapseRefusal::kNone) {
      count_refusal(verdict.refusal, report);
      if (verdict.refusal == CollapseRefusal::kColour) colours_.keep(u, true);
      continue;
    }
    remove(s, candidate.at, verdict);
    wake_around(candidate.vertex, now);
    ++report.collapses;
    report.cost_histogram[now] += s.star.closed ? 2 : 1;
    return;
  }
}

/// Whoever was refused near here gets another chance; those in the queue are looked at anyway.
void Decimator::wake_around(std::uint32_t v, std::uint32_t now) {
  const auto wake = [&](std::uint32_t w) {
    tried_[w] = 0;
    if (mesh_.state(w) & kVertexKept) return;
    if (w < first_)
      woken_[w] = 1;
    else if (w < end_ && !queue_.contains(w))
      queue_.push(w, now);
  };
  wake(v);
  mesh_.for_each_neighbour(v, wake);
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

Decimator::Verdict Decimator::check(const CandidateStar& s, std::size_t at) {
  Verdict verdict = check_star(s, at);
  if (verdict.refusal != CollapseRefusal::kNone) return verdict;
  if (adds_crossing(s.star, at, verdict.moves))
    verdict.refusal = CollapseRefusal::kCrossing;
  else if (!verdict.moves && !colours_.allows(s.centre, s.star, at))
    verdict.refusal = CollapseRefusal::kColour;
  return verdict;
}

/// All that the star, its neighbours and the reference tell.
Decimator::Verdict Decimator::check_star(const CandidateStar& s, std::size_t at) {
  const std::uint32_t u = s.centre;
  if (!is_collapse_ok(mesh_, s.star, at)) return {CollapseRefusal::kLink};
  if (s.in_lanes && options_.tolerance > 0.0 && !tolerance_.asks_normals() &&
      !(mesh_.state(u) & kVertexCrease)) {
    double deviation = 0.0;
    const StarLanes::Answer answer = s.lanes.judge(at, deviation);
    if (answer == StarLanes::Answer::kRefused) return {CollapseRefusal::kFold};
    if (answer == StarLanes::Answer::kGood) {
      float bound = rounded_up(max_face_bound(mesh_, s.star) + deviation);
      if (static_cast<double>(bound) <= options_.tolerance) return {CollapseRefusal::kNone, bound};
      lay_link(mesh_, s.star, at, sides_);
      const CollapseRefusal refusal = tolerance_.ask(u, s.star, at, sides_, bound);
      return {refusal, bound};
    }
  }
  if (options_.placement == DecimatePlacement::kOptimal)
    if (const auto bound = bound_of_move(s, at)) return {CollapseRefusal::kNone, *bound, true};
  const CollapseRefusal faces = check_new_faces(mesh_, u, s.star, at, options_.min_mean_ratio);
  if (faces != CollapseRefusal::kNone) return {faces};
  auto sum = bound_by_sum(mesh_, u, s.star, at, sides_);
  if (!sum) return {CollapseRefusal::kFold};
  const CollapseRefusal refusal = tolerance_.check(u, s.star, at, sides_, *sum);
  return {refusal, sum->bound};
}

/// Tries the collapse of the edge into the minimum of its quadrics: both stars become one fan around it, which goes to move_.
/// \return the bound of the new faces
std::optional<float> Decimator::bound_of_move(const CandidateStar& s, std::size_t at) {
  const std::uint32_t u = s.centre, v = s.star.ring[at];
  if (!costs_.may_move(u, v) || !mesh_.gather(v, move_.other)) return std::nullopt;
  const Double3 p = move_.to = costs_.best_position(u, v);
  if (!colours_.allows_blend(u, v, share_along(mesh_.at(u), mesh_.at(v), p))) return std::nullopt;
  LinkLoop& loop = sides_.loop[0];
  if (!lay_edge_link(mesh_, s.star, at, move_.other, p, options_.min_mean_ratio, loop)) return std::nullopt;
  if (!(options_.tolerance > 0.0)) return 0.0f;
  float bound = std::numeric_limits<float>::infinity();
  double deviation = 0.0;
  if (!tolerance_.asks_normals() &&
      edge_deviation(loop, mesh_.at(u) - p, mesh_.at(v) - p, s.star.faces - 2, deviation)) {
    const double before = std::max(max_face_bound(mesh_, s.star), max_face_bound(mesh_, move_.other));
    bound = rounded_up(before + deviation * (1.0 + 1e-12));
  }
  if (!tolerance_.is_edge_near(u, v, p, loop, bound)) return std::nullopt;
  return bound;
}

/// Whether faces would meet others that check_star() does not know of.
bool Decimator::adds_crossing(const Star& star, std::size_t at, bool moves) {
  if (options_.allow_crossings) return false;
  return moves ? guard_.collapse_adds(star, at, move_.other, move_.to) : guard_.collapse_adds(star, at);
}

/// The collapse that was found legal.
void Decimator::remove(const CandidateStar& s, std::size_t at, const Verdict& verdict) {
  const Star& star = s.star;
  const std::uint32_t u = s.centre, v = star.ring[at];
  for (std::size_t i = 0; i < star.faces; ++i) {
    mesh_.face(star.corner[i] >> 2).bound = verdict.bound;
    mesh_.unsettle(star.corner[i] >> 2);
  }
  // What an ear stood for now hangs on the edge that it leaves.
  if (!star.closed && star.faces == 1) {
    CollapseFace& outer = mesh_.face(mesh_.opposite(star.corner[0]) >> 2);
    outer.bound = std::fmax(outer.bound, verdict.bound);
  }
  if (verdict.moves) move_vertex(u, v, verdict.bound);
  costs_.merge(u, v);
  colours_.accept();
  mesh_.collapse(star, at);
  if (!options_.allow_crossings) tell_guard(star, verdict);
}

/// Faces that no one was asked about, or that meet others by leave of what was there before, are marked.
void Decimator::tell_guard(const Star& star, const Verdict& verdict) {
  if (verdict.asked)
    guard_.accept_collapse(star);
  else
    guard_.accept_unasked(star);
  const bool doubt = !verdict.asked || guard_.made_meet();
  const auto mark = [&](const Star& faces) {
    for (std::size_t i = 0; i < faces.faces; ++i) {
      std::uint32_t& state = mesh_.face(faces.corner[i] >> 2).state;
      state = doubt ? state | kStateUnasked : state & ~unsigned{kStateUnasked};
    }
  };
  mark(star);
  if (verdict.moves) mark(move_.other);
}

/// A pair that meets was there before, or the face of it that came last is marked.
bool Decimator::may_meet() {
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f)
    if ((mesh_.face(f).state & (kStateUnasked | kStateDead)) == kStateUnasked && guard_.meets(f)) return true;
  return false;
}

/// Puts v where bound_of_move() found its place; attributes blend along the edge.
void Decimator::move_vertex(std::uint32_t u, std::uint32_t v, float bound) {
  for (std::size_t i = 0; i < move_.other.faces; ++i) mesh_.face(move_.other.corner[i] >> 2).bound = bound;
  const double t = share_along(mesh_.at(u), mesh_.at(v), move_.to);
  const std::uint32_t from = mesh_.block_vertex(u), to = mesh_.block_vertex(v);
  mesh_.node(v).at = move_.to;
  block_.position[to] = move_.to + origin_;
  if (options_.float_positions)
    for (double& c : block_.position[to]) c = static_cast<double>(static_cast<float>(c));
  if (block_.rgba.empty()) return;
  std::uint32_t blend = 0;
  for (unsigned shift = 0; shift < 32; shift += 8) {
    const double c = (1.0 - t) * static_cast<double>(block_.rgba[from] >> shift & 255u) +
                     t * static_cast<double>(block_.rgba[to] >> shift & 255u);
    blend |= static_cast<std::uint32_t>(c + 0.5) << shift;
  }
  block_.rgba[to] = blend;
}

}  // namespace tessera
