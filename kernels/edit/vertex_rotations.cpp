#include "kernels/edit/vertex_rotations.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "octree/lanes.h"
#include "octree/small_matrix.h"

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;
using Matrix4 = SmallMatrix<4>;

constexpr int kSpreadRounds = 6;  ///< rings that a turn is measured over, beyond its own
constexpr int kFitRings = 3;      ///< of edges that a rotation is fitted to
constexpr int kPolarSteps = 10;
/// A step less than that leaves half its square, and was the last: far less than columns are rounded by.
constexpr double kRotated = 2e-5;
/// Determinants, of a matrix as large as a rotation, from which Newton's steps are safe.
constexpr double kWellRotated = 1e-3;

constexpr int kSweeps = 12;
constexpr double kEnough = 1e-30;  ///< squares beside the diagonal of a matrix as large as a rotation

using Float4 [[gnu::vector_size(kDoubleLanes * sizeof(float))]] = float;

/// What is spread at a time: four columns' gradients, or fewer numbers and zeros.
constexpr std::size_t kGroup = 12;
using Group = std::array<double, kGroup>;

/// The faces that means at active vertices are over, with numbers of their own for their corners.
struct Around {
  std::vector<std::uint32_t> vertex;  ///< of the surface
  std::vector<Face> faces;
  std::vector<std::array<Double3, 3>> slope;  ///< per corner: gradient of its hat function times the area
  std::vector<Double3> normal;                ///< unit
  std::vector<double> area;
  std::vector<std::uint32_t> active;  ///< numbers of the active vertices
};

Around faces_around(std::span<const Double3> rest, std::span<const Face> faces,
                    std::span<const std::int32_t> active) {
  constexpr std::uint32_t kNone = 0xffffffffu;
  std::vector<std::uint8_t> near(rest.size(), 0), next;
  for (const std::int32_t v : active) near[static_cast<std::size_t>(v)] = 1;
  for (int ring = 0; ring < kSpreadRounds; ++ring) {
    next = near;
    for (const Face& f : faces)
      if ((near[f[0]] | near[f[1]] | near[f[2]]) != 0) next[f[0]] = next[f[1]] = next[f[2]] = 1;
    near.swap(next);
  }
  Around out;
  std::vector<std::uint32_t> number(rest.size(), kNone);
  for (Face f : faces) {
    if ((near[f[0]] | near[f[1]] | near[f[2]]) == 0) continue;
    const Double3 n = triangle_normal(rest[f[0]], rest[f[1]], rest[f[2]]), u = unit_or_zero(n);
    std::array<Double3, 3> slope;
    for (std::size_t k = 0; k < 3; ++k)
      slope[k] = cross(u, rest[f[(k + 2) % 3]] - rest[f[(k + 1) % 3]]) * 0.5;
    out.slope.push_back(slope);
    out.normal.push_back(u);
    out.area.push_back(0.5 * norm(n));
    for (std::uint32_t& v : f) {
      if (number[v] == kNone) {
        number[v] = static_cast<std::uint32_t>(out.vertex.size());
        out.vertex.push_back(v);
      }
      v = number[v];
    }
    out.faces.push_back(f);
  }
  for (const std::int32_t v : active) out.active.push_back(number[static_cast<std::size_t>(v)]);
  return out;
}

/// Numbers of faces, summed up at their corners and then ring by ring. Nothing is divided by, so that slivers weigh what they are.
template <std::size_t kNumbers>
class Spread {
 public:
  using Numbers = std::array<double, kNumbers>;
  Spread(std::size_t vertices, std::span<const Face> faces, int rounds)
      : vertices_(vertices), faces_(faces), rounds_(rounds) {}

