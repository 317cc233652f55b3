#include "tests/helpers/analytic_field.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "octree/vector.h"

namespace tessera::test {
namespace {

Double3 to_double(const Int3& n) {
  return {static_cast<double>(n[0]), static_cast<double>(n[1]), static_cast<double>(n[2])};
}

double to_unit_interval(std::uint64_t hash) {
  return static_cast<double>(hash >> 11) * 0x1p-53;
}

EdgeRoot find_root(const Shape& shape, const Int3& node, int axis, const AnalyticFieldOptions& options) {
  const auto a = static_cast<std::size_t>(axis);
  Double3 p = to_double(node);
  const double start = p[a];
  const bool starts_inside = shape(p).value < 0.0;
  double lo = 0.0, hi = 1.0;
  for (int i = 0; i < 60; ++i) {
    const double mid = 0.5 * (lo + hi);
    p[a] = start + mid;
    ((shape(p).value < 0.0) == starts_inside ? lo : hi) = mid;
  }
  const double t = 0.5 * (lo + hi);
  p[a] = start + t;
  const Double3 n = unit_or_zero(shape(p).gradient);
  EdgeRoot root;
  root.t = static_cast<float>(std::clamp(t, 1.0 / 64, 63.0 / 64));
  root.normal = {static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])};
  root.offset = static_cast<float>(n[a] * (t - static_cast<double>(root.t)));
  root.rgba = options.rgba ? options.rgba(p) : 0;
  return root;
}

}  // namespace

Shape half_space(const Double3& point, const Double3& outward) {
  const Double3 n = unit_or_zero(outward);
  return [=](const Double3& x) { return ShapeSample{dot(n, x - point), n}; };
}

Shape ball(const Double3& centre, double radius) {
  return [=](const Double3& x) {
    const Double3 d = x - centre;
    return ShapeSample{norm(d) - radius, unit_or_zero(d)};
  };
}

Shape cylinder(const Double3& point, const Double3& direction, double radius) {
  const Double3 n = unit_or_zero(direction);
  return [=](const Double3& x) {
    Double3 d = x - point;
    d = d - n * dot(n, d);
    return ShapeSample{norm(d) - radius, unit_or_zero(d)};
  };
}

Shape torus(const Double3& centre, double ring_radius, double tube_radius) {
  return [=](const Double3& x) {
    Double3 d = x - centre;
    const double r = std::max(1e-300, std::sqrt(d[0] * d[0] + d[1] * d[1]));
    const double off = r - ring_radius;
    d = {d[0] / r * off, d[1] / r * off, d[2]};
    return ShapeSample{norm(d) - tube_radius, unit_or_zero(d)};
  };
}

Shape box(const Double3& min, const Double3& max) {
  Shape s = half_space(min, {-1, 0, 0});
  s = intersect(s, half_space(min, {0, -1, 0}));
  s = intersect(s, half_space(min, {0, 0, -1}));
  s = intersect(s, half_space(max, {1, 0, 0}));
  s = intersect(s, half_space(max, {0, 1, 0}));
  return intersect(s, half_space(max, {0, 0, 1}));
}

Shape intersect(Shape a, Shape b) {
  return [a = std::move(a), b = std::move(b)](const Double3& x) {
    const ShapeSample p = a(x), q = b(x);
    return p.value >= q.value ? p : q;
  };
}

Shape unite(Shape a, Shape b) {
  return [a = std::move(a), b = std::move(b)](const Double3& x) {
    const ShapeSample p = a(x), q = b(x);
    return p.value <= q.value ? p : q;
  };
}

Shape subtract(Shape a, Shape b) {
  return intersect(std::move(a), [b = std::move(b)](const Double3& x) {
    const ShapeSample s = b(x);
    return ShapeSample{-s.value, s.gradient * -1.0};
  });
}

