#include "tests/helpers/oriented_samples.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "octree/morton.h"
#include "octree/vector.h"

namespace tessera::test {
void add_face(const Double3& corner, const Double3& u, const Double3& v, const Double3& n, double spacing,
              const std::function<bool(const Double3&)>& keep, Random& random, Samples& out) {
  const int rows = std::max(1, static_cast<int>(std::ceil(norm(u) / spacing)));
  const int columns = std::max(1, static_cast<int>(std::ceil(norm(v) / spacing)));
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) {
      const double a = (i + random.unit()) / rows, b = (j + random.unit()) / columns;
      Sample s;
      for (std::size_t c = 0; c < 3; ++c) s.p[c] = corner[c] + a * u[c] + b * v[c];
      s.n = n;
      if (!keep || keep(s.p)) out.push_back(s);
    }
}

void add_box(const Double3& low, const Double3& high, double spacing, Random& random, Samples& out) {
  const Double3 x = {high[0] - low[0], 0, 0}, y = {0, high[1] - low[1], 0}, z = {0, 0, high[2] - low[2]};
  add_face(low, x, y, {0, 0, -1}, spacing, {}, random, out);
  add_face({low[0], low[1], high[2]}, x, y, {0, 0, 1}, spacing, {}, random, out);
  add_face(low, y, z, {-1, 0, 0}, spacing, {}, random, out);
  add_face({high[0], low[1], low[2]}, y, z, {1, 0, 0}, spacing, {}, random, out);
  add_face(low, z, x, {0, -1, 0}, spacing, {}, random, out);
  add_face({low[0], high[1], low[2]}, z, x, {0, 1, 0}, spacing, {}, random, out);
}

void add_cylinder(const Double3& base, double radius, double height, double spacing, bool outward,
                  const std::function<bool(const Double3&)>& keep, Random& random, Samples& out) {
  const int around = static_cast<int>(std::ceil(2 * std::numbers::pi * radius / spacing));
  const int up = static_cast<int>(std::ceil(height / spacing));
  const double sign = outward ? 1.0 : -1.0;
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < up; ++j) {
      const double angle = 2 * std::numbers::pi * (i + random.unit()) / around;
      const double cx = std::cos(angle), cy = std::sin(angle);
      const Double3 p = {base[0] + radius * cx, base[1] + radius * cy,
                         base[2] + height * (j + random.unit()) / up};
      if (!keep || keep(p)) out.push_back({p, {sign * cx, sign * cy, 0}, 0});
    }
}

void add_sphere(const Double3& centre, double radius, double spacing, Random& random, Samples& out) {
  const int n = static_cast<int>(4 * std::numbers::pi * radius * radius / (spacing * spacing));
  const double jitter = spacing / radius * 0.5;
  for (int i = 0; i < n; ++i) {
    const double z = 1.0 - 2.0 * (i + random.unit()) / n;
    const double ring = std::sqrt(std::max(0.0, 1.0 - z * z));
    const double angle = 2.39996322972865332 * i + jitter * (random.unit() - 0.5);
    const Double3 d = {ring * std::cos(angle), ring * std::sin(angle), z};
    out.push_back({{centre[0] + radius * d[0], centre[1] + radius * d[1], centre[2] + radius * d[2]}, d, 0});
  }
}

void add_torus(const Double3& centre, double ring, double tube, double spacing, Random& random,
               Samples& out) {
  const int around = static_cast<int>(std::ceil(2 * std::numbers::pi * tube / spacing));
  for (int i = 0; i < around; ++i) {
    const double a = 2 * std::numbers::pi * i / around;
    const int along =
        static_cast<int>(std::ceil(2 * std::numbers::pi * (ring + tube * std::cos(a)) / spacing));
    for (int j = 0; j < along; ++j) {
      const double v = a + 2 * std::numbers::pi * (random.unit() - 0.5) / around;
      const double u = 2 * std::numbers::pi * (j + random.unit()) / along;
      const Double3 n = {std::cos(v) * std::cos(u), std::cos(v) * std::sin(u), std::sin(v)};
      out.push_back({{centre[0] + ring * std::cos(u) + tube * n[0],
                      centre[1] + ring * std::sin(u) + tube * n[1], centre[2] + tube * n[2]},
                     n,
                     0});
    }
  }
}

void add_noise(double deviation, Random& random, Samples& samples) {
  for (Sample& s : samples) {
    const double d = deviation * random.gaussian();
    for (std::size_t c = 0; c < 3; ++c) s.p[c] += d * s.n[c];
  }
}

PointBlock make_block(const Samples& samples, const Int3& origin, const Int3& cells, int halo, bool colour) {
  struct Keyed {
    std::uint64_t high, low;
    Int3 q;
    std::uint32_t normal, rgba;
  };
  std::vector<Keyed> keyed;
  for (const Sample& s : samples) {
    Keyed point{};
    bool inside = true;
    for (std::size_t c = 0; c < 3; ++c) {
      point.q[c] = static_cast<std::int32_t>(std::floor(s.p[c] * kQuantaPerCell + 0.5));
      inside = inside && point.q[c] >= (origin[c] - halo) * kQuantaPerCell &&
               point.q[c] < (origin[c] + cells[c] + halo) * kQuantaPerCell;
    }
    if (!inside) continue;
    const auto bits = [&](int shift, std::uint32_t mask) {
      return morton_encode(static_cast<std::uint32_t>(point.q[0]) >> shift & mask,
                           static_cast<std::uint32_t>(point.q[1]) >> shift & mask,
                           static_cast<std::uint32_t>(point.q[2]) >> shift & mask);
    };
    point.high = bits(15, 0x7fff);
    point.low = bits(0, 0x7fff);
    point.normal =
        encode_normal(static_cast<float>(s.n[0]), static_cast<float>(s.n[1]), static_cast<float>(s.n[2]));
    point.rgba = s.rgba;
    keyed.push_back(point);
  }
  std::sort(keyed.begin(), keyed.end(), [](const Keyed& a, const Keyed& b) {
    return std::tie(a.high, a.low, a.normal, a.rgba) < std::tie(b.high, b.low, b.normal, b.rgba);
  });
  PointBlock block;
  block.origin = origin;
  block.cells = cells;
  const auto cell = [&](const Keyed& point, std::size_t c) {
    return static_cast<float>(point.q[c] - origin[c] * kQuantaPerCell) / static_cast<float>(kQuantaPerCell);
  };
  for (const Keyed& point : keyed) {
    block.x.push_back(cell(point, 0));
    block.y.push_back(cell(point, 1));
    block.z.push_back(cell(point, 2));
    const Float3 n = point.normal == kNoNormal ? Float3{0, 0, 0} : decode_normal(point.normal);
    block.nx.push_back(n[0]);
    block.ny.push_back(n[1]);
    block.nz.push_back(n[2]);
    if (colour) block.rgba.push_back(point.rgba);
  }
  return block;
}

}  // namespace tessera::test
