#include "kernels/smooth/surface_window.h"

#include "octree/portable_math.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Standard deviation of the likeness of normals, degrees: less than a crease, more than filtered noise.
constexpr double kLikeAngle = 6.5;
/// Faces less alike do not belong to the window.
constexpr float kMinLikeness = 0.1F;

}  // namespace

SurfaceWindow::SurfaceWindow(const MeshBlock& block, const FaceCorners& corners,
                             std::span<const Float3> normals, std::span<const Double3> data,
                             std::span<const Double3> position, std::span<const std::uint8_t> known)
    : block_(block),
      corners_(corners),
      normals_(normals),
      data_(data),
      position_(position),
      known_(known),
      vertex_stamp_(block.position.size(), 0),
      face_mark_(block.faces.size()) {
  const double width = 2.0 * sin_cos(kLikeAngle * (kPi / 360.0)).sin;
  inverse_width_ = static_cast<float>(0.5 / (width * width));
}

void SurfaceWindow::begin(std::uint32_t vertex, const Double3& normal, std::span<const std::uint32_t> faces) {
  const Double3 a = any_orthogonal({normal[0], normal[1], normal[2]});
  frame_.origin = position_[vertex];
  frame_.n = normal;
  frame_.a = {a[0], a[1], a[2]};
  frame_.b = cross(normal, frame_.a);
  samples_.clear();
  taken_.clear();
  right_ = known_.empty() || known_[vertex] != 0;
  square_ = 0.0;
  stamp_ += 2;
  faces_.clear();
  waiting_.clear();
  next_face_ = 0;
  quadric_ = {};
  laplacians_ = false;
  for (const std::uint32_t f : faces) {
    likeness(f, narrow(normal));
    face_mark_[f].stamp = stamp_ + 1;
    faces_.push_back({f, 0});
  }
}

void SurfaceWindow::expect(const std::array<double, 6>& quadric) {
  quadric_ = quadric;
  laplacians_ = true;
}

Float3 SurfaceWindow::expected_normal(std::uint32_t vertex) const {
  if (!laplacians_) return narrow(frame_.n);
  const Double3 d = position_[vertex] - frame_.origin;
  const double s = dot(d, frame_.a), t = dot(d, frame_.b);
  const double slope_s = quadric_[1] + 2.0 * quadric_[3] * s + quadric_[4] * t,
               slope_t = quadric_[2] + quadric_[4] * s + 2.0 * quadric_[5] * t;
  return narrow(unit_or_zero(frame_.n - frame_.a * slope_s - frame_.b * slope_t));
}

float SurfaceWindow::likeness(std::uint32_t face, const Float3& expected) {
  FaceMark& mark = face_mark_[face];
  if (mark.stamp >= stamp_) return mark.likeness;
  const Float3& n = normals_[face];
  const float x = n[0] - expected[0], y = n[1] - expected[1], z = n[2] - expected[2];
  mark = {stamp_, bell((x * x + y * y + z * z) * inverse_width_)};
  return mark.likeness;
}

void SurfaceWindow::visit(std::uint32_t vertex, int ring) {
  if (vertex_stamp_[vertex] == stamp_) return;
  vertex_stamp_[vertex] = stamp_;
  if (!known_.empty() && known_[vertex] == 0) right_ = false;
  const Double3 apart = position_[vertex] - frame_.origin;
  if (dot(apart, apart) < square_) {
    take(vertex, ring);
  } else {
    waiting_.push_back({vertex, ring});
  }
}

void SurfaceWindow::take(std::uint32_t vertex, int ring) {
  const auto star = corners_.at(vertex);
  const Float3 expected = expected_normal(vertex);
  float sum = 0.0F;
  for (const std::uint32_t corner : star) {
    const std::uint32_t f = corner >> 2;
    const float like = likeness(f, expected);
    sum += like;
    if (like < kMinLikeness || face_mark_[f].stamp != stamp_ || ring + 1 >= kRings) continue;
    face_mark_[f].stamp = stamp_ + 1;
    faces_.push_back({f, ring});
  }
  const Double3 d = data_[vertex] - frame_.origin;
  const float mean = sum / static_cast<float>(star.size());
  samples_.add(dot(d, frame_.a), dot(d, frame_.b), dot(d, frame_.n), static_cast<double>(mean));
  taken_.push_back({vertex, ring, mean});
}

void SurfaceWindow::grow(double radius) {
  square_ = radius * radius;
  std::size_t kept = 0;
  // take() may let more wait: they are beyond the radius too.
  for (std::size_t i = 0, count = waiting_.size(); i < count; ++i) {
    const QueueEntry r = waiting_[i];
    const Double3 apart = position_[r.index] - frame_.origin;
    if (dot(apart, apart) < square_) {
      take(r.index, r.ring);
    } else {
      waiting_[kept++] = r;
    }
  }
  waiting_.resize(kept);
  for (; next_face_ < faces_.size(); ++next_face_) {
    const QueueEntry face = faces_[next_face_];
    for (const std::uint32_t u : block_.faces[face.index]) visit(u, face.ring + 1);
  }
}

}  // namespace tessera
