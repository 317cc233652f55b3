#include "kernels/edit/normal_displacement.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/edge_faces.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoFace = 0xffffffffu;
constexpr double kUnits = 65535.0;
constexpr int kNewtonSteps = 8;  ///< five do; more where normals turn much within a face
constexpr int kMaxFaces = 24;    ///< that one walk visits
constexpr double kInside = 1e-9;
/// Of the diagonal: what rounding of u and v may leave beside the normal. Half of what is promised.
constexpr double kLeft = 5e-7;

std::uint16_t units(double share) {
  return static_cast<std::uint16_t>(std::clamp(share, 0.0, 1.0) * kUnits + 0.5);
}

/// Two unit vectors across the normal, the first one along a side of the face.
std::array<Double3, 2> tangents(const Double3& side, const Double3& n) {
  const Double3 along = side - n * dot(n, side);
  const Double3 first =
      norm(along) > 1e-12 * norm(side) && norm(side) > 0.0 ? unit(along) : any_orthogonal(n);
  return {first, cross(n, first)};
}

/// Where on the face, as weights of corners 1 and 2, clamped into it.
void feet(const Double3& p, const Double3& a, const Double3& b, const Double3& c, double& u, double& v) {
  // Ericson, Real-Time Collision Detection, 5.1.5.
  const Double3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp),
               d6 = dot(ac, cp);
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  u = v = 0.0;
  if (d1 <= 0.0 && d2 <= 0.0) return;
  if (d3 >= 0.0 && d4 <= d3) {
    u = 1.0;
  } else if (d6 >= 0.0 && d5 <= d6) {
    v = 1.0;
  } else if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
    u = d1 > d3 ? d1 / (d1 - d3) : 0.0;
  } else if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
    v = d2 > d6 ? d2 / (d2 - d6) : 0.0;
  } else if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
    const double sum = (d4 - d3) + (d5 - d6);
    v = sum > 0.0 ? (d4 - d3) / sum : 0.0;
    u = 1.0 - v;
  } else {
    u = vb / (va + vb + vc);
    v = vc / (va + vb + vc);
  }
}

}  // namespace

BaseState::BaseState(std::span<const Double3> position, Faces faces)
    : position_(position), faces_(faces), normal_(position.size(), Double3{}) {
  for (const auto& f : faces) {
    const Double3 n = unit_or_zero(triangle_normal(position[f[0]], position[f[1]], position[f[2]]));
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 a = unit_or_zero(position[f[(k + 1) % 3]] - position[f[k]]),
                    b = unit_or_zero(position[f[(k + 2) % 3]] - position[f[k]]);
      normal_[f[k]] = normal_[f[k]] + n * angle_between(a, b);
    }
  }
  for (Double3& n : normal_) n = unit_or_zero(n);
}

Double3 BaseState::at(std::uint32_t face, double u, double v, Double3& normal) const {
  const auto& f = faces_[face];
  const double w = 1.0 - u - v;
  normal = normal_[f[0]] * w + normal_[f[1]] * u + normal_[f[2]] * v;
  const double length = norm(normal);
  normal = length > 1e-3 ? normal * (1.0 / length)
                         : unit_or_zero(triangle_normal(position_[f[0]], position_[f[1]], position_[f[2]]));
  return position_[f[0]] * w + position_[f[1]] * u + position_[f[2]] * v;
}

Double3 BaseState::decode(const NormalDisplacement& d, const TangentRest* rest) const {
  const std::uint32_t face = d.face & ~kHasTangent;
  Double3 n;
  Double3 p = at(face, d.u / kUnits, d.v / kUnits, n);
  p = p + n * static_cast<double>(d.height);
  if (rest != nullptr && norm(n) > 0.0) {
    const auto& f = faces_[face];
    const auto [along, across] = tangents(position_[f[1]] - position_[f[0]], n);
    p = p + along * static_cast<double>(rest->along) + across * static_cast<double>(rest->across);
  }
  return p;
}

DisplacementEncoder::DisplacementEncoder(const BaseState& base)
    : base_(&base),
      closest_(base.position(), base.faces(), base.position().empty() ? Double3{} : base.position().front()),
      beyond_(base.faces().size(), {kNoFace, kNoFace, kNoFace}) {
  const std::vector<std::uint32_t> opposite = opposite_half_edges(base.position().size(), base.faces());
  for (std::uint32_t h = 0; h < opposite.size(); ++h)
    if (opposite[h] != kNoHalfEdge) beyond_[h / 3][(h % 3 + 2) % 3] = opposite[h] / 3;
}

