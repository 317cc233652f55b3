#include "kernels/extract/feature_sample.h"

#include <algorithm>
#include <cmath>

#include "kernels/extract/tangent_planes.h"
#include "octree/portable_math.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Sine of the smallest angle between the extreme normals, or of what lacks to 180 degrees.
constexpr float kMinSine = 0.02f;
/// A crease from whose planes its own point is farther than this, while their normals spread by more than
/// that (smallest to largest singular value) in all directions, is a corner.
constexpr double kCreaseResidual = 0.02;
constexpr double kCornerSpread = 0.15;
constexpr double kCornerMargin = 0.5;
/// Part of the heights of roots over the other side's planes that may have the wrong sign.
constexpr float kSideDoubt = 0.25f;
/// How far a sample may leave its cell: wedges poke out of theirs, noise throws samples out.
constexpr float kExactMargin = 1.0f;
constexpr float kNoisyMargin = 0.25f;
constexpr int kHalvings = 4;
/// Smallest height of a triangle: coordinates in a brick are floats below 64, exact to 2^-18.
constexpr float kMinHeight = 1.0f / 2048;

/// A segment from one side of a crease to the other will be flipped, so what counts are the triangles up to the point
/// of the crease beside the segment's middle, beyond which the next sample lies: (centre, a, it) and (it, b, centre).
/// A sample in the very face of the segment has that point behind it, so what counts is the way on through the face.
bool crosses_soundly(const LoopSamples& loop, std::size_t i, std::size_t j, const Float3& centre,
                     const FeatureThresholds& thresholds) {
  if (!(dot(loop.normal[i], loop.normal[j]) < thresholds.cone_cos)) return false;
  const Float3 zero = {0, 0, 0};
  const Float3 crease = triangle_normal(zero, loop.normal[i], loop.normal[j]);
  const Float3 delta = (loop.point[i] + loop.point[j]) * 0.5f - centre;
  const float length2 = dot(crease, crease);
  if (!(length2 > kMinSine * kMinSine)) return false;
  const float along = dot(delta, crease) / length2;
  if (!thresholds.in_faces || along * along * length2 > kMinHeight * kMinHeight) {
    const Float3 shifted = centre + crease * along;
    return dot(triangle_normal(centre, loop.point[i], shifted), loop.normal[i]) > 0.0f &&
           dot(triangle_normal(shifted, loop.point[j], centre), loop.normal[j]) > 0.0f;
  }
  // Roots kept off a node may stand beyond each other's planes, so there each triangle faces one of the two.
  const int face = common_face(loop.edge[i], loop.edge[j]);
  const float out = crease[static_cast<std::size_t>(face >> 1)] * (face & 1 ? 1.0f : -1.0f);
  const Float3 beyond = out > 0.0f ? centre + crease : centre - crease,
               both = loop.normal[i] + loop.normal[j];
  return out != 0.0f && dot(triangle_normal(centre, loop.point[i], beyond), both) > 0.0f &&
         dot(triangle_normal(beyond, loop.point[j], centre), both) > 0.0f;
}

bool fan_is_sound(const LoopSamples& loop, const Float3& centre, const FeatureThresholds& thresholds) {
  const float margin = thresholds.exact ? kExactMargin : kNoisyMargin;
  for (float c : centre)
    if (!(c >= -margin && c <= 1.0f + margin)) return false;
  const auto size = static_cast<std::size_t>(loop.size);
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t j = i + 1 == size ? 0 : i + 1;
    const Float3 up = triangle_normal(loop.point[i], loop.point[j], centre);
    if (is_sliver(loop.point[i], loop.point[j], centre)) return false;
    if (dot(up, loop.normal[i]) + dot(up, loop.normal[j]) > 0.0f) continue;
    if (!thresholds.exact || !crosses_soundly(loop, i, j, centre, thresholds)) return false;
  }
  return true;
}

Double3 mass_point(const LoopSamples& loop) {
  Double3 mass = {0, 0, 0};
  const auto size = static_cast<std::size_t>(loop.size);
  for (std::size_t i = 0; i < size; ++i)
    for (std::size_t k = 0; k < 3; ++k) mass[k] += static_cast<double>(loop.point[i][k]);
  for (double& m : mass) m /= static_cast<double>(size);
  return mass;
}

/// Moves a point on a crease to the middle of the crease's way through the cell, if it passes the cell at
/// all: the point nearest to the loop's roots may lie outside, and its fan would turn.
void centre_in_cell(Double3& x, const Double3& direction) {
  double from = -1e9, to = 1e9;
  for (std::size_t k = 0; k < 3; ++k) {
    const double d = direction[k];
    if (std::fabs(d) < 1e-9) {
      if (x[k] < 0.0 || x[k] > 1.0) return;
      continue;
    }
    const double s0 = -x[k] / d;
    const double s1 = (1.0 - x[k]) / d;
    from = std::max(from, std::min(s0, s1));
    to = std::min(to, std::max(s0, s1));
  }
  if (!(from < to)) return;
  for (std::size_t k = 0; k < 3; ++k) x[k] += 0.5 * (from + to) * direction[k];
}

