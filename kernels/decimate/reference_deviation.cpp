#include "kernels/decimate/reference_deviation.h"

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>
#include <utility>

namespace tessera {
namespace {

/// How far a corner must be moved to turn a triangle so that this counts, as a share of how wide triangles are there.
constexpr float kNoise = 1.0f / 32.0f;

/// Sets the place of the vertex in the frame of the polygon.
inline void set_place(const ReferenceMesh::Vertex& v, const Double3& origin, const LinkPolygon& polygon,
                      PolygonPoint& p) {
  // The fourth lane holds the stamp: cleared, or its bits would count as a subnormal number.
  const __m256d r = _mm256_sub_pd(_mm256_blend_pd(_mm256_load_pd(&v.at[0]), _mm256_setzero_pd(), 8),
                                  _mm256_set_pd(0.0, origin[2], origin[1], origin[0]));
  const __m128 f = _mm256_cvtpd_ps(r);
  const __m128 x = _mm_mul_ps(_mm_shuffle_ps(f, f, 0x00), _mm_load_ps(&polygon.frame[0]));
  const __m128 y = _mm_mul_ps(_mm_shuffle_ps(f, f, 0x55), _mm_load_ps(&polygon.frame[4]));
  const __m128 z = _mm_mul_ps(_mm_shuffle_ps(f, f, 0xaa), _mm_load_ps(&polygon.frame[8]));
  alignas(16) float at[4];
  _mm_store_ps(at, _mm_add_ps(_mm_add_ps(x, y), z));
  p.x = at[0], p.y = at[1], p.z = at[2];
}

/// How far left of a link edge the other corners of a side of a fan lie, on the mean, times the edge.
float mean_left_of(const ReferenceMesh& mesh, const LinkPolygon& polygon, const Double3& origin,
                   std::size_t edge, std::span<const std::uint32_t> side) {
  float sum = 0.0f, count = 0.0f;
  for (const std::uint32_t c : side)
    for (const std::uint32_t k : {next_corner(c), prev_corner(c)}) {
      const Double3 r = mesh.vertices[mesh.vertex(k)].at - origin;
      const float x = static_cast<float>(dot(r, polygon.ex)) - polygon.x[edge],
                  y = static_cast<float>(dot(r, polygon.ey)) - polygon.y[edge];
      sum += polygon.edge_x[edge] * y - polygon.edge_y[edge] * x;
      count += 1.0f;
    }
  return sum / count;
}

/// Of the sides between lines that a fan consists of, the one that lies most to the left of the link edge.
/// \pre a line runs before the fan's first corner
std::span<const std::uint32_t> side_at_edge(const ReferenceMesh& mesh, const LinkPolygon& polygon,
                                            const Double3& origin, std::size_t edge,
                                            std::span<const std::uint32_t> fan) {
  std::span<const std::uint32_t> best;
  float maximum = 0.0f;
  for (std::size_t i = 0, begin = 0; i < fan.size(); ++i) {
    if (!mesh.is_line(next_corner(fan[i]))) continue;
    const auto side = fan.subspan(begin, i + 1 - begin);
    begin = i + 1;
    const float left = mean_left_of(mesh, polygon, origin, edge, side);
    if (best.empty() || left > maximum) best = side, maximum = left;
  }
  return best;
}

/// Sets the deviation of a point where it is inside or, at a line of the link, beyond that; else 0.
inline float measure_point(const LinkPolygon& polygon, std::uint64_t lines, PolygonPoint& p) {
  classify(polygon, p);
  p.deviation = 0.0f;
  if (p.inside) {
    const std::size_t i = p.sector;
    p.deviation = std::fabs(p.z - polygon.slope_x[i] * p.x - polygon.slope_y[i] * p.y);
  } else if ((lines & ~p.link) != 0) {
    const float distance = distance_beyond_lines(polygon, lines, p);
    p.inside = distance >= 0.0f;
    if (p.inside) p.deviation = distance;
  }
  return p.deviation;
}

/// Room for a few more in a list whose filled part is `size` long.
template <class T>
void make_room(std::vector<T>& list, std::size_t size) {
  constexpr std::size_t kFew = 3;
  if (size + kFew > list.size()) list.resize(2 * list.size() + kFew);
}

}  // namespace

/// What is asked of a walk, in floats, and the largest deviation that it has found.
struct ReferenceDeviation::Walk {
  Walk(const LinkLoop& loop, const Query& query, const LinkPolygon& polygon)
      : origin(query.origin),
        limit(static_cast<float>(query.limit) * (1.0f - 0x1p-22f) - polygon.rounding()),
        min_cosine(static_cast<float>(query.min_cosine)),
        lines(loop.borders | (query.cross_creases ? 0u : loop.creases)),
        ends(loop.ends),
        covered(loop.ends),
        walls(query.cross_creases ? unsigned{kStateBorder} : kStateBorder | kStateCrease),
        free_corners(query.free_corners) {}