bool DisplacementEncoder::walk(const Double3& p, std::uint32_t& face, double& u, double& v) const {
  std::uint32_t before = kNoFace;
  for (int visited = 0; visited < kMaxFaces; ++visited) {
    const auto& f = base_->faces()[face];
    const Double3 &a = base_->position()[f[0]], &na = base_->normal()[f[0]];
    const Double3 e1 = base_->position()[f[1]] - a, e2 = base_->position()[f[2]] - a;
    const Double3 m1 = base_->normal()[f[1]] - na, m2 = base_->normal()[f[2]] - na;
    // p = a + u e1 + v e2 + t (na + u m1 + v m2)
    double t = 0.0;
    for (int step = 0; step < kNewtonSteps; ++step) {
      const Double3 n = na + m1 * u + m2 * v;
      const Double3 r = p - a - e1 * u - e2 * v - n * t;
      const Double3 c1 = e1 + m1 * t, c2 = e2 + m2 * t;
      const double det = dot(c1, cross(c2, n));
      if (!(std::fabs(det) > 1e-12 * norm(e1) * norm(e2))) return false;
      const double du = dot(r, cross(c2, n)) / det, dv = dot(c1, cross(r, n)) / det,
                   dt = dot(c1, cross(c2, r)) / det;
      u += du;
      v += dv;
      t += dt;
      if (std::fabs(du) + std::fabs(dv) < 1e-12) break;
      if (!(std::fabs(u) < 1e3 && std::fabs(v) < 1e3)) return false;
    }
    const std::array<double, 3> weight = {1.0 - u - v, u, v};
    const std::size_t minimum =
        static_cast<std::size_t>(std::min_element(weight.begin(), weight.end()) - weight.begin());
    if (weight[minimum] >= -kInside) return true;
    const std::uint32_t next = beyond_[face][minimum];
    if (next == kNoFace) return false;
    if (next == before) return weight[minimum] > -1e-5;  // between two faces: either will do
    before = face;
    face = next;
    const auto& g = base_->faces()[face];
    feet(p, base_->position()[g[0]], base_->position()[g[1]], base_->position()[g[2]], u, v);
  }
  return false;
}

NormalDisplacement DisplacementEncoder::encode(const Double3& p, double diagonal, TangentRest& rest) const {
  const ClosestFaces::Hit hit =
      closest_.closest(p - closest_.origin(), std::numeric_limits<double>::infinity(), ClosestFaces::kNone);
  const std::uint32_t nearest = closest_.face(hit.slot);
  const auto start = [&](double& u, double& v) {
    const auto& f = base_->faces()[nearest];
    feet(p, base_->position()[f[0]], base_->position()[f[1]], base_->position()[f[2]], u, v);
  };
  std::uint32_t face = nearest;
  double u = 0.0, v = 0.0;
  start(u, v);
  const auto set_height = [&](NormalDisplacement& d, Double3& left) {
    d.u = units(u);
    d.v = std::min(units(v), static_cast<std::uint16_t>(65535 - d.u));
    Double3 n;
    const Double3 b = base_->at(face, d.u / kUnits, d.v / kUnits, n);
    const Double3 offset = p - b;
    d.face = face;
    d.height = static_cast<float>(dot(offset, n));
    left = offset - n * static_cast<double>(d.height);
    return n;
  };
  NormalDisplacement d;
  Double3 left;
  rest = {};
  if (walk(p, face, u, v)) {
    set_height(d, left);
    // A normal that leads far away leads to another sheet: as far as thrice the distance is plausible.
    const double max_height = 3.0 * std::sqrt(hit.square) + 10.0 * kLeft * diagonal;
    if (norm(left) <= kLeft * diagonal && std::fabs(d.height) <= max_height) return d;
  }
  face = nearest;
  start(u, v);
  const Double3 n = set_height(d, left);
  if (norm(left) <= kLeft * diagonal) return d;
  const auto& f = base_->faces()[face];
  if (norm(n) > 0.0) {
    const auto [along, across] = tangents(base_->position()[f[1]] - base_->position()[f[0]], n);
    rest.along = static_cast<float>(dot(left, along));
    rest.across = static_cast<float>(dot(left, across));
  }
  d.face |= kHasTangent;
  return d;
}

}  // namespace tessera
