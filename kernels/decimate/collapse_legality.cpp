#include "kernels/decimate/collapse_legality.h"

#include <immintrin.h>

#include <cmath>

#include "kernels/mesh/mean_ratio.h"
#include "octree/lanes.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr double kMinSquaredCosine = 0.04;  ///< of the angle that a face may turn by

/// Bits of the places in the ring, of `size` vertices, that hold this vertex.
inline std::uint64_t places_of(const Star& star, std::size_t size, std::uint32_t w) {
  const __m256i wanted = _mm256_set1_epi32(static_cast<int>(w));
  const auto equal = [&](std::size_t i) {
    const __m256i ring = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(&star.ring[i]));
    return static_cast<std::uint64_t>(
               _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(ring, wanted))))
           << i;
  };
  std::uint64_t places = equal(0);  // most rings fit one register
  for (std::size_t i = kLanes; i < size; i += kLanes) places |= equal(i);
  return places & ((std::uint64_t{1} << size) - 1);
}

}  // namespace

bool follows_lines(const CollapseMesh& mesh, std::uint32_t u, const Star& star, std::size_t at) {
  if (mesh.state(star.ring[at]) & kVertexPinched) return false;
  if (mesh.state(u) & kVertexBorder) return is_border_spoke(star, at);
  if (mesh.state(u) & kVertexCrease) return is_crease_spoke(mesh, star, at);
  return true;
}

bool is_collapse_ok(const CollapseMesh& mesh, const Star& star, std::size_t at) {
  const std::uint32_t v = star.ring[at];
  const std::size_t size = star.ring_size();
  std::uint64_t common = 0;
  std::size_t shared = 0;
  mesh.for_each_neighbour(v, [&](std::uint32_t w) {
    const std::uint64_t places = places_of(star, size, w);
    common |= places;
    shared += places != 0;
  });
  if (shared != (star.closed ? 2u : 1u)) return false;
  if (mesh.state(v) & kVertexLocked)
    for (std::size_t i = 0; i < size; ++i)
      if (i != at && (common >> i & 1u) == 0 && (mesh.state(star.ring[i]) & kVertexLocked)) return false;
  if (!star.closed)
    return star.faces > 1 || mesh.opposite(star.corner[0]) != kNoCorner;  // or hangs on another block
  if (star.faces != 3) return star.faces > 3;
  // Of a tetrahedron the last face would double.
  const std::uint32_t outer = mesh.opposite(star.corner[(at + 1) % 3]);
  return outer != kNoCorner && mesh.vertex(outer) != v;
}

double min_mean_ratio_around(const CollapseMesh& mesh, const Star& star, const Double3& p,
                             std::size_t left_out) {
  double minimum = 1.0;
  for (std::size_t i = 0; i < star.faces; ++i) {
    const std::size_t j = star.following(i);
    if (i != left_out && j != left_out)
      minimum = std::fmin(minimum, mean_ratio(p, mesh.at(star.ring[i]), mesh.at(star.ring[j])));
  }
  return minimum;
}

CollapseRefusal check_new_faces(const CollapseMesh& mesh, std::uint32_t u, const Star& star, std::size_t at,
                                double min_mean_ratio) {
  const Double3 pu = mesh.at(u), pv = mesh.at(star.ring[at]);
  // Squares compare as well as what they are of, and need no roots.
  const double minimum = min_mean_ratio * min_mean_ratio / 12.0;
  bool thin = false;
  for (std::size_t i = 0; i < star.faces; ++i) {
    const std::size_t j = star.following(i);
    if (i == at || j == at) continue;
    const Double3 &a = mesh.at(star.ring[i]), &b = mesh.at(star.ring[j]);
    const Double3 link_edge = b - a, to_u = pu - a, to_v = pv - a, last = pv - b;
    const Double3 before = cross(link_edge, to_u), after = cross(link_edge, to_v);
    const double along = dot(before, after), before2 = dot(before, before), after2 = dot(after, after);
    if (!(after2 > 0.0) || along < 0.0 || along * along < kMinSquaredCosine * before2 * after2)
      return CollapseRefusal::kFold;
    const double edges = dot(link_edge, link_edge) + dot(to_v, to_v) + dot(last, last);
    thin = thin || after2 < minimum * edges * edges;
  }
  if (!thin) return CollapseRefusal::kNone;
  const bool worse =
      min_mean_ratio_around(mesh, star, pv, at) < min_mean_ratio_around(mesh, star, pu, star.ring_size());
  return worse ? CollapseRefusal::kShape : CollapseRefusal::kNone;
}

}  // namespace tessera
