// Field. Nodes within `band` of the reference get their exact distance d, the others a fast marching
// continuation (Sethian 1996, first order), at least the band. Unsigned, so open surfaces need no case of
// their own.
//
// Interpolation, h the spacing. d is 1-Lipschitz, so |I(p) - d(p)| <= h sqrt(sum t (1 - t)) <= sqrt(3)/2 h,
// the thesis's term. But the distance to ONE triangle F is convex, and interpolating a convex function
// overestimates it (Jensen): with c = min over F of max over the 8 corners of dist(corner, F) - d(corner),
// I(p) + c >= d(p) in that cell. Every node stores d plus the largest c of its cells (`lift`, never above
// the worst case), so I(p) >= d(p) everywhere. The lift is nothing where one triangle serves the whole cell,
// so it pays where triangles are larger than cells.
//
// Outside. With y the closest point to p, the nodes' distances are at most |node - y|, their weighted squares sum to
// d(p)^2 + h^2 sum t (1 - t) because trilinear weights reproduce linear functions, and roots are concave: so the
// interpolation of exact distances is at most sqrt(d(p)^2 + 3/4 h^2).
//
// Samples. A triangle is sampled at the points with barycentric coordinates ((i + o) / n, (j + o) / n), i +
// j < n, o = 85/256: the centroids of the upright triangles of its n-fold subdivision but for 1/768, so that
// hardware which snaps vertices to 1/256 of a pixel takes the very same points. Any point is within delta =
// 0.68 m / n of a sample, m the longest median: 2/3 m / n for true centroids (the reflected triangles by
// their three neighbours), and 0.0131 m / n for the shift.
//
// Texture. Stored values are rounded up to the precision: by at most cap/255 (8 bit), 2^-10 of the value (16
// bit float), nothing (32 bit). Filtering hardware rounds weights to 1/256: at most 3 h / 256
// (`weight_error`; our own rasterizer: 2^-16 of the nodes per axis times h, from the rounding of float
// coordinates).
#include "kernels/certify/tolerance_volume.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>

#include "octree/rounding.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNone = ClosestFaces::kNone;
constexpr double kHalfDiagonal = 0.86602540378443871;  // sqrt(3) / 2, rounded up

}  // namespace

double longest_median(const Double3& a, const Double3& b, const Double3& c) {
  const auto median = [](const Double3& tip, const Double3& p, const Double3& q) {
    double square = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double d = tip[k] - 0.5 * (p[k] + q[k]);
      square += d * d;
    }
    return std::sqrt(square);
  };
  return std::max({median(a, b, c), median(b, c, a), median(c, a, b)});
}

int samples_per_side(double longest_median, double delta) {
  return static_cast<int>(std::clamp(std::ceil(0.68 * longest_median / delta), 1.0, 4096.0));
}

ToleranceVolume::ToleranceVolume(const Box3& box, const ClosestFaces& reference,
                                 const ToleranceVolumeOptions& options)
    : options_(options) {
  assert(options.tolerance > 0.0 && options.spacing > 0.0);
  const double h = options.spacing;
  std::size_t count = 1;
  for (std::size_t k = 0; k < 3; ++k) {
    low_[k] = box.low[k] - h;
    const double cells = std::ceil((box.high[k] - box.low[k]) / h) + 2.0;
    assert(cells < 1024.0);
    nodes_[k] = static_cast<std::int32_t>(cells) + 1;
    count *= static_cast<std::size_t>(nodes_[k]);
  }
  band_ = options.tolerance + 2.0 * kHalfDiagonal * h * 1.001;
  cap_ = 2.0 * band_;
  value_.assign(count, std::numeric_limits<float>::infinity());
  slot_.assign(count, kNone);
  fill_band(reference);
  lift(reference);
  march();
  for (float& v : value_) v = rounded_up(std::min(static_cast<double>(v), cap_) / h);
  slot_ = {};
}

Double3 ToleranceVolume::local(int i, int j, int k, const ClosestFaces& reference) const {
  const Double3 n = {static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)};
  Double3 p;
  for (std::size_t c = 0; c < 3; ++c) p[c] = low_[c] - reference.origin()[c] + n[c] * options_.spacing;
  return p;
}