TangentPlanes tangent_planes(const LoopSamples& loop) {
  TangentPlanes planes;
  planes.size = static_cast<std::size_t>(loop.size);
  for (std::size_t i = 0; i < planes.size; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      planes.point[i][k] = static_cast<double>(loop.point[i][k]);
      planes.normal[i][k] = static_cast<double>(loop.normal[i][k]);
    }
    planes.offset[i] = static_cast<double>(loop.offset[i]);
    planes.weight[i] = 1.0;
  }
  return planes;
}

/// Three sheets at shallow angles pass the cone test as a crease, but no line lies in all three planes.
bool is_hidden_corner(const TangentPlanes& planes, const Double3& on_crease, const Double3& mass,
                      Double3& corner) {
  double worst = 0.0;
  for (std::size_t i = 0; i < planes.size; ++i) {
    double off = -planes.offset[i];
    for (std::size_t k = 0; k < 3; ++k) off += planes.normal[i][k] * (on_crease[k] - planes.point[i][k]);
    worst = std::max(worst, std::fabs(off));
  }
  if (!(worst > kCreaseResidual)) return false;
  const PlaneIntersection point = intersect_planes(planes, mass, 3);
  if (!(point.min_spread > kCornerSpread * kCornerSpread)) return false;
  corner = point.position;
  for (const double c : corner)
    if (!(c >= -kCornerMargin && c <= 1.0 + kCornerMargin)) return false;
  return true;
}

/// Middle of the crease's way between the faces through which it leaves the loop: a loop shares each of these points
/// with the loop across, so samples follow each other along the crease, also where a wedge pokes out of its cells.
/// \returns false where the loop is not passed once, or along a face
bool centre_between_faces(const LoopSamples& loop, std::size_t first, std::size_t second,
                          const Double3& direction, Double3& x) {
  const auto size = static_cast<std::size_t>(loop.size);
  const auto on_first = [&](std::size_t i) {
    return dot(loop.normal[i], loop.normal[first]) >= dot(loop.normal[i], loop.normal[second]);
  };
  double along = 0.0;
  int passed = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t j = i + 1 == size ? 0 : i + 1;
    if (on_first(i) == on_first(j)) continue;
    for (std::size_t k = 0; k < 3; ++k)
      along += direction[k] *
               (0.5 * (static_cast<double>(loop.point[i][k]) + static_cast<double>(loop.point[j][k])) - x[k]);
    ++passed;
  }
  if (passed != 2) return false;
  for (std::size_t k = 0; k < 3; ++k) x[k] += 0.5 * along * direction[k];
  return true;
}

/// A feature of a loop as its normals tell it.
struct Feature {
  bool corner = false;
  std::array<std::size_t, 3>
      extreme{};        ///< one root of each sheet: two of a crease, and the third of a corner
  Double3 direction{};  ///< of the crease, unit
};

/// Solves anew about a first guess, with planes bent towards it and weighted by nearness.
Double3 refined(const LoopSamples& loop, const FeatureThresholds& thresholds, const Feature& feature,
                const Double3& first) {
  TangentPlanes planes = tangent_planes(loop);
  const int sheets = feature.corner ? 3 : 2;
  const auto normal_of = [&](int s) { return loop.normal[feature.extreme[static_cast<std::size_t>(s)]]; };
  std::array<int, kMaxPlanes> sheet;
  for (std::size_t i = 0; i < planes.size; ++i) {
    sheet[i] = 0;
    for (int s = 1; s < sheets; ++s)
      if (dot(loop.normal[i], normal_of(s)) > dot(loop.normal[i], normal_of(sheet[i]))) sheet[i] = s;
    double squared = kPlaneNearness;
    for (std::size_t k = 0; k < 3; ++k) {
      const double d = planes.point[i][k] - first[k];
      squared += d * d;
    }
    planes.weight[i] = 1.0 / squared;
  }
  for (int s = 0; s < sheets; ++s) {
    bool smooth = true;  // a sheet with a crease of its own has no curvature to fit
    for (std::size_t i = 0; i < planes.size; ++i)
      smooth &= sheet[i] != s || dot(loop.normal[i], normal_of(s)) > thresholds.cone_cos;
    if (smooth) extrapolate_normals(planes, sheet, s, first);
  }
  return intersect_planes(planes, first, sheets).position;
}