DirectedField build_field(const Int3& origin, const Int3& cells,
                          const std::function<double(const Int3&)>& value,
                          const std::function<bool(const Int3&, double value)>& valid,
                          const std::function<EdgeRoot(const Int3&, int axis)>& root) {
  DirectedField field;
  field.origin = origin;
  field.cells = cells;
  const Int3 dims = field.leaf_dims();
  const auto in_block = [&](int i, int j, int k) {
    return i >= -1 && j >= -1 && k >= -1 && i <= cells[0] + 1 && j <= cells[1] + 1 && k <= cells[2] + 1;
  };
  for (int lk = -1; lk < dims[2] - 1; ++lk) {
    for (int lj = -1; lj < dims[1] - 1; ++lj) {
      for (int li = -1; li < dims[0] - 1; ++li) {
        BandLeaf leaf(origin, {li * 8, lj * 8, lk * 8});
        LeafWords nodes{};
        bool any = false;
        for (int b = 0; b < 512; ++b) {
          const int i = leaf.origin[0] + (b & 7), j = leaf.origin[1] + (b >> 3 & 7),
                    k = leaf.origin[2] + (b >> 6);
          if (!in_block(i, j, k)) continue;
          const Int3 node = {origin[0] + i, origin[1] + j, origin[2] + k};
          const double f = value(node);
          if (!valid(node, f)) continue;
          any = true;
          const std::uint64_t bit = std::uint64_t{1} << (b & 63);
          leaf.value(static_cast<std::size_t>(b)) = static_cast<float>(f);
          nodes[static_cast<std::size_t>(b >> 6)] |= bit;
          if (f < 0.0) leaf.inside[static_cast<std::size_t>(b >> 6)] |= bit;
        }
        field.leaf_index.push_back(any ? static_cast<std::int32_t>(field.leaves.size()) : -1);
        leaf.set_valid(nodes);
        if (any) field.leaves.push_back(std::move(leaf));
      }
    }
  }
  for (BandLeaf& leaf : field.leaves) {
    const LeafWords valid_nodes = leaf.valid();
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      for (std::size_t w = 0; w < 8; ++w) {
        leaf.first_root[a][w] = static_cast<std::uint32_t>(field.roots.size());
        for (std::uint64_t left = valid_nodes[w]; left; left &= left - 1) {
          const int b = std::countr_zero(left);
          const Int3 node = {leaf.origin[0] + (b & 7), leaf.origin[1] + (b >> 3),
                             leaf.origin[2] + static_cast<int>(w)};
          Int3 end = node;
          ++end[a];
          if (!in_block(end[0], end[1], end[2])) continue;
          const BandLeaf* other = field.leaf_at(end[0], end[1], end[2]);
          if (!other) continue;
          if (!other->is_valid(BandLeaf::node(end[0], end[1], end[2]))) continue;
          const auto ow = static_cast<std::size_t>(DirectedField::word(end[2]));
          const int ob = DirectedField::bit(end[0], end[1]);
          if ((other->inside[ow] >> ob & 1) == (leaf.inside[w] >> b & 1)) continue;
          leaf.crossing[a][w] |= std::uint64_t{1} << b;
          field.roots.push_back(root({origin[0] + node[0], origin[1] + node[1], origin[2] + node[2]}, axis));
        }
      }
    }
  }
  return field;
}

DirectedField make_field(const Shape& shape, const Int3& origin, const Int3& cells,
                         const AnalyticFieldOptions& options) {
  return build_field(
      origin, cells, [&](const Int3& n) { return shape(to_double(n)).value; },
      [&](const Int3& n, double f) {
        return (options.band_cells <= 0.0 || std::fabs(f) <= options.band_cells) &&
               (!options.valid || options.valid(n));
      },
      [&](const Int3& n, int axis) { return find_root(shape, n, axis, options); });
}

std::uint64_t node_hash(const Int3& node, std::uint64_t salt) {
  std::uint64_t h = salt * 0x9e3779b97f4a7c15ULL;
  for (const int c : node) {
    h += static_cast<std::uint64_t>(c) + 0x9e3779b97f4a7c15ULL;
    h = (h ^ h >> 30) * 0xbf58476d1ce4e5b9ULL;
    h = (h ^ h >> 27) * 0x94d049bb133111ebULL;
    h ^= h >> 31;
  }
  return h;
}

DirectedField make_noise_field(const NoiseOptions& noise, const Int3& origin, const Int3& cells) {
  const auto random = [&](const Int3& n, std::uint64_t what) {
    return to_unit_interval(node_hash(n, noise.seed * 16 + what));
  };
  return build_field(
      origin, cells,
      [&](const Int3& n) {
        const double size = 0.01 + 0.99 * random(n, 1);
        return random(n, 0) < noise.inside_probability ? -size : size;
      },
      [&](const Int3& n, double) {
        for (std::size_t a = 0; a < 3; ++a)
          if (n[a] < noise.domain_min[a] || n[a] > noise.domain_max[a]) return false;
        return random(n, 2) < noise.valid_probability;
      },
      [&](const Int3& n, int axis) {
        const auto salt = static_cast<std::uint64_t>(3 + 4 * axis);
        EdgeRoot root;
        root.t = static_cast<float>((1.0 + 62.0 * random(n, salt)) / 64);
        const Double3 v = unit_or_zero(
            Double3{random(n, salt + 1) - 0.5, random(n, salt + 2) - 0.5, random(n, salt + 3) - 0.5});
        root.normal = {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
        return root;
      });
}

}  // namespace tessera::test
