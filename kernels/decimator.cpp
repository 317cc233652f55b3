#include "kernels/decimator.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

using synth::Vec3;

/// Rounds towards plus infinity, so that a bound stays one.
float float_above(double v) {
  const float f = static_cast<float>(v);
  return static_cast<double>(f) >= v ? f : std::nextafter(f, std::numeric_limits<float>::infinity());
}

/// 4 sqrt(3) area / (sum of squared edges): 1 for the equilateral triangle, 0 for none.
double roundness(double twice_area, double squared_edges) {
  return squared_edges > 0.0 ? 2.0 * 1.7320508075688772 * twice_area / squared_edges : 0.0;
}

}  // namespace

Decimator::Decimator(CollapseMesh& mesh, const CollapseMesh& reference,
                     std::vector<std::uint32_t> reference_vertex, const DecimateOptions& options)
    : mesh_(mesh),
      options_(options),
      quadric_(mesh.vertices()),
      tried_(mesh.vertices(), 0),
      mark_(mesh.vertices(), 0),
      queue_(mesh.vertices()),
      reference_vertex_(std::move(reference_vertex)) {
  if (options.tolerance > 0.0) reference_gap_ = ReferenceGap(reference);
  if (options.max_normal_turn_deg > 0.0)
    least_cosine_ = synth::sin_cos(options.max_normal_turn_deg * (synth::kPi / 180.0)).cos;
  accumulate_quadrics();
}

void Decimator::accumulate_quadrics() {
  const bool uncertain = options_.priority == DecimatePriority::kProbabilistic;
  const double noise = options_.noise > 0.0 ? options_.noise : options_.tolerance / 8.0;
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
    const std::uint32_t* v = mesh_.face(f).vertex;
    const Vec3 p[3] = {mesh_.at(v[0]), mesh_.at(v[1]), mesh_.at(v[2])};
    const Vec3 normal = cross(p[1] - p[0], p[2] - p[0]);
    const double twice_area = length(normal);
    if (!(twice_area > 0.0)) continue;
    const Vec3 n = normal * (1.0 / twice_area);
    // A third of the area each.
    const double weight = twice_area / 6.0;
    const Quadric q = uncertain ? uncertain_plane_quadric(n, p[0], weight, noise * noise,
                                                          noise * noise / (0.5 * twice_area))
                                : plane_quadric(n, p[0], weight);
    for (std::size_t i = 0; i < 3; ++i) quadric_[v[i]] += q;
    // Borders and creases hold their line: a plane through the edge, at right angles to the face.
    if ((mesh_.face(f).state & (7u * kStateBorder | 7u * kStateCrease)) == 0) continue;
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t c = 4 * f + i;
      if (!mesh_.border_edge(c) && !mesh_.crease_edge(c)) continue;
      const std::uint32_t a = (i + 1) % 3, b = (i + 2) % 3;
      const Vec3 edge = p[b] - p[a], across = cross(edge, n);
      const double size2 = dot(edge, edge);
      if (!(size2 > 0.0)) continue;
      const Quadric wall = plane_quadric(across * (1.0 / length(across)), p[a], size2);
      quadric_[v[a]] += wall;
      quadric_[v[b]] += wall;
    }
  }
  for (std::uint32_t v = 0; v < mesh_.vertices(); ++v) update_error(v);
}

void Decimator::update_error(std::uint32_t v) {
  CollapseVertex& node = mesh_.node(v);
  node.error = std::fmax(0.0, quadric_[v](node.at.x, node.at.y, node.at.z));
}

double Decimator::cost(std::uint32_t u, const Quadric& q, std::uint32_t v) const {
  const CollapseVertex& to = mesh_.node(v);
  const Vec3 edge = to.at - mesh_.at(u);
  const double edge2 = dot(edge, edge);
  if (options_.priority == DecimatePriority::kEdgeLength) return edge2;
  // In a plane all costs are 0 but for rounding: there short edges go first.
  return std::fmax(0.0, q(to.at.x, to.at.y, to.at.z)) + to.error + 1e-8 * edge2 * edge2;
}

