#include "kernels/extract/bend_sample.h"

#include <cmath>

#include "octree/vector.h"

namespace tessera {
namespace {

/// Where all normals of each sheet are so near to each other (2.6 degrees) the crease is straight enough.
constexpr double kFlatCosine = 0.999;
/// A chord nearer than this to the crease stays, in cells: half of what is asked of a sample.
constexpr double kNearChord = 0.01;
/// A chord of a circle is a quarter of its own length off at most here: what is farther is no bend.
constexpr double kFarChord = 0.25;
/// Part of the chord at both ends in which there is no sample.
constexpr double kEnds = 0.2;
constexpr int kRounds = 2;

}  // namespace

bool sample_bend(const CreaseSpan& span, double sheet_cos, Double3& x) {
  TangentPlanes planes;
  std::array<int, kMaxPlanes> sheet;
  planes.size = 0;
  bool bent = false;
  const std::array<Double3, 2> of = {span.planes.normal[span.beside[0]], span.planes.normal[span.beside[1]]};
  for (std::size_t i = 0; i < span.planes.size; ++i) {
    const Double3& n = span.planes.normal[i];
    const double first = dot(n, of[0]), second = dot(n, of[1]);
    const int nearest = second > first ? 1 : 0;
    const double cosine = nearest == 0 ? first : second;
    bent = bent || cosine < kFlatCosine;
    if (cosine < sheet_cos) continue;
    planes.point[planes.size] = span.planes.point[i];
    planes.normal[planes.size] = n;
    planes.offset[planes.size] = span.planes.offset[i];
    sheet[planes.size++] = nearest;
  }
  if (!bent) return false;
  const Double3 chord = span.end[1] - span.end[0];
  const double square = dot(chord, chord);
  const Double3 middle = (span.end[0] + span.end[1]) * 0.5;
  x = middle;
  for (int round = 0; round < kRounds; ++round) {
    TangentPlanes bent_planes = planes;
    for (std::size_t i = 0; i < planes.size; ++i) {
      const Double3 d = planes.point[i] - x;
      bent_planes.weight[i] = 1.0 / (kPlaneNearness + dot(d, d));
    }
    for (const int s : {0, 1}) extrapolate_normals(bent_planes, sheet, s, x);
    x = intersect_planes(bent_planes, x, 2).position;
  }
  const Double3 from = x - span.end[0];
  const double along = dot(from, chord) / square;
  const Double3 off = from - chord * along;
  const double off_square = dot(off, off);
  return off_square > kNearChord * kNearChord && off_square < kFarChord * kFarChord * square &&
         along > kEnds && along < 1.0 - kEnds;
}

}  // namespace tessera
