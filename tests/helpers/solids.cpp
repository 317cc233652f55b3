#include "tests/helpers/solids.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "octree/vector.h"

namespace tessera::test {
namespace {

Double3 along(const Double3& p, const Double3& d, double s) {
  return p + d * s;
}
/// Two unit vectors that complete `n`.
std::array<Double3, 2> frame(const Double3& n) {
  const Double3 t = unit(cross(n, std::abs(n[0]) < 0.7 ? Double3{1, 0, 0} : Double3{0, 1, 0}));
  return {t, cross(n, t)};
}

struct Axes {
  Double3 u = {1, 0, 0}, v = {0, 1, 0}, w = {0, 0, 1};
  explicit Axes(bool rotated) {
    if (!rotated) return;
    u = unit(Double3{0.8, 0.47, -0.31});
    v = unit(cross(Double3{0.2, -0.1, 0.9}, u));
    w = cross(u, v);
  }
  Double3 at(double a, double b, double c) const { return along(along(along({0, 0, 0}, u, a), v, b), w, c); }
};

double all(const std::vector<double>& f) {
  return *std::max_element(f.begin(), f.end());
}

void add_box_faces(const Double3& centre, const Double3& half, const Axes& axes, std::vector<Face>& faces) {
  const Double3 directions[3] = {axes.u, axes.v, axes.w};
  for (std::size_t c = 0; c < 3; ++c)
    for (const double side : {-1.0, 1.0})
      faces.push_back(
          {along(centre, directions[c], side * half[c]), along({0, 0, 0}, directions[c], side), 0});
}

}  // namespace

double Face::value(const Double3& p) const {
  const Double3 d = along(p, point, -1);
  if (radius == 0.0) return dot(d, normal);
  const Double3 r = along(d, normal, -dot(d, normal));
  return std::copysign(1.0, radius) * (std::sqrt(dot(r, r)) - std::abs(radius));
}

Double3 Face::gradient(const Double3& p) const {
  if (radius == 0.0) return normal;
  const Double3 d = along(p, point, -1);
  const Double3 r = unit(along(d, normal, -dot(d, normal)));
  return along({0, 0, 0}, r, std::copysign(1.0, radius));
}

double Solid::value(const Double3& p) const {
  std::vector<double> f;
  for (const Face& face : faces) f.push_back(face.value(p));
  return join(f);
}

Samples Solid::sample(const Double3& centre, double half_width, double spacing, Random& random) const {
  Samples out;
  for (const Face& face : faces) {
    const auto [s, t] = frame(face.normal);
    const Double3 middle = along(centre, face.normal, -dot(along(centre, face.point, -1), face.normal));
    const auto keep = [&](const Double3& p) {
      for (std::size_t c = 0; c < 3; ++c)
        if (std::abs(p[c] - centre[c]) > half_width) return false;
      return std::abs(value(p)) < 1e-9;
    };
    const int n = static_cast<int>(std::ceil(3.5 * half_width / spacing));
    const double radius = std::abs(face.radius);
    const int around = radius > 0 ? static_cast<int>(std::ceil(2 * std::numbers::pi * radius / spacing)) : n;
    for (int i = 0; i < around; ++i)
      for (int j = 0; j < n; ++j) {
        const double a = (i + random.unit()) / around, b = ((j + random.unit()) / n - 0.5) * 3.5 * half_width;
        Double3 p;
        if (radius > 0) {
          const double angle = 2 * std::numbers::pi * a;
          p = along(face.point, face.normal, b - dot(along(face.point, middle, -1), face.normal));
          p = along(along(p, s, radius * std::cos(angle)), t, radius * std::sin(angle));
        } else {
          p = along(along(middle, s, (a - 0.5) * 3.5 * half_width), t, b);
        }
        if (keep(p)) out.push_back({p, face.gradient(p), 0});
      }
  }
  return out;
}

double Solid::normal_error(const Double3& p, const Double3& n, double near) const {
  double best = std::numbers::pi;
  for (const Face& face : faces) {
    if (std::abs(face.value(p)) > near) continue;
    best = std::min(best, std::acos(std::clamp(dot(face.gradient(p), n), -1.0, 1.0)));
  }
  return best;
}

Solid make_box(const Double3& centre, const Double3& half, bool rotated) {
  Solid solid;
  add_box_faces(centre, half, Axes(rotated), solid.faces);
  solid.join = all;
  return solid;
}

Solid make_bored_block(const Double3& centre, const Double3& half, double bore, bool rotated) {
  Solid solid;
  const Axes axes(rotated);
  add_box_faces(centre, half, axes, solid.faces);
  solid.faces.push_back({along(centre, axes.u, 0.1), axes.w, -bore});
  solid.join = all;
  return solid;
}

Solid make_fandisk(const Double3& centre, double size, bool rotated) {
  Solid solid;
  const Axes axes(rotated);
  add_box_faces(centre, {size, 0.8 * size, 0.6 * size}, axes, solid.faces);  // 0..5
  // A roof plane that meets the top at 30 degrees, a flank of a large cylinder.
  solid.faces.push_back(
      {along(centre, axes.at(0.1 * size, 0, 0.6 * size), 1), axes.at(0.5, 0, std::sqrt(0.75)), 0});
  solid.faces.push_back({along(centre, axes.at(-0.6 * size, 0, 0), 1), axes.w, 1.4 * size});
  // A notch: everything above and behind is cut away.
  solid.faces.push_back({along(centre, axes.at(-0.3 * size, 0, 0), 1), axes.at(-1, 0, 0), 0});
  solid.faces.push_back({along(centre, axes.at(0, 0, 0.15 * size), 1), axes.at(0, 0, 1), 0});
  solid.join = [](const std::vector<double>& f) {
    double outer = f[0];
    for (std::size_t i = 1; i < 8; ++i) outer = std::max(outer, f[i]);
    return std::max(outer, std::min(f[8], f[9]));
  };
  return solid;
}

Solid make_slab(const Double3& centre, double thickness, bool gap, bool rotated) {
  Solid solid;
  const Axes axes(rotated);
  const double side = gap ? -1.0 : 1.0;
  solid.faces.push_back({along(centre, axes.w, 0.5 * thickness), along({0, 0, 0}, axes.w, side), 0});
  solid.faces.push_back({along(centre, axes.w, -0.5 * thickness), along({0, 0, 0}, axes.w, -side), 0});
  solid.join = [gap](const std::vector<double>& f) {
    return gap ? std::min(f[0], f[1]) : std::max(f[0], f[1]);
  };
  return solid;
}

Solid make_step(const Double3& centre, double height, bool rotated) {
  Solid solid;
  const Axes axes(rotated);
  solid.faces.push_back({along(centre, axes.w, -0.5 * height), axes.w, 0});
  solid.faces.push_back({along(centre, axes.w, 0.5 * height), axes.w, 0});
  solid.faces.push_back({centre, axes.u, 0});
  solid.join = [](const std::vector<double>& f) { return std::min(f[0], std::max(f[1], f[2])); };
  return solid;
}

}  // namespace tessera::test