bool Decimator::allowed_by_features(std::uint32_t u, const Star& star, std::size_t at) const {
  const std::uint8_t state = mesh_.state(u);
  if (mesh_.state(star.ring[at]) & kVertexPinched) return false;
  if (state & kVertexBorder) return at == 0 || at == star.faces;  // an open fan ends in its border edges
  if (state & kVertexCrease) return mesh_.crease_edge(prev_corner(star.corner[at]));
  return true;
}

std::size_t Decimator::list_candidates(std::uint32_t u, const Star& star,
                                       std::array<Candidate, kMaxRing + 1>& list) {
  std::size_t n = 0;
  const Quadric q = quadric_[u];
  for (std::size_t i = 0; i < star.ring_size(); ++i)
    if (allowed_by_features(u, star, i))
      list[n++] = {cost(u, q, star.ring[i]), star.ring[i], static_cast<std::uint32_t>(i)};
  std::sort(list.begin(), list.begin() + static_cast<std::ptrdiff_t>(n),
            [](const Candidate& a, const Candidate& b) {
              return a.cost != b.cost ? a.cost < b.cost : a.vertex < b.vertex;
            });
  return n;
}

/// The rings of both ends share the third corners of the two faces at the edge (one at a border) and nothing
/// else; no edge between two locked vertices is made, another block might make it too.
bool Decimator::linked(const Star& star, std::size_t at) {
  const std::uint32_t v = star.ring[at];
  ++stamp_;
  for (std::size_t i = 0; i < star.ring_size(); ++i) mark_[star.ring[i]] = stamp_;
  std::size_t shared = 0;
  mesh_.for_each_neighbour(v, [&](std::uint32_t w) {
    if (mark_[w] == stamp_) ++shared, mark_[w] = stamp_ - 1;
  });
  if (shared != (star.closed ? 2u : 1u)) return false;
  if (mesh_.state(v) & kVertexLocked)  // the marks that are left are ring vertices without an edge to v
    for (std::size_t i = 0; i < star.ring_size(); ++i)
      if (i != at && mark_[star.ring[i]] == stamp_ && (mesh_.state(star.ring[i]) & kVertexLocked))
        return false;
  if (star.closed) {
    if (star.faces < 3) return false;
    if (star.faces > 3) return true;
    // Of a tetrahedron the last face would double.
    const std::uint32_t outer = mesh_.opposite(star.corner[(at + 1) % 3]);
    return outer != kNoCorner && mesh_.vertex(outer) != v;
  }
  // An ear goes unless it is all that is left, or holds on to another block.
  return star.faces > 1 || mesh_.opposite(star.corner[0]) != kNoCorner;
}

Decimator::Refusal Decimator::check_faces(std::uint32_t u, const Star& star, std::size_t at_ring) const {
  const std::size_t k = star.faces, size = star.ring_size();
  const std::uint32_t v = star.ring[at_ring];
  const Vec3 pu = mesh_.at(u), pv = mesh_.at(v);
  double worst_new = 1.0, worst_old = 1.0;
  for (std::size_t i = 0; i < k; ++i) {
    const std::size_t j = i + 1 < size ? i + 1 : 0;
    const Vec3 a = mesh_.at(star.ring[i]), b = mesh_.at(star.ring[j]);
    const Vec3 old_normal = cross(a - pu, b - pu);
    const double old_area = length(old_normal), rim2 = dot(b - a, b - a);
    worst_old = std::fmin(worst_old, roundness(old_area, rim2 + dot(a - pu, a - pu) + dot(b - pu, b - pu)));
    if (i == at_ring || j == at_ring) continue;
    const Vec3 new_normal = cross(a - pv, b - pv);
    const double new_area = length(new_normal);
    if (!(new_area > 0.0) || dot(old_normal, new_normal) < 0.2 * old_area * new_area) return Refusal::kFold;
    worst_new = std::fmin(worst_new, roundness(new_area, rim2 + dot(a - pv, a - pv) + dot(b - pv, b - pv)));
  }
  if (worst_new < options_.min_roundness && worst_new < worst_old) return Refusal::kShape;
  return Refusal::kNone;
}