  /// \param of  called with every face, by its number
  /// \return per vertex; the caller's until the next call
  template <class Of>
  std::vector<Numbers>& operator()(const Of& of) {
    sum_.assign(vertices_, Numbers{});
    for (std::size_t j = 0; j < faces_.size(); ++j) {
      const Numbers g = of(j);
      for (const std::uint32_t v : faces_[j])
        for (std::size_t c = 0; c < kNumbers; ++c) sum_[v][c] += g[c];
    }
    for (int round = 0; round < rounds_; ++round) {
      next_.assign(sum_.size(), Numbers{});
      for (const Face& f : faces_) {
        const Numbers &x = sum_[f[0]], &y = sum_[f[1]], &z = sum_[f[2]];
        Numbers g;
        for (std::size_t c = 0; c < kNumbers; ++c) g[c] = x[c] + y[c] + z[c];
        for (const std::uint32_t v : f)
          for (std::size_t c = 0; c < kNumbers; ++c) next_[v][c] += g[c];
      }
      sum_.swap(next_);
    }
    return sum_;
  }

 private:
  std::size_t vertices_;
  std::span<const Face> faces_;
  int rounds_;
  std::vector<Numbers> sum_, next_;
};

/// A matrix in each lane.
using Matrices = std::array<Double4, 9>;

Matrices cofactors(const Matrices& r) {
  const auto minor = [&](std::size_t a, std::size_t b, std::size_t c, std::size_t d) {
    return _mm256_fmsub_pd(r[a], r[b], r[c] * r[d]);
  };
  return {minor(4, 8, 5, 7), minor(5, 6, 3, 8), minor(3, 7, 4, 6), minor(2, 7, 1, 8), minor(0, 8, 2, 6),
          minor(1, 6, 0, 7), minor(1, 5, 2, 4), minor(2, 3, 0, 5), minor(0, 4, 1, 3)};
}

Double4 size_of(const Matrices& r) {
  Double4 sum = r[0] * r[0];
  for (std::size_t k = 1; k < 9; ++k) sum = fused(r[k], r[k], sum);
  return square_root(sum);
}

/// Polar factors by Newton's steps R <- (R + R^-T) / 2 (Higham 1986).
/// \return per lane, not zero: it was too near to turning over, or did not settle
Mask4 polar_rotations(Matrices& r) {
  Mask4 left{};
  const Double4 scale = std::sqrt(3.0) / size_of(r);
  for (Double4& x : r) x *= scale;
  for (int step = 0; step < kPolarSteps; ++step) {
    const Matrices cofactor = cofactors(r);
    const Double4 determinant = fused(r[0], cofactor[0], fused(r[1], cofactor[1], r[2] * cofactor[2]));
    const Double4 inverse = 0.5 / determinant;
    Double4 change{};
    for (std::size_t k = 0; k < 9; ++k) {
      const Double4 next = fused(cofactor[k], inverse, 0.5 * r[k]);
      const Double4 by = next - r[k];
      change = fused(by, by, change);
      r[k] = next;
    }
    left |= ~(determinant > kWellRotated);
    const Mask4 converged = change < kRotated * kRotated;
    if (bits_of(left | converged) == 0xf) return left;
    if (step + 1 == kPolarSteps) left |= ~converged;
  }
  return left;
}

/// Gradients within a surface leave open what becomes of normals: cofactors have the same singular vectors, and of the normal the
/// product of the other two values.
void add_normal(Matrices& s) {
  const Double4 scale = std::sqrt(2.0) / size_of(s);
  const Matrices cofactor = cofactors(s);
  for (std::size_t k = 0; k < 9; ++k) s[k] += cofactor[k] * scale;
}

