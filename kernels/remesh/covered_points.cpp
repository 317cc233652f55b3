#include "kernels/remesh/covered_points.h"

#include <algorithm>
#include <limits>

#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/triangle_foot.h"

namespace tessera {

namespace {

constexpr double kPointReach =
    4.0 / 3.0;  ///< limits: what is farther away lies beside the block, or cannot be helped
constexpr float kOwnRoom = 1.0f + 1e-6f;

}  // namespace

CoveredPoints::CoveredPoints(const CollapseMesh& mesh, std::span<const Double3> position,
                             std::span<const std::array<std::uint32_t, 3>> faces, double limit)
    : mesh_(mesh),
      position_(position),
      faces_(faces),
      first_(mesh.faces().size(), kEnd),
      next_(position.size() + kOfFace * faces.size(), kEnd),
      square_(next_.size(), static_cast<float>(limit * limit)) {
  std::vector<std::array<std::uint32_t, 3>> live;
  std::vector<std::uint32_t> number;
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) {
    const CollapseFace& face = mesh.face(f);
    if (face.state & kStateDead) continue;
    live.push_back({face.vertex[0], face.vertex[1], face.vertex[2]});
    number.push_back(f);
  }
  std::vector<Double3> at(mesh.vertices());
  for (std::uint32_t v = 0; v < at.size(); ++v) at[v] = mesh.at(v);
  const ClosestFaces surface(at, live, Double3{});
  std::uint32_t hint = ClosestFaces::kNone;
  for (std::uint32_t p = 0; p < next_.size(); ++p) {
    if (comes_again(p)) continue;
    const ClosestFaces::Hit near = surface.closest(point(p), kPointReach * kPointReach * limit * limit, hint);
    if (near.slot == ClosestFaces::kNone) continue;
    hint = near.slot;
    square_[p] = std::max(square_[p], static_cast<float>(near.square) * kOwnRoom);
    std::uint32_t& first = first_[number[surface.face(near.slot)]];
    next_[p] = first;
    first = p;
  }
}

Double3 CoveredPoints::point(std::size_t p) const {
  if (p < position_.size()) return position_[p];
  const std::size_t k = (p - position_.size()) % kOfFace;
  const std::array<std::uint32_t, 3>& f = faces_[(p - position_.size()) / kOfFace];
  if (k < 3) return (position_[f[k]] + position_[f[(k + 1) % 3]]) * 0.5;
  return (position_[f[0]] + position_[f[1]] + position_[f[2]]) * (1.0 / 3.0);
}

/// The middle of an edge that the face beside counts, too: of those at borders, half are left out.
bool CoveredPoints::comes_again(std::size_t p) const {
  if (p < position_.size()) return false;
  const std::size_t k = (p - position_.size()) % kOfFace;
  const std::array<std::uint32_t, 3>& f = faces_[(p - position_.size()) / kOfFace];
  return k < 3 && f[k] > f[(k + 1) % 3];
}

bool CoveredPoints::stay_near(std::span<const std::uint32_t> faces,
                              std::span<const std::array<Double3, 3>> made) const {
  const auto is_near = [&](std::uint32_t p) {
    const Double3 at = point(p);
    return std::any_of(made.begin(), made.end(), [&](const std::array<Double3, 3>& t) {
      return squared_distance(at, foot_in_triangle(at, t[0], t[1], t[2]).at) <=
             static_cast<double>(square_[p]);
    });
  };
  return std::all_of(faces.begin(), faces.end(), [&](std::uint32_t f) {
    for (std::uint32_t p = first_[f]; p != kEnd; p = next_[p])
      if (!is_near(p)) return false;
    return true;
  });
}

void CoveredPoints::hand_on(std::span<const std::uint32_t> faces, std::span<const std::uint32_t> made) {
  first_.resize(mesh_.faces().size(), kEnd);
  std::vector<std::uint32_t> points;
  for (const std::uint32_t f : faces) {
    for (std::uint32_t p = first_[f]; p != kEnd; p = next_[p]) points.push_back(p);
    first_[f] = kEnd;
  }
  for (const std::uint32_t p : points) {
    const Double3 at = point(p);
    std::uint32_t nearest = made.front();
    double minimum = std::numeric_limits<double>::max();
    for (const std::uint32_t f : made) {
      const std::uint32_t* v = mesh_.face(f).vertex;
      const double square =
          squared_distance(at, foot_in_triangle(at, mesh_.at(v[0]), mesh_.at(v[1]), mesh_.at(v[2])).at);
      if (square < minimum) minimum = square, nearest = f;
    }
    next_[p] = first_[nearest];
    first_[nearest] = p;
  }
}

std::size_t CoveredPoints::count(std::uint32_t face) const {
  std::size_t points = 0;
  for (std::uint32_t p = first_[face]; p != kEnd; p = next_[p]) ++points;
  return points;
}

}  // namespace tessera
