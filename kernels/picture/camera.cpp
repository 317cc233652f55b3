#include "kernels/picture/camera.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "octree/error.h"
#include "octree/portable_math.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr double kTanHalfAngle = 0.2679491924311227;  // 15 degrees: a long lens, little distortion
constexpr double kMargin = 1.10;                      // free frame around the data, also holds the caption

/// Frame of the up direction: right and the direction to the viewer of `front`.
struct Stand {
  Double3 right, front, up;
};
Stand stand_of(const Double3& up_in) {
  const Double3 up = unit(up_in);
  Double3 right = {1, 0, 0};
  if (std::abs(up[0]) > 0.9) right = {0, 1, 0};
  right = unit(right + up * -dot(right, up));
  return {right, cross(right, up), up};
}

Double3 direction(const Stand& s, double azimuth_deg, double elevation_deg) {
  const double a = azimuth_deg * kPi / 180.0;
  const double e = elevation_deg * kPi / 180.0;
  const Double3 flat = s.front * std::cos(a) + s.right * std::sin(a);
  return unit(flat * std::cos(e) + s.up * std::sin(e));
}

Camera oriented(const ViewSpec& view, double aspect) {
  Camera camera;
  camera.back = unit(view.back);
  camera.right = unit(cross(view.up, camera.back));
  camera.up = cross(camera.back, camera.right);
  camera.orthographic = view.orthographic;
  camera.half_height = kTanHalfAngle;
  camera.half_width = kTanHalfAngle * aspect;
  return camera;
}

}  // namespace

std::array<float, 16> Camera::view_matrix() const {
  const auto f = [](double v) { return static_cast<float>(v); };
  return {f(right[0]),         f(up[0]),         f(back[0]),         0.0f,
          f(right[1]),         f(up[1]),         f(back[1]),         0.0f,
          f(right[2]),         f(up[2]),         f(back[2]),         0.0f,
          f(-dot(right, eye)), f(-dot(up, eye)), f(-dot(back, eye)), 1.0f};
}

std::array<float, 16> Camera::projection_matrix() const {
  std::array<float, 16> m{};
  const double depth = far_plane - near_plane;
  m[0] = static_cast<float>(1.0 / half_width);
  m[5] = static_cast<float>(1.0 / half_height);
  if (orthographic) {
    m[10] = static_cast<float>(-2.0 / depth);
    m[14] = static_cast<float>(-(far_plane + near_plane) / depth);
    m[15] = 1.0f;
  } else {
    m[10] = static_cast<float>(-(far_plane + near_plane) / depth);
    m[11] = -1.0f;
    m[14] = static_cast<float>(-2.0 * far_plane * near_plane / depth);
  }
  return m;
}

ViewSpec parse_view(const std::string& text, const Double3& up) {
  const Stand s = stand_of(up);
  ViewSpec view;
  view.name = text;
  view.up = s.up;
  const auto axis = [&](const Double3& back, double sign) { view.back = back * sign; };
  const auto orbit = [&](double azimuth, double elevation) {
    view.back = direction(s, azimuth, elevation);
    view.orthographic = false;
  };
  if (text == "front") {
    axis(s.front, 1.0);
  } else if (text == "back") {
    axis(s.front, -1.0);
  } else if (text == "right") {
    axis(s.right, 1.0);
  } else if (text == "left") {
    axis(s.right, -1.0);
  } else if (text == "top") {
    axis(s.up, 1.0);
    view.up = s.front * -1.0;  // as a map: the far side is up
  } else if (text == "bottom") {
    axis(s.up, -1.0);
    view.up = s.front;
  } else if (text == "iso") {
    orbit(35.0, 25.0);
  } else if (text == "iso2") {
    orbit(215.0, 25.0);
  } else if (text.rfind("turn:", 0) == 0) {
    const std::string digits = text.substr(5);
    char* end = nullptr;
    const double degrees = std::strtod(digits.c_str(), &end);
    if (digits.empty() || *end != '\0' || !std::isfinite(degrees)) {
      throw UsageError("view " + text + ": expected turn:DEGREES, e.g. turn:45");
    }
    orbit(degrees, 20.0);
    view.name = "turn " + digits;
  } else {
    throw UsageError("view " + text +
                     ": unknown view; use front, back, left, right, top, bottom, iso, iso2, turn:DEGREES, or "
                     "custom with an eye and a target");
  }
  return view;
}

ViewSpec eye_view(const Double3& eye, const Double3& target, const Double3& up) {
  const Double3 back = eye - target;
  if (!(dot(back, back) > 0.0)) throw UsageError("eye and target are the same point");
  ViewSpec view;
  view.name = "custom";
  view.back = unit(back);
  view.up = unit(up);
  // Straight up or down: any other direction serves as up.
  const Double3 side = cross(view.up, view.back);
  if (dot(side, side) < 1e-6) view.up = stand_of(up).front;
  view.orthographic = false;
  view.has_eye = true;
  view.eye = eye;
  return view;
}