/// The rotation nearest to s, of largest trace(R' s): quaternion of the largest eigenvalue (Horn 1987).
Rotation nearest_rotation(const Rotation& s) {
  double size = 0.0;
  for (const double x : s) size = std::max(size, std::fabs(x));
  if (!(size > 0.0) || !std::isfinite(size)) return kIdentityRotation;
  const auto at = [&](int to, int from) { return s[static_cast<std::size_t>(3 * to + from)] / size; };
  Matrix4 a = {{at(0, 0) + at(1, 1) + at(2, 2), at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1),
                at(2, 1) - at(1, 2), at(0, 0) - at(1, 1) - at(2, 2), at(0, 1) + at(1, 0), at(0, 2) + at(2, 0),
                at(0, 2) - at(2, 0), at(0, 1) + at(1, 0), at(1, 1) - at(0, 0) - at(2, 2), at(1, 2) + at(2, 1),
                at(1, 0) - at(0, 1), at(0, 2) + at(2, 0), at(1, 2) + at(2, 1),
                at(2, 2) - at(0, 0) - at(1, 1)}};
  Matrix4 vector;
  jacobi_eigen(a, vector, kSweeps, kEnough);
  std::size_t best = 0;
  for (std::size_t k = 1; k < 4; ++k)
    if (a(k, k) > a(best, best)) best = k;
  const double w = vector(0, best), x = vector(1, best), y = vector(2, best), z = vector(3, best);
  const double u = 2.0 / (w * w + x * x + y * y + z * z);
  return {1 - u * (y * y + z * z), u * (x * y - w * z),     u * (x * z + w * y),
          u * (x * y + w * z),     1 - u * (x * x + z * z), u * (y * z - w * x),
          u * (x * z - w * y),     u * (y * z + w * x),     1 - u * (x * x + y * y)};
}

/// Of one lane. \param polar, left  what polar_rotations() made of s \param[out] rotation  written in place: poses wait for this
inline void take_rotation(const Matrices& s, const Matrices& polar, Mask4 left, std::size_t lane,
                          Rotation& rotation) {
  for (std::size_t k = 0; k < 9; ++k) rotation[k] = left[lane] != 0 ? s[k][lane] : polar[k][lane];
  if (left[lane] != 0) rotation = nearest_rotation(rotation);
}

}  // namespace

std::vector<float> rotation_columns(std::span<const Double3> rest, std::span<const Face> faces,
                                    std::span<const std::int32_t> active, const SolutionColumns& columns) {
  const std::size_t handles = (columns.width - columns.first) / 4,
                    width = rotation_width(columns.targets, handles);
  const Around around = faces_around(rest, faces, active);
  std::vector<float> out((active.size() + kDoubleLanes - 1) / kDoubleLanes * kDoubleLanes * width, 0.0f);
  std::vector<double> area(around.vertex.size(), 0.0);
  const auto keep = [&](const std::vector<Group>& sum, std::size_t from, std::size_t count) {
    for (std::size_t k = 0; k < active.size(); ++k) {
      const std::uint32_t v = around.active[k];
      const double share = area[v] > 0.0 ? 1.0 / area[v] : 0.0;
      float* const to = out.data() + (k / kDoubleLanes * width + from) * kDoubleLanes + k % kDoubleLanes;
      for (std::size_t c = 0; c < count; ++c) to[c * kDoubleLanes] = static_cast<float>(sum[v][c] * share);
    }
  };
  Spread<kGroup> spread(around.vertex.size(), around.faces, kSpreadRounds);
  const std::vector<Group>& plane = spread([&](std::size_t j) {
    const Double3& n = around.normal[j];
    const double a = around.area[j];
    return Group{a * (1 - n[0] * n[0]),
                 -a * n[0] * n[1],
                 -a * n[0] * n[2],
                 a * (1 - n[1] * n[1]),
                 -a * n[1] * n[2],
                 a * (1 - n[2] * n[2]),
                 a};
  });
  for (std::size_t v = 0; v < area.size(); ++v) area[v] = plane[v][6];
  keep(plane, 0, 6);
  const auto value = [&](std::uint32_t v, std::size_t column) {
    return columns.values[around.vertex[v] * columns.width + column];
  };
  std::size_t from = 6;
  if (columns.targets) {
    keep(spread([&](std::size_t j) {
           Group g{};
           for (std::size_t k = 0; k < 3; ++k)
             for (std::size_t r = 0; r < 3; ++r) {
               const std::uint32_t v = around.faces[j][k];
               const double by = value(v, 3 + r) - value(v, r);
               for (std::size_t c = 0; c < 3; ++c) g[3 * r + c] += by * around.slope[j][k][c];
             }
           return g;
         }),
         from, 9);
    from += 9;
  }
  for (std::size_t h = 0; h < handles; ++h, from += 12)
    keep(spread([&](std::size_t j) {
           Group g{};
           for (std::size_t k = 0; k < 3; ++k)
             for (std::size_t a = 0; a < 4; ++a) {
               const double by = value(around.faces[j][k], columns.first + 4 * h + a);
               for (std::size_t c = 0; c < 3; ++c) g[3 * a + c] += by * around.slope[j][k][c];
             }
           return g;
         }),
         from, 12);
  return out;
}