void ToleranceVolume::fill_band(const ClosestFaces& reference) {
  // Nodes in the box of a triangle, grown by the band; one exact query for each.
  std::vector<bool> near(value_.size());
  const double h = options_.spacing;
  for (std::uint32_t slot = 0; slot < reference.size(); ++slot) {
    const std::array<Double3, 3> t = reference.corners(slot);
    Int3 first{}, last{};
    for (std::size_t c = 0; c < 3; ++c) {
      const double origin = low_[c] - reference.origin()[c];
      const double least = std::min({t[0][c], t[1][c], t[2][c]}) - band_ - origin;
      const double most = std::max({t[0][c], t[1][c], t[2][c]}) + band_ - origin;
      first[c] = static_cast<std::int32_t>(std::clamp(std::floor(least / h), 0.0, nodes_[c] * 1.0));
      last[c] = static_cast<std::int32_t>(std::clamp(std::ceil(most / h), -1.0, nodes_[c] - 1.0));
    }
    for (int k = first[2]; k <= last[2]; ++k)
      for (int j = first[1]; j <= last[1]; ++j)
        for (int i = first[0]; i <= last[0]; ++i) near[at(i, j, k)] = true;
  }
  std::uint32_t hint = kNone;
  for (int k = 0; k < nodes_[2]; ++k)
    for (int j = 0; j < nodes_[1]; ++j)
      for (int i = 0; i < nodes_[0]; ++i) {
        const std::size_t n = at(i, j, k);
        if (!near[n]) continue;
        const ClosestFaces::Hit hit = reference.closest(local(i, j, k, reference), band_ * band_, hint);
        if (hit.slot == kNone) continue;
        hint = slot_[n] = hit.slot;
        value_[n] = rounded_up(std::sqrt(hit.square));
      }
}

void ToleranceVolume::lift(const ClosestFaces& reference) {
  std::vector<float> lift(value_.size(), 0.0f);
  double sum = 0.0, cells = 0.0;
  for (int k = 0; k + 1 < nodes_[2]; ++k)
    for (int j = 0; j + 1 < nodes_[1]; ++j)
      for (int i = 0; i + 1 < nodes_[0]; ++i) {
        std::array<std::size_t, 8> node;
        alignas(32) double x[8], y[8], z[8], square[8];
        bool exact = true, reachable = false;
        for (std::size_t c = 0; c < 8; ++c) {
          const int di = static_cast<int>(c & 1), dj = static_cast<int>(c >> 1 & 1),
                    dk = static_cast<int>(c >> 2);
          node[c] = at(i + di, j + dj, k + dk);
          exact = exact && slot_[node[c]] != kNone;
          reachable = reachable || static_cast<double>(value_[node[c]]) <= options_.tolerance;
          const Double3 p = local(i + di, j + dj, k + dk, reference);
          x[c] = p[0], y[c] = p[1], z[c] = p[2];
        }
        if (!exact) continue;  // farther than the tolerance all over
        double least = kHalfDiagonal * options_.spacing * (1.0 + 0x1p-20);
        for (std::size_t c = 0; c < 8; ++c) {
          bool seen = false;
          for (std::size_t b = 0; b < c; ++b) seen = seen || slot_[node[b]] == slot_[node[c]];
          if (seen) continue;
          reference.squares_to(slot_[node[c]], x, y, z, 8, square);
          double most = 0.0;
          for (std::size_t b = 0; b < 8; ++b)
            most = std::max(most, std::sqrt(square[b]) - static_cast<double>(value_[node[b]]));
          least = std::min(least, most);
        }
        const double rounding = certificate_rounding(reference.largest_coordinate());
        const float up = rounded_up(least + rounding);
        for (const std::size_t n : node) lift[n] = std::max(lift[n], up);
        if (reachable) sum += least, cells += 1.0;
      }
  mean_lift_ = cells > 0.0 ? sum / cells : 0.0;
  for (std::size_t n = 0; n < value_.size(); ++n) {
    if (slot_[n] == kNone) continue;
    largest_lift_ = std::max(largest_lift_, static_cast<double>(lift[n]));
    value_[n] = rounded_up(static_cast<double>(value_[n]) + static_cast<double>(lift[n]));
  }
}