/// Across a convex crease every root lies below the planes of the other side, across a concave one above.
/// Noise in the normals alone tilts planes without moving roots, and gives both.
bool sides_agree(const LoopSamples& loop, std::size_t first, std::size_t second) {
  float above = 0.0f, below = 0.0f;
  const auto size = static_cast<std::size_t>(loop.size);
  const auto on_first = [&](std::size_t i) {
    return dot(loop.normal[i], loop.normal[first]) >= dot(loop.normal[i], loop.normal[second]);
  };
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = 0; j < size; ++j) {
      if (on_first(i) == on_first(j)) continue;
      Float3 d;
      for (std::size_t k = 0; k < 3; ++k) d[k] = loop.point[j][k] - loop.point[i][k];
      const float height = dot(loop.normal[i], d) - loop.offset[i];
      (height > 0.0f ? above : below) += std::fabs(height);
    }
  }
  return std::min(above, below) <= kSideDoubt * std::max(above, below);
}

}  // namespace

bool is_sliver(const Float3& a, const Float3& b, const Float3& c) {
  const auto squared = [](const Float3& p, const Float3& q) {
    const Float3 d = p - q;
    return dot(d, d);
  };
  const Float3 up = triangle_normal(a, b, c);
  const float longest = std::max({squared(a, b), squared(b, c), squared(c, a)});
  return !(dot(up, up) > kMinHeight * kMinHeight * longest);
}

FeatureThresholds feature_thresholds(double feature_angle_deg, double corner_angle_deg) {
  FeatureThresholds t;
  t.cone_cos = static_cast<float>(cosine_of_degrees(feature_angle_deg));
  // Two normals within half the angle of a third are within the angle of each other; the margin covers
  // rounding.
  t.quick_dot = static_cast<float>(cosine_of_degrees(0.5 * feature_angle_deg)) + 1e-5f;
  t.corner_sin = static_cast<float>(cosine_of_degrees(90.0 - corner_angle_deg));
  return t;
}

FeatureSample sample_feature(const LoopSamples& loop, const FeatureThresholds& thresholds) {
  FeatureSample sample;
  const auto size = static_cast<std::size_t>(loop.size);
  float minimum = 2.0f;
  std::size_t first = 0, second = 0;
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = i + 1; j < size; ++j) {
      const float d = dot(loop.normal[i], loop.normal[j]);
      if (d < minimum) {
        minimum = d;
        first = i;
        second = j;
      }
    }
  }
  if (!(minimum < thresholds.cone_cos)) return sample;

  const Float3 zero = {0, 0, 0};
  const Float3 crease = triangle_normal(zero, loop.normal[first], loop.normal[second]);
  const float length = norm(crease);
  if (!(length > kMinSine)) {  // two sheets back to back have no crease between them
    sample.kind = FeatureKind::kRejected;
    return sample;
  }
  float deviation = 0.0f;
  std::size_t farthest = first;
  for (std::size_t i = 0; i < size; ++i) {
    const float d = std::fabs(dot(crease, loop.normal[i]));
    if (d > deviation) {
      deviation = d;
      farthest = i;
    }
  }
  const bool corner = deviation > thresholds.corner_sin * length;

  if (!corner && !sides_agree(loop, first, second)) {
    sample.kind = FeatureKind::kRejected;
    return sample;
  }
  Feature feature{corner, {first, second, farthest}, {}};
  for (std::size_t k = 0; k < 3; ++k)
    feature.direction[k] = static_cast<double>(crease[k]) / static_cast<double>(length);
  const Double3 mass = mass_point(loop);
  const TangentPlanes planes = tangent_planes(loop);
  Double3 nearest;
  if (corner) {
    nearest = intersect_planes(planes, mass, 3).position;
  } else {
    nearest = intersect_crease(planes, mass, feature.direction, first);
    Double3 better;
    if (is_hidden_corner(planes, nearest, mass, better)) {
      nearest = better;
      feature.corner = true;
    }
  }
  const auto sound = [&](const Double3& x) {
    sample.position = narrow(x);
    return fan_is_sound(loop, sample.position, thresholds);
  };
  // Along a crease there is a choice. Of exact samples the first that is sound is true; noise makes others fit by chance.
  const bool choice = thresholds.exact && !feature.corner;
  Double3 guess = nearest;
  const bool between = choice && centre_between_faces(loop, first, second, feature.direction, guess);
  if (!feature.corner && !between) centre_in_cell(guess, feature.direction);
  const Double3 best = refined(loop, thresholds, feature, guess);
  bool found = sound(best) || (choice && sound(refined(loop, thresholds, feature, nearest)));
  if (!found && between) {
    guess = nearest;
    centre_in_cell(guess, feature.direction);
    found = sound(refined(loop, thresholds, feature, guess));
  }
  sample.on_feature = found;
  double stay = 1.0;
  for (int halving = 0; !found && halving < kHalvings; ++halving) {
    stay *= 0.5;
    found = sound(mass + (best - mass) * stay);
  }
  sample.kind = !found           ? FeatureKind::kRejected
                : feature.corner ? FeatureKind::kCorner
                                 : FeatureKind::kCrease;
  return sample;
}

}  // namespace tessera