std::vector<Rotation> vertex_rotations(std::span<const float> columns, std::size_t count, bool targets,
                                       std::span<const FrameMotion> motion) {
  const std::size_t width = rotation_width(targets, motion.size());
  std::vector<Rotation> out(count);
  for (std::size_t first = 0; first < count; first += kDoubleLanes) {
    const float* const from = columns.data() + first * width;
    const auto column = [&](std::size_t c) {
      Float4 few;
      std::memcpy(&few, from + c * kDoubleLanes, sizeof few);
      return __builtin_convertvector(few, Double4);
    };
    Matrices by{};
    std::size_t c = 6;
    if (targets)
      for (std::size_t k = 0; k < 9; ++k, ++c) by[k] = column(c);
    for (const FrameMotion& frame : motion)
      for (const Double3& axis : frame) {
        const Double4 x = column(c), y = column(c + 1), z = column(c + 2);
        c += 3;
        for (std::size_t r = 0; r < 3; ++r) {
          const Double4 along = _mm256_set1_pd(axis[r]);
          by[3 * r] = fused(along, x, by[3 * r]);
          by[3 * r + 1] = fused(along, y, by[3 * r + 1]);
          by[3 * r + 2] = fused(along, z, by[3 * r + 2]);
        }
      }
    const Double4 xx = column(0), xy = column(1), xz = column(2), yy = column(3), yz = column(4),
                  zz = column(5);
    Matrices s = {xx + by[0], xy + by[1], xz + by[2], xy + by[3], yy + by[4],
                  yz + by[5], xz + by[6], yz + by[7], zz + by[8]};
    add_normal(s);
    auto moves = by[0] != 0.0;
    for (std::size_t k = 1; k < 9; ++k) moves |= by[k] != 0.0;
    Matrices r = s;
    const Mask4 left = polar_rotations(r);
    for (std::size_t l = 0; l < kDoubleLanes && first + l < count; ++l) {
      if (moves[l] == 0)
        out[first + l] = kIdentityRotation;
      else
        take_rotation(s, r, left, l, out[first + l]);
    }
  }
  return out;
}

std::vector<Rotation> fitted_rotations(std::span<const Double3> before, std::span<const Double3> after,
                                       std::span<const Face> faces) {
  Spread<9> spread(before.size(), faces, kFitRings - 1);
  std::vector<Rotation> sum = std::move(spread([&](std::size_t j) {
    const Face& f = faces[j];
    Rotation here{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 was = before[f[(k + 1) % 3]] - before[f[k]], is = after[f[(k + 1) % 3]] - after[f[k]];
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c) here[3 * r + c] += is[r] * was[c];
    }
    return here;
  }));
  for (std::size_t first = 0; first < sum.size(); first += kDoubleLanes) {
    const std::size_t count = std::min(kDoubleLanes, sum.size() - first);
    Matrices s{};
    for (std::size_t l = 0; l < count; ++l)
      for (std::size_t i = 0; i < 9; ++i) s[i][l] = sum[first + l][i];
    add_normal(s);
    Matrices r = s;
    const Mask4 left = polar_rotations(r);
    for (std::size_t l = 0; l < count; ++l) take_rotation(s, r, left, l, sum[first + l]);
  }
  return sum;
}

}  // namespace tessera