  /// \return false above the limit
  bool add(float found) {
    deviation = std::max(deviation, found);
    return deviation <= limit;
  }

  /// The ends of a line of the reference, where the walk ends. Where it leaves the polygon, its crossing of the link has been
  /// measured. \return false above the limit
  bool add_line(const LinkPolygon& polygon, const PolygonPoint& a, const PolygonPoint& b, float own) {
    const bool through = !a.inside && !b.inside;
    const float far2 = limit * limit * 4.0f + 1.0f;
    for (const PolygonPoint* p : {&a, &b})
      if ((p->inside || through) && !add(distance_to_lines(polygon, lines, ends, *p, far2) + own))
        return false;
    return true;
  }

  Double3 origin;
  std::uint32_t points = 0, steps = 0;  ///< how many there are
  float limit, min_cosine;
  std::uint64_t lines, ends;  ///< bits of the link's edges and corners that are such
  std::uint64_t covered;      ///< bits of corners found over the reference; vertices of lines do not move
  unsigned walls;             ///< states of edges that the walk does not cross
  bool free_corners;
  float deviation = 0.0f;
  std::uint32_t witness = kNoCorner;
};

ReferenceDeviation::Result ReferenceDeviation::measure(const LinkLoop& loop, const Query& query) {
  if (!make_polygon(loop, query.inner_centre, polygon_)) return {};
  Walk walk(loop, query, polygon_);
  Answer answer = begin_walk(query, walk);
  if (answer == Answer::kWithin) answer = go_on(walk);
  if (answer == Answer::kWithin && walk.free_corners && walk.covered != polygon_.corners)
    answer = Answer::kBeyond;
  if (answer != Answer::kWithin) return {answer, 0.0, walk.witness};
  const double rounding = static_cast<double>(polygon_.rounding());
  return {answer, static_cast<double>(walk.deviation) * (1.0 + 0x1p-22) + rounding};
}

/// Looks at the witness, then lays out the triangles at the seed: all, or with a flat edge those of its side.
ReferenceDeviation::Answer ReferenceDeviation::begin_walk(const Query& query, Walk& walk) {
  std::uint32_t slot = 0;
  make_room(points_, 0);
  stamp_ += 2;
  if (query.witness != kNoCorner && walk.lines == 0) {
    // What was too far from one star is often too far from the next: it costs one vertex to know.
    if (!add_point(query.witness, walk, slot)) {
      walk.witness = query.witness;
      return Answer::kBeyond;
    }
    walk.deviation = 0.0f;
    walk.points = 0;
    stamp_ += 2;
  }
  const bool on_line = query.flat_edge != kNoFlatEdge;
  const std::uint32_t first = mesh_.corner[query.seed],
                      start = on_line ? corner_behind_line(mesh_, query.seed) : first;
  if (start == kNoCorner) return Answer::kBeyond;
  const bool closed = gather_fan(mesh_, start, fan_);
  if (!closed && !(on_line && start == first)) return Answer::kBeyond;  // no side is cut in two
  std::span<const std::uint32_t> side = fan_;
  if (on_line) side = side_at_edge(mesh_, polygon_, query.origin, query.flat_edge, fan_);
  for (const std::uint32_t c : side) {
    mesh_.faces[c >> 2].stamp = stamp_;
    make_room(steps_, walk.steps);
    steps_[walk.steps++] = {c, 0, 0};
  }
  if (side.empty()) return Answer::kBeyond;
  if (!walk.free_corners || on_line) return Answer::kWithin;
  return add_point(query.seed, walk, slot) && points_[slot].inside ? Answer::kWithin : Answer::kBeyond;
}

/// The slot of the point of a vertex, measured when it is met first. \return false above the limit
/// \pre there is room for it
[[gnu::always_inline]] inline bool ReferenceDeviation::add_point(std::uint32_t vertex, Walk& walk,
                                                                 std::uint32_t& slot) {
  ReferenceMesh::Vertex& v = mesh_.vertices[vertex];
  if (v.stamp == stamp_) {
    slot = v.slot;
    return true;
  }
  v.stamp = stamp_;
  slot = v.slot = walk.points;
  PolygonPoint& p = points_[walk.points++];
  set_place(v, walk.origin, polygon_, p);
  return walk.add(measure_point(polygon_, walk.lines, p));
}

/// Looks at all triangles that there are to look at, and at those that turn up.
ReferenceDeviation::Answer ReferenceDeviation::go_on(Walk& from) {
  Walk walk = from;  // a copy that nothing else may change stays in registers
  Answer answer = Answer::kWithin;
  std::uint32_t i = 0;
  for (const std::uint32_t seeds = walk.steps; i < seeds && answer == Answer::kWithin; ++i)
    answer = visit<true>(i, walk);
  // First in, first out: what a triangle touches is on its way from memory when its turn comes.
  for (; i < walk.steps && answer == Answer::kWithin; ++i) answer = visit<false>(i, walk);
  walked_ += i;
  from = walk;
  return answer;
}

/// Looks at one triangle, and adds those across its edges to the steps. From the corner of the step on; the edge opposite it is
/// the one across which the walk came, but where it starts.
template <bool kSeed>
[[gnu::always_inline]] inline ReferenceDeviation::Answer ReferenceDeviation::visit(std::uint32_t at,
                                                                                   Walk& walk) {
  static constexpr std::array<std::uint8_t, 4> kNext = {1, 2, 0, 0}, kBefore = {2, 0, 1, 0};
  make_room(points_, walk.points);
  make_room(steps_, walk.steps);
  const Step step = steps_[at];
  ReferenceMesh::Face& face = mesh_.faces[step.corner >> 2];
  face.stamp = stamp_ + 1;
  const std::uint32_t a = step.corner & 3u, b = kNext[a], c = kBefore[a];
  std::uint32_t slot_a = 0, slot_b = step.next, slot_c = step.prev;
  const auto add = [&](std::uint32_t corner, std::uint32_t& slot) {
    const bool within = add_point(face.vertex[corner], walk, slot);
    if (!within) walk.witness = face.vertex[corner];
    return within;
  };
  if (!add(a, slot_a)) return Answer::kBeyond;
  if (kSeed && (!add(b, slot_b) || !add(c, slot_c))) return Answer::kBeyond;
  const PolygonTriangle p = {&points_[slot_a], &points_[slot_b], &points_[slot_c]};
  if (is_folded(polygon_, p)) return Answer::kFolded;
  if (const float own = face.bound();
      own > 0.0f && !walk.add(own + std::max({p[0]->deviation, p[1]->deviation, p[2]->deviation})))
    return Answer::kBeyond;
  if (walk.free_corners) {
    const CornerDeviation above = corner_deviation(polygon_, p);
    walk.covered |= above.corners;
    if (!walk.add(above.deviation)) return Answer::kBeyond;
  }
  if (walk.min_cosine > -1.0f && normal_deviates(face, p, walk.min_cosine, walk.limit))
    return Answer::kNormalDeviates;
  if (kSeed && !leave(face, a, slot_b, slot_c, walk)) return Answer::kBeyond;
  return leave(face, b, slot_c, slot_a, walk) && leave(face, c, slot_a, slot_b, walk) ? Answer::kWithin
                                                                                      : Answer::kBeyond;
}

/// Measures the edge opposite a corner of a triangle, and goes across it if it meets the polygon.
/// \param next, prev  slots of its ends
/// \return false above the limit, or where the reference ends
[[gnu::always_inline]] inline bool ReferenceDeviation::leave(const ReferenceMesh::Face& face,
                                                             std::uint32_t corner, std::uint32_t next,
                                                             std::uint32_t prev, Walk& walk) {
  const std::uint32_t o = face.opposite[corner];
  const bool ends = o == kNoCorner;
  ReferenceMesh::Face& across = mesh_.faces[ends ? 0 : o >> 2];
  if (!ends && across.stamp == stamp_ + 1) return true;  // seen from there
  const PolygonPoint &a = points_[next], &b = points_[prev];
  if (a.sector != b.sector || a.sector == 0) {
    // The same bits from either side of the edge.
    const PolygonPoint &left = b.x < a.x ? b : a, &right = b.x < a.x ? a : b;
    if (!a.inside && !b.inside && !meets_polygon(polygon_, left, right)) return true;
    const float own = std::max(face.bound(), ends ? 0.0f : across.bound());
    if (!walk.add(crossing_deviation(polygon_, left, right, own))) return false;
  }
  if (face.lines >> corner & walk.walls) return walk.add_line(polygon_, a, b, face.bound());
  if (ends) return false;
  if (across.stamp == stamp_) return true;
  across.stamp = stamp_;
  steps_[walk.steps++] = {o, prev, next};
  _mm_prefetch(&mesh_.vertices[across.vertex[o & 3u]], _MM_HINT_T0);
  for (const std::uint32_t ahead : across.opposite)
    if (ahead != kNoCorner) _mm_prefetch(&mesh_.faces[ahead >> 2], _MM_HINT_T0);
  return true;
}

/// Whether the triangle turns too far against one of the new faces that it lies over.
bool ReferenceDeviation::normal_deviates(const ReferenceMesh::Face& face, const PolygonTriangle& p,
                                         float min_cosine, float limit) const {
  const Float3 from = {p[0]->x, p[0]->y, p[0]->z}, a = Float3{p[1]->x, p[1]->y, p[1]->z} - from,
               b = Float3{p[2]->x, p[2]->y, p[2]->z} - from, n = cross(a, b);
  const float size = norm(n);
  if (!(size > 0.0f)) return false;
  // A thin triangle among wide ones turns far where one of its corners moves a little: that says nothing of the
  // surface.
  const float longest = std::sqrt(std::max({dot(a, a), dot(b, b), dot(b - a, b - a)}));
  const float height = std::max(
      {mesh_.max_height[face.vertex[0]], mesh_.max_height[face.vertex[1]], mesh_.max_height[face.vertex[2]]});
  const float noise = std::min(kNoise * height, 0.5f * limit) * longest;
  for (std::uint64_t bits = overlapped_sectors(polygon_, p); bits != 0; bits &= bits - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(bits));
    const float along = (n[2] - polygon_.slope_x[i] * n[0] - polygon_.slope_y[i] * n[1]) * polygon_.cosine[i];
    const bool explained = along > 0.0f && size * size - along * along <= noise * noise;
    if (along < min_cosine * size && !explained) return true;
  }
  return false;
}

}  // namespace tessera
