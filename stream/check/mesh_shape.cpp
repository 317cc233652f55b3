#include "stream/check/mesh_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/mesh/flat_faces.h"
#include "octree/portable_math.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr double kLargestExtent = 1e100;  // its cube, the scale of volumes, stays finite

double degrees_of_cotangent(double cotangent) {
  return 180.0 / kPi * std::atan2(1.0, cotangent);
}

}  // namespace

MeshShape::MeshShape(const Double3& min, const Double3& max) {
  const Double3 extent = max - min;
  const double largest = std::max({extent[0], extent[1], extent[2]});
  usable_ = largest > 0.0 && largest < kLargestExtent;
  if (!usable_) return;
  for (std::size_t axis = 0; axis < 3; ++axis) centre_[axis] = min[axis] + 0.5 * extent[axis];
  edges_ = FixedSum(2.0 * largest);
  area_ = FixedSum(2.0 * largest * largest);
  volume_ = FixedSum(2.0 * largest * largest * largest);
  min_edge2_ = 4.0 * largest * largest;
  max_cotangent_ = -std::numeric_limits<double>::infinity();
  min_cotangent_ = std::numeric_limits<double>::infinity();
}

void MeshShape::add(const Double3& a, const Double3& b, const Double3& c, bool flip) {
  if (!usable_) return;
  const Double3 ab = b - a, ac = c - a, bc = c - b;
  const double sides[3] = {dot(ab, ab), dot(ac, ac), dot(bc, bc)};
  const double longest = std::max({sides[0], sides[1], sides[2]});
  min_edge2_ = std::min({min_edge2_, sides[0], sides[1], sides[2]});
  max_edge2_ = std::max(max_edge2_, longest);
  for (const double side : sides) edges_.add(std::sqrt(side));
  const Double3 normal = cross(ab, ac);
  const double twice_area = std::sqrt(dot(normal, normal));
  area_.add(0.5 * twice_area);
  const double six_volumes = dot(a - centre_, cross(b - centre_, c - centre_));
  volume_.add(flip ? six_volumes / -6.0 : six_volumes / 6.0);
  ++faces_;
  if (FaceExtent{twice_area, longest}.is_flat()) {
    ++zero_area_;
    return;
  }
  const double shortest = std::min({sides[0], sides[1], sides[2]});
  edge_ratio2_ = std::max(edge_ratio2_, longest / shortest);
  const double cotangents[3] = {dot(ab, ac) / twice_area, -dot(ab, bc) / twice_area,
                                dot(ac, bc) / twice_area};
  max_cotangent_ = std::max({max_cotangent_, cotangents[0], cotangents[1], cotangents[2]});
  min_cotangent_ = std::min({min_cotangent_, cotangents[0], cotangents[1], cotangents[2]});
  if (pass_ != nullptr) pass_->add(a, b, c, flip);
  const double aspect = longest / twice_area * 0.8660254037844386;  // longest edge / (2 A / longest edge)
  const auto bin = std::upper_bound(kAspectBounds.begin(), kAspectBounds.end(), aspect);
  ++aspect_[static_cast<std::size_t>(bin - kAspectBounds.begin())];
}

void MeshShape::store(MeshCheck& check) const {
  check.has_shape = usable_ && faces_ > 0;
  if (!check.has_shape) return;
  check.area = area_.value();
  check.volume = check.solid() ? volume_.value() : 0.0;
  check.min_edge = std::sqrt(min_edge2_);
  check.max_edge = std::sqrt(max_edge2_);
  check.mean_edge = edges_.value() / (3.0 * static_cast<double>(faces_));
  check.zero_area_faces = zero_area_;
  if (faces_ > zero_area_) {
    check.min_angle_deg = degrees_of_cotangent(max_cotangent_);
    check.max_angle_deg = degrees_of_cotangent(min_cotangent_);
    check.max_edge_ratio = std::sqrt(edge_ratio2_);
  }
  check.aspect_histogram = aspect_;
}

}  // namespace tessera