void ToleranceVolume::march() {
  const double h = options_.spacing;
  using Entry = std::pair<double, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> front;
  std::vector<std::uint8_t> fixed(value_.size(), 0);
  const std::array<std::size_t, 3> stride = {
      1, static_cast<std::size_t>(nodes_[0]),
      static_cast<std::size_t>(nodes_[0]) * static_cast<std::size_t>(nodes_[1])};
  const auto coordinate = [&](std::size_t n, std::size_t axis) {
    return static_cast<std::int32_t>(n / stride[axis] % static_cast<std::size_t>(nodes_[axis]));
  };
  const auto each_neighbour = [&](std::size_t n, const auto& body) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::int32_t c = coordinate(n, axis);
      if (c > 0) body(axis, n - stride[axis]);
      if (c + 1 < nodes_[axis]) body(axis, n + stride[axis]);
    }
  };
  // Upwind: the largest root of sum over axes of max(0, u - a_axis)^2 = h^2.
  const auto update = [&](std::size_t n) {
    std::array<double, 3> a;
    a.fill(std::numeric_limits<double>::infinity());
    each_neighbour(n, [&](std::size_t axis, std::size_t m) {
      if (fixed[m]) a[axis] = std::min(a[axis], static_cast<double>(value_[m]));
    });
    std::sort(a.begin(), a.end());
    double u = a[0] + h;
    if (u > a[1]) {
      const double s = a[0] + a[1], d = a[0] - a[1];
      u = 0.5 * (s + std::sqrt(std::max(0.0, 2.0 * h * h - d * d)));
    }
    if (u > a[2]) {
      const double s = a[0] + a[1] + a[2], q = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
      u = (s + std::sqrt(std::max(0.0, s * s - 3.0 * (q - h * h)))) / 3.0;
    }
    return std::max(u, band_);
  };
  const auto offer = [&](std::size_t n) {
    if (fixed[n]) return;
    const double u = update(n);
    if (u >= static_cast<double>(value_[n]) || u > cap_) return;
    value_[n] = static_cast<float>(u);
    front.push({static_cast<double>(value_[n]), n});
  };
  for (std::size_t n = 0; n < value_.size(); ++n) fixed[n] = slot_[n] != kNone;
  for (std::size_t n = 0; n < value_.size(); ++n) {
    if (slot_[n] == kNone) continue;
    each_neighbour(n, [&](std::size_t, std::size_t m) { offer(m); });
  }
  while (!front.empty()) {
    const auto [u, n] = front.top();
    front.pop();
    if (fixed[n] || u > static_cast<double>(value_[n])) continue;
    fixed[n] = 1;
    each_neighbour(n, [&](std::size_t, std::size_t m) { offer(m); });
  }
}

double ToleranceVolume::texture_error(TexturePrecision precision) const {
  if (precision == TexturePrecision::k8Bit) return cap_ / 255.0 * 1.0001;
  if (precision == TexturePrecision::kHalf) return cap_ * 0x1p-10;
  return 0.0;
}

double ToleranceVolume::filter_error(TexturePrecision precision, bool hardware_filter) const {
  const double step = options_.spacing + largest_lift_;
  const int most = std::max({nodes_[0], nodes_[1], nodes_[2]});
  const double coordinates = 3.0 * step * most * 0x1p-22;
  if (!hardware_filter) return coordinates;
  return coordinates + 3.0 * step / 256.0 + (precision == TexturePrecision::k8Bit ? 3.0 * cap_ / 255.0 : 0.0);
}

double ToleranceVolume::inside_below(double delta, TexturePrecision precision, bool hardware_filter) const {
  return options_.tolerance - delta - filter_error(precision, hardware_filter);
}

double ToleranceVolume::outside_above(TexturePrecision precision, bool hardware_filter) const {
  const double h = options_.spacing, t = options_.tolerance;
  return std::sqrt(t * t + 0.75 * h * h) * (1.0 + 0x1p-40) + largest_lift_ + texture_error(precision) +
         filter_error(precision, hardware_filter);
}

Float3 ToleranceVolume::to_grid(const Double3& p) const {
  Float3 g;
  for (std::size_t k = 0; k < 3; ++k) g[k] = static_cast<float>((p[k] - low_[k]) / options_.spacing);
  return g;
}

double ToleranceVolume::interpolate(const Double3& p) const {
  std::array<int, 3> cell;
  std::array<double, 3> t;
  for (std::size_t k = 0; k < 3; ++k) {
    const double g = (p[k] - low_[k]) / options_.spacing;
    cell[k] = static_cast<int>(std::clamp(std::floor(g), 0.0, nodes_[k] - 2.0));
    t[k] = std::clamp(g - cell[k], 0.0, 1.0);
  }
  double sum = 0.0;
  for (std::size_t c = 0; c < 8; ++c) {
    const int di = static_cast<int>(c & 1), dj = static_cast<int>(c >> 1 & 1), dk = static_cast<int>(c >> 2);
    const double w = (di ? t[0] : 1.0 - t[0]) * (dj ? t[1] : 1.0 - t[1]) * (dk ? t[2] : 1.0 - t[2]);
    sum += w * static_cast<double>(value_[at(cell[0] + di, cell[1] + dj, cell[2] + dk)]);
  }
  return sum * options_.spacing;
}

}  // namespace tessera
