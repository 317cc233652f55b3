#include "kernels/decimate/tolerance_check.h"

#include <cmath>
#include <utility>

#include "octree/portable_math.h"
#include "octree/rounding.h"

namespace tessera {

using Answer = ReferenceDeviation::Answer;

ToleranceCheck::ToleranceCheck(const CollapseMesh& mesh, const CollapseMesh& reference,
                               std::vector<std::uint32_t> reference_vertex, const DecimateOptions& options)
    : mesh_(mesh),
      options_(options),
      min_cosine_(options.max_normal_deviation_deg > 0.0 ? cosine_of_degrees(options.max_normal_deviation_deg)
                                                         : -1.0),
      reference_vertex_(std::move(reference_vertex)) {
  if (options.tolerance > 0.0)
    reference_ = ReferenceDeviation(reference, options.max_normal_deviation_deg > 0.0);
}

CollapseRefusal ToleranceCheck::check(std::uint32_t u, const Star& star, std::size_t at,
                                      const LinkSides& sides, CollapseBound& bound) {
  if (!(options_.tolerance > 0.0)) return CollapseRefusal::kNone;
  const bool short_sum = static_cast<double>(bound.bound) <= options_.tolerance;
  const bool on_line = (mesh_.state(u) & (kVertexBorder | kVertexCrease)) != 0;
  double deviation = 0.0;
  if (on_line) {
    const CollapseRefusal refusal = check_line(u, star.ring[at], bound.foot.a, short_sum, deviation);
    if (refusal != CollapseRefusal::kNone) return refusal;
  }
  if (short_sum && !asks_normals()) return CollapseRefusal::kNone;
  float proven = 0.0f;
  const CollapseRefusal refusal = ask(u, star, at, sides, proven, deviation);
  if (refusal == CollapseRefusal::kNone) bound.bound = short_sum ? std::fmin(bound.bound, proven) : proven;
  return refusal;
}

/// Creases are seen: they may deviate by half as much. Without the line in the reference only the sum tells.
CollapseRefusal ToleranceCheck::check_line(std::uint32_t u, std::uint32_t v, std::uint32_t end,
                                           bool short_sum, double& deviation) const {
  const bool crease = (mesh_.state(u) & kVertexCrease) != 0;
  const std::uint32_t from = reference_vertex_[u], to = reference_vertex_[v], q = reference_vertex_[end];
  const bool known = from != kNoCorner && to != kNoCorner && q != kNoCorner;
  const bool within = !known || (short_sum && !crease)
                          ? short_sum
                          : line_deviation(reference_.mesh(), from, to, q,
                                           options_.tolerance * (crease ? 0.5 : 1.0), deviation);
  return within ? CollapseRefusal::kNone : CollapseRefusal::kTolerance;
}

CollapseRefusal ToleranceCheck::ask(std::uint32_t u, const Star& star, std::size_t at, const LinkSides& sides,
                                    float& bound, double line_deviation) {
  if (reference_vertex_[u] == kNoCorner) return CollapseRefusal::kTolerance;
  ++asked_;
  const bool on_line = (mesh_.state(u) & (kVertexBorder | kVertexCrease)) != 0;
  const Doubt doubt = on_line ? Doubt::kOpen : ask_coarse(u, star, at, sides, bound);
  if (doubt == Doubt::kBeyond) return CollapseRefusal::kTolerance;
  double deviation = line_deviation;
  for (std::size_t s = 0; s < sides.count && doubt == Doubt::kOpen; ++s) {
    const ReferenceDeviation::Result result = measure_side(u, star.ring[at], sides, s, on_line);
    if (result.witness != kNoCorner) witness_[u] = result.witness;
    if (result.answer == Answer::kNormalDeviates) return CollapseRefusal::kNormal;
    if (result.answer != Answer::kWithin) return CollapseRefusal::kTolerance;
    deviation = std::fmax(deviation, result.deviation);
  }
  ++accepted_;
  if (doubt == Doubt::kOpen) bound = rounded_up(deviation);
  return CollapseRefusal::kNone;
}

ReferenceDeviation::Result ToleranceCheck::measure_side(std::uint32_t u, std::uint32_t v,
                                                        const LinkSides& sides, std::size_t s, bool on_line) {
  ReferenceDeviation::Query query;
  query.origin = mesh_.at(v);
  query.free_corners = options_.placement == DecimatePlacement::kOptimal;
  query.seed = reference_vertex_[u];
  query.flat_edge = sides.flat_edge[s];
  query.limit = options_.tolerance;
  query.min_cosine = min_cosine_;
  query.cross_creases = !on_line;
  query.witness = witness_[u];
  const ReferenceDeviation::Result result = reference_.measure(sides.loop[s], query);
  if (result.answer != Answer::kFolded || on_line || sides.loop[s].ends == 0) return result;
  query.cross_creases = false;  // over an edge that is too sharp
  return reference_.measure(sides.loop[s], query);
}

/// Asks the mesh as the sweeps left it, whose vertices are some of the reference. Where it ends it may be coarse too.
ToleranceCheck::Doubt ToleranceCheck::ask_coarse(std::uint32_t u, const Star& star, std::size_t at,
                                                 const LinkSides& sides, float& bound) {
  if (coarse_witness_.empty() || sides.loop[0].borders != 0) return Doubt::kOpen;
  ReferenceDeviation::Query query;
  query.origin = mesh_.at(star.ring[at]);
  query.seed = u;
  query.limit = options_.tolerance;
  query.cross_creases = true;
  query.witness = coarse_witness_[u];
  const ReferenceDeviation::Result result = coarse_.measure(sides.loop[0], query);
  if (result.answer == Answer::kWithin) {
    bound = rounded_up(result.deviation);
    return Doubt::kWithin;
  }
  if (result.witness == kNoCorner) return Doubt::kOpen;
  coarse_witness_[u] = result.witness;
  return Doubt::kBeyond;
}

bool ToleranceCheck::is_edge_near(std::uint32_t u, std::uint32_t v, const Double3& p, const LinkLoop& loop,
                                  float& bound) {
  const bool near_u = squared_distance(mesh_.at(u), p) < squared_distance(mesh_.at(v), p);
  const std::uint32_t nearer = near_u ? u : v, other = near_u ? v : u;
  if (static_cast<double>(bound) <= options_.tolerance) {
    reference_vertex_[v] = reference_vertex_[nearer];
    return true;
  }
  ReferenceDeviation::Query query;
  query.origin = p;
  query.limit = options_.tolerance;
  query.min_cosine = min_cosine_;
  query.free_corners = query.inner_centre = query.cross_creases = true;
  for (const std::uint32_t w : {nearer, other}) {
    query.seed = reference_vertex_[w];
    if (query.seed == kNoCorner) continue;
    ++asked_;
    const ReferenceDeviation::Result result = reference_.measure(loop, query);
    if (result.answer != Answer::kWithin) continue;
    ++accepted_;
    bound = rounded_up(result.deviation);
    reference_vertex_[v] = query.seed;
    return static_cast<double>(bound) <= options_.tolerance;
  }
  return false;
}

void ToleranceCheck::set_coarse() {
  coarse_ = ReferenceDeviation(mesh_);
  coarse_witness_.assign(mesh_.vertices(), kNoCorner);
}

void ToleranceCheck::keep_witnesses() {
  if (options_.tolerance > 0.0) witness_.assign(mesh_.vertices(), kNoCorner);
}

void ToleranceCheck::compact(const std::vector<std::uint32_t>& kept) {
  for (std::size_t i = 0; i < kept.size(); ++i) reference_vertex_[i] = reference_vertex_[kept[i]];
  reference_vertex_.resize(kept.size());
}

void ToleranceCheck::report(DecimateReport& report) const {
  report.exact_tests = asked_;
  report.exact_accepted = accepted_;
  report.reference_faces_walked = reference_.walked();
}

}  // namespace tessera