/// The side of the star whose ring runs from place `from` to `to`, counter-clockwise; one of them takes over.
void Decimator::make_side(const Star& star, std::uint32_t v, std::size_t from, std::size_t to, bool v_first,
                          RimLoop& loop) const {
  const std::size_t size = star.ring_size();
  const bool border = (mesh_.state(v) & kVertexBorder) != 0 && !star.closed;
  loop.clear();
  // The loop starts with v; the edge between v and the other end closes it and is the line.
  const auto add_line = [&](std::uint32_t w) {
    (border ? loop.borders : loop.creases) |= std::uint64_t{1} << loop.size;
    add_rim(v, w, kNoCorner, loop);
  };
  if (!v_first) add_line(v);
  for (std::size_t i = from;; i = i + 1 < size ? i + 1 : 0) {
    if (i == to) {
      if (v_first) add_line(star.ring[i]);
      return;
    }
    add_rim(v, star.ring[i], star.corner[i], loop);
  }
}

/// Adds the place of w, and with it the edge from there on, which lies opposite the corner.
void Decimator::add_rim(std::uint32_t v, std::uint32_t w, std::uint32_t corner, RimLoop& loop) const {
  const std::uint64_t bit = std::uint64_t{1} << loop.size;
  if (corner != kNoCorner) {
    if (mesh_.border_edge(corner)) loop.borders |= bit;
    if (mesh_.crease_edge(corner)) loop.creases |= bit;
  }
  if (mesh_.state(w) & (kVertexBorder | kVertexCrease | kVertexFixed)) loop.ends |= bit;
  loop.at[loop.size++] = mesh_.at(w) - mesh_.at(v);
}

Decimator::Refusal Decimator::check_gap(std::uint32_t u, const Star& star, std::size_t at_ring) {
  const std::uint32_t v = star.ring[at_ring];
  const std::size_t size = star.ring_size();
  const Vec3 pu = mesh_.at(u), pv = mesh_.at(v);
  const std::uint8_t state = mesh_.state(u);
  double gap = 0.0;
  std::size_t sides = 0;
  bool v_first[2] = {true, false};
  if (state & (kVertexBorder | kVertexCrease)) {
    // Along a line: the line's vertex first moves to its foot on the new edge, then each side for itself.
    std::size_t far = 0;
    if (state & kVertexBorder) {
      far = at_ring == 0 ? star.faces : 0;
    } else {
      for (std::size_t i = 0; i < star.faces; ++i)
        if (i != at_ring && mesh_.crease_edge(prev_corner(star.corner[i]))) far = i;
    }
    const Vec3 edge = mesh_.at(star.ring[far]) - pv, from = pu - pv;
    const double size2 = dot(edge, edge);
    if (!(size2 > 0.0)) return Refusal::kFold;
    const Vec3 foot = edge * synth::clamp(dot(from, edge) / size2, 0.0, 1.0);
    if (!(state & kVertexBorder) || at_ring == 0) make_side(star, v, at_ring, far, true, loops_[sides++]);
    if (!(state & kVertexBorder) || at_ring != 0) {
      v_first[sides] = false;
      make_side(star, v, far, at_ring, false, loops_[sides++]);
    }
    for (std::size_t s = 0; s < sides; ++s) {
      double side = 0.0;
      if (!fan_gap(loops_[s], foot, v_first[s] ? loops_[s].size - 1 : 0, side)) return Refusal::kFold;
      gap = std::fmax(gap, side);
    }
    gap += length(from - foot);
  } else {
    RimLoop& loop = loops_[sides++];
    loop.clear();
    for (std::size_t n = 0, i = at_ring; n < size; ++n, i = i + 1 < size ? i + 1 : 0)
      add_rim(v, star.ring[i], star.corner[i], loop);
    if (!fan_gap(loop, pu - pv, kNoFlatEdge, gap)) return Refusal::kFold;
  }
  double bound = 0.0;
  for (std::size_t i = 0; i < star.faces; ++i)
    bound = std::fmax(bound, static_cast<double>(mesh_.face(star.corner[i] >> 2).bound));
  new_bound_ = float_above(bound + gap * (1.0 + 1e-12));
  if (!(options_.tolerance > 0.0)) return Refusal::kNone;
  const bool short_sum = static_cast<double>(new_bound_) <= options_.tolerance;
  if (short_sum && least_cosine_ <= -1.0) return Refusal::kNone;
  // Sums of bounds grow faster than the distance itself: ask the reference.
  if (reference_vertex_[u] == kNoCorner) return Refusal::kTolerance;
  ++exact_tests_;
  double exact = 0.0;
  const bool on_line = (state & (kVertexBorder | kVertexCrease)) != 0;
  for (std::size_t s = 0; s < sides; ++s) {
    ReferenceGap::Query query;
    query.origin = pv;
    query.seed = reference_vertex_[u];
    query.flat_edge = !on_line ? kNoFlatEdge : v_first[s] ? loops_[s].size - 1 : 0;
    query.limit = options_.tolerance;
    query.least_cosine = least_cosine_;
    query.cross_creases = !on_line;
    double side = 0.0;
    ReferenceGap::Answer answer = reference_gap_.measure(loops_[s], query, side);
    if (answer == ReferenceGap::Answer::kFolded && query.cross_creases && loops_[s].ends != 0) {
      query.cross_creases = false;  // over an edge that is too sharp
      answer = reference_gap_.measure(loops_[s], query, side);
    }
    if (answer == ReferenceGap::Answer::kTurned) return Refusal::kNormal;
    if (answer != ReferenceGap::Answer::kWithin) return Refusal::kTolerance;
    exact = std::fmax(exact, side);
  }
  ++exact_accepted_;
  new_bound_ = short_sum ? std::fmin(new_bound_, float_above(exact)) : float_above(exact);
  return Refusal::kNone;
}

