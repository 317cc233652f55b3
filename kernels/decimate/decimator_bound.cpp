// The tolerance part of Decimator: loops of the rim, the bound by sums, the test against the reference.
#include <algorithm>
#include <cmath>

#include "kernels/decimate/decimator.h"
#include "octree/rounding.h"

namespace tessera {

/// The side of the star whose ring runs from place `from` to `to`, counter-clockwise; one of them takes over.
void Decimator::make_side(const Star& star, std::uint32_t v, std::size_t from, std::size_t to, bool v_first,
                          LinkLoop& loop) const {
  const std::size_t size = star.ring_size();
  const bool border = (mesh_.state(v) & kVertexBorder) != 0 && !star.closed;
  loop.clear();
  // The loop starts with v; the edge between v and the other end closes it and is the line.
  const auto add_line = [&](std::uint32_t w) {
    (border ? loop.borders : loop.creases) |= std::uint64_t{1} << loop.size;
    add_link(v, w, kNoCorner, loop);
  };
  if (!v_first) add_line(v);
  for (std::size_t i = from;; i = i + 1 < size ? i + 1 : 0) {
    if (i == to) {
      if (v_first) add_line(star.ring[i]);
      return;
    }
    add_link(v, star.ring[i], star.corner[i], loop);
  }
}

/// Adds the place of w, and with it the edge from there on, which lies opposite the corner.
void Decimator::add_link(std::uint32_t v, std::uint32_t w, std::uint32_t corner, LinkLoop& loop) const {
  const std::uint64_t bit = std::uint64_t{1} << loop.size;
  if (corner != kNoCorner) {
    if (mesh_.border_edge(corner)) loop.borders |= bit;
    if (mesh_.crease_edge(corner)) loop.creases |= bit;
  }
  if (mesh_.state(w) & (kVertexBorder | kVertexCrease | kVertexFixed)) loop.ends |= bit;
  loop.at[loop.size++] = mesh_.at(w) - mesh_.at(v);
}

/// The rim of a closed star as the only loop.
void Decimator::lay_link(const Star& star, std::size_t at_ring) {
  sides_ = 1;
  flat_edge_[0] = kNoFlatEdge;
  LinkLoop& loop = loops_[0];
  loop.clear();
  for (std::size_t n = 0, i = at_ring; n < star.faces; ++n, i = i + 1 < star.faces ? i + 1 : 0)
    add_link(star.ring[at_ring], star.ring[i], star.corner[i], loop);
}

/// Lays out the rim loops of the collapse and bounds the distance by adding what it moves to what was before.
/// \return false where it folds
bool Decimator::bound_by_sum(std::uint32_t u, const Star& star, std::size_t at_ring) {
  const std::uint32_t v = star.ring[at_ring];
  const std::size_t size = star.ring_size();
  const Double3 pu = mesh_.at(u), pv = mesh_.at(v);
  const std::uint8_t state = mesh_.state(u);
  double deviation = 0.0;
  sides_ = 0;
  flat_edge_[0] = kNoFlatEdge;
  if (state & (kVertexBorder | kVertexCrease)) {
    // Along a line: the line's vertex first moves to its foot on the new edge, then each side for itself.
    std::size_t far = 0;
    if (state & kVertexBorder) {
      far = at_ring == 0 ? star.faces : 0;
    } else {
      for (std::size_t i = 0; i < star.faces; ++i)
        if (i != at_ring && mesh_.crease_edge(prev_corner(star.corner[i]))) far = i;
    }
    const Double3 edge = mesh_.at(star.ring[far]) - pv, from = pu - pv;
    const double size2 = dot(edge, edge);
    if (!(size2 > 0.0)) return false;
    const Double3 foot = edge * std::clamp(dot(from, edge) / size2, 0.0, 1.0);
    if (!(state & kVertexBorder) || at_ring == 0) {
      make_side(star, v, at_ring, far, true, loops_[sides_]);
      flat_edge_[sides_] = loops_[sides_].size - 1;
      ++sides_;
    }
    if (!(state & kVertexBorder) || at_ring != 0) {
      make_side(star, v, far, at_ring, false, loops_[sides_]);
      flat_edge_[sides_++] = 0;
    }
    for (std::size_t s = 0; s < sides_; ++s) {
      double side = 0.0;
      if (!fan_deviation(loops_[s], foot, flat_edge_[s], side)) return false;
      deviation = std::fmax(deviation, side);
    }
    deviation += norm(from - foot);
    foot_ = {star.ring[far], v, v, std::clamp(dot(from, edge) / size2, 0.0, 1.0), 0.0};
  } else {
    lay_link(star, at_ring);
    FanFoot foot;
    if (!fan_deviation(loops_[0], pu - pv, kNoFlatEdge, deviation, &foot)) return false;
    const auto ring_at = [&](std::size_t i) { return star.ring[(at_ring + i) % size]; };
    foot_ = {ring_at(foot.sector), ring_at(foot.sector + 1), v, foot.first, foot.second};
  }
  new_bound_ = rounded_up(largest_bound(star) + deviation * (1.0 + 1e-12));
  return true;
}

/// Asks the mesh as the sweeps left it, whose vertices are some of the reference. Where it ends it may be coarse too.
Decimator::Doubt Decimator::query_coarse(std::uint32_t u, const Star& star, std::size_t at_ring) {
  if (coarse_witness_.empty() || loops_[0].borders != 0) return Doubt::kOpen;
  ReferenceDeviation::Query query;
  query.origin = mesh_.at(star.ring[at_ring]);
  query.seed = u;
  query.limit = options_.tolerance;
  query.cross_creases = true;
  query.witness = coarse_witness_[u];
  const ReferenceDeviation::Result result = coarse_deviation_.measure(loops_[0], query);
  if (result.answer == ReferenceDeviation::Answer::kWithin) {
    new_bound_ = rounded_up(result.deviation);
    return Doubt::kWithin;
  }
  if (result.witness == kNoCorner) return Doubt::kOpen;
  coarse_witness_[u] = result.witness;
  return Doubt::kBeyond;
}

Decimator::Refusal Decimator::check_deviation(std::uint32_t u, const Star& star, std::size_t at_ring) {
  if (!bound_by_sum(u, star, at_ring)) return Refusal::kFold;
  if (!(options_.tolerance > 0.0)) return Refusal::kNone;
  const bool short_sum = static_cast<double>(new_bound_) <= options_.tolerance;
  const bool on_line = (mesh_.state(u) & (kVertexBorder | kVertexCrease)) != 0;
  double exact = 0.0;
  if (on_line) {
    // Creases are seen: they may deviate by half as much. Without the line in the reference only the sum tells.
    const bool crease = (mesh_.state(u) & kVertexCrease) != 0;
    const std::uint32_t v = reference_vertex_[star.ring[at_ring]], q = reference_vertex_[foot_.a];
    const bool known = reference_vertex_[u] != kNoCorner && v != kNoCorner && q != kNoCorner;
    if (known && (crease || !short_sum) &&
        !line_deviation(reference_deviation_.mesh(), reference_vertex_[u], v, q,
                        options_.tolerance * (crease ? 0.5 : 1.0), exact))
      return Refusal::kTolerance;
    if (!known && !short_sum) return Refusal::kTolerance;
  }
  if (short_sum && min_cosine_ <= -1.0) return Refusal::kNone;
  return query_reference(u, star, at_ring, short_sum, exact);
}

/// \param short_sum  the sum of bounds is within the tolerance \param on_line_deviation  of the line that u lies on
Decimator::Refusal Decimator::query_reference(std::uint32_t u, const Star& star, std::size_t at_ring,
                                              bool short_sum, double on_line_deviation) {
  const bool on_line = (mesh_.state(u) & (kVertexBorder | kVertexCrease)) != 0;
  double exact = on_line_deviation;
  // Sums of bounds grow faster than the distance itself: ask the reference.
  if (reference_vertex_[u] == kNoCorner) return Refusal::kTolerance;
  ++exact_tests_;
  const Doubt doubt = on_line ? Doubt::kOpen : query_coarse(u, star, at_ring);
  if (doubt != Doubt::kOpen) {
    exact_accepted_ += doubt == Doubt::kWithin;
    return doubt == Doubt::kWithin ? Refusal::kNone : Refusal::kTolerance;
  }
  for (std::size_t s = 0; s < sides_; ++s) {
    ReferenceDeviation::Query query;
    query.origin = mesh_.at(star.ring[at_ring]);
    query.free_corners = options_.placement == DecimatePlacement::kOptimal;
    query.seed = reference_vertex_[u];
    query.flat_edge = flat_edge_[s];
    query.limit = options_.tolerance;
    query.min_cosine = min_cosine_;
    query.cross_creases = !on_line;
    query.witness = witness_[u];
    ReferenceDeviation::Result result = reference_deviation_.measure(loops_[s], query);
    if (result.answer == ReferenceDeviation::Answer::kFolded && query.cross_creases && loops_[s].ends != 0) {
      query.cross_creases = false;  // over an edge that is too sharp
      result = reference_deviation_.measure(loops_[s], query);
    }
    if (result.witness != kNoCorner) witness_[u] = result.witness;
    if (result.answer == ReferenceDeviation::Answer::kNormalDeviates) return Refusal::kNormal;
    if (result.answer != ReferenceDeviation::Answer::kWithin) return Refusal::kTolerance;
    exact = std::fmax(exact, result.deviation);
  }
  ++exact_accepted_;
  new_bound_ = short_sum ? std::fmin(new_bound_, rounded_up(exact)) : rounded_up(exact);
  return Refusal::kNone;
}

}  // namespace tessera