Camera fit_camera(const ViewSpec& view, std::span<const Float3> points, double aspect, double zoom) {
  Camera camera = oriented(view, aspect);
  if (view.has_eye) {
    camera.eye = view.eye;
    camera.half_width /= zoom;
    camera.half_height /= zoom;
    return camera;
  }
  const auto coordinate = [&](const Float3& p, const Double3& axis) {
    return static_cast<double>(p[0]) * axis[0] + static_cast<double>(p[1]) * axis[1] +
           static_cast<double>(p[2]) * axis[2];
  };
  constexpr double kInf = std::numeric_limits<double>::infinity();
  // Orthographic bounds; in perspective the bounding planes of the frustum, whose apex is then the eye.
  double x0 = kInf, x1 = -kInf, y0 = kInf, y1 = -kInf, z1 = -kInf, z0 = kInf;
  const double tx = camera.orthographic ? 0.0 : camera.half_width / kMargin;
  const double ty = camera.orthographic ? 0.0 : camera.half_height / kMargin;
  for (const Float3& p : points) {
    const double x = coordinate(p, camera.right), y = coordinate(p, camera.up),
                 z = coordinate(p, camera.back);
    x0 = std::min(x0, x - z * tx);
    x1 = std::max(x1, x + z * tx);
    y0 = std::min(y0, y - z * ty);
    y1 = std::max(y1, y + z * ty);
    z0 = std::min(z0, z);
    z1 = std::max(z1, z);
  }
  const double cx = 0.5 * (x0 + x1), cy = 0.5 * (y0 + y1);
  const double smallest = std::max({(z1 - z0) * 1e-3, std::abs(z1) * 1e-6, 1e-12});
  double z = z1 + smallest;
  if (camera.orthographic) {
    const double half = std::max({0.5 * (y1 - y0), 0.5 * (x1 - x0) / aspect, smallest});
    camera.half_height = half * kMargin / zoom;
    camera.half_width = camera.half_height * aspect;
  } else {
    z = std::max({0.5 * (x1 - x0) / tx, 0.5 * (y1 - y0) / ty, z1 + smallest});
    camera.half_width /= zoom;
    camera.half_height /= zoom;
  }
  camera.eye = camera.right * cx + camera.up * cy + camera.back * z;
  return camera;
}

Camera focus_camera(const ViewSpec& view, const Double3& centre, double radius, double aspect, double zoom) {
  Camera camera = oriented(view, aspect);
  if (view.has_eye) {
    camera.eye = view.eye;
    camera.half_width /= zoom;
    camera.half_height /= zoom;
    return camera;
  }
  const double half = radius / std::min(1.0, aspect) / zoom;
  if (camera.orthographic) {
    camera.half_height = half;
    camera.half_width = half * aspect;
    camera.eye = centre + camera.back * radius;
  } else {
    camera.eye = centre + camera.back * (half / kTanHalfAngle);
  }
  return camera;
}

std::optional<Double2> position_in_view(const Camera& camera, const Double3& place) {
  const Double3 from_eye = place - camera.eye;
  const double depth = -dot(from_eye, camera.back);
  if (!camera.orthographic && !(depth > 0.0)) return std::nullopt;
  const double wide = camera.orthographic ? 1.0 : depth;
  return Double2{dot(from_eye, camera.right) / (wide * camera.half_width),
                 dot(from_eye, camera.up) / (wide * camera.half_height)};
}

void set_depth_range(Camera& camera, const Double3& low, const Double3& high) {
  double nearest = std::numeric_limits<double>::infinity();
  double farthest = -nearest;
  for (int corner = 0; corner < 8; ++corner) {
    const Double3 p = {(corner & 1) != 0 ? high[0] : low[0], (corner & 2) != 0 ? high[1] : low[1],
                       (corner & 4) != 0 ? high[2] : low[2]};
    const double distance = dot(camera.back, camera.eye - p);
    nearest = std::min(nearest, distance);
    farthest = std::max(farthest, distance);
  }
  const double slack = std::max((farthest - nearest) * 0.01, std::max(std::abs(farthest), 1e-30) * 1e-5);
  camera.near_plane = nearest - slack;
  camera.far_plane = farthest + slack;
  if (!camera.orthographic) {
    camera.far_plane = std::max(camera.far_plane, slack);
    camera.near_plane = std::max(camera.near_plane, camera.far_plane * 1e-4);
  }
}

}  // namespace tessera