Decimator::Refusal Decimator::check(std::uint32_t u, const Star& star, std::size_t at_ring) {
  if (!linked(star, at_ring)) return Refusal::kLink;
  const Refusal faces = check_faces(u, star, at_ring);
  if (faces != Refusal::kNone) return faces;
  return check_gap(u, star, at_ring);
}

void Decimator::commit(std::uint32_t u, const Star& star, std::size_t at_ring, std::uint32_t now) {
  const std::uint32_t v = star.ring[at_ring];
  for (std::size_t i = 0; i < star.faces; ++i) mesh_.face(star.corner[i] >> 2).bound = new_bound_;
  quadric_[v] += quadric_[u];
  update_error(v);
  mesh_.collapse(star, at_ring);
  // Whoever was refused near here gets another chance; those in the queue are looked at anyway.
  const auto wake = [&](std::uint32_t w) {
    tried_[w] = 0;
    if (!queue_.contains(w) && !(mesh_.state(w) & kVertexKept)) queue_.push(w, now);
  };
  wake(v);
  mesh_.for_each_neighbour(v, wake);
}

void Decimator::seed_queue() {
  std::array<Candidate, kMaxRing + 1> list;
  Star star;
  for (std::uint32_t u = 0; u < mesh_.vertices(); ++u) {
    if (mesh_.state(u) & kVertexKept) continue;
    if (!mesh_.gather(u, star)) continue;
    if (list_candidates(u, star, list) > 0) queue_.push(u, cost_class(list[0].cost, kCostClasses));
  }
}

void Decimator::run(DecimateReport& report) {
  seed_queue();
  std::array<Candidate, kMaxRing + 1> list;
  Star star;
  std::uint32_t u = 0, now = 0;
  while (queue_.pop(u, now)) {
    if (now > options_.max_cost_class) {
      report.stop = DecimateStop::kCostLimit;
      break;
    }
    if ((mesh_.state(u) & kVertexDead) || !mesh_.gather(u, star)) continue;
    const std::size_t n = list_candidates(u, star, list);
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint32_t cls = cost_class(list[i].cost, kCostClasses);
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
    }
  }
  report.exact_tests = exact_tests_;
  report.exact_accepted = exact_accepted_;
  report.reference_faces_walked = reference_gap_.walked();
}

}  // namespace tessera
