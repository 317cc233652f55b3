#include "kernels/solid/border_points.h"

#include <cmath>

namespace tessera {
namespace {

constexpr double kGauss = 0.28867513459481287;  ///< of an edge, from its middle

}  // namespace

double BorderPoints::distance(const Double3& r, Side side) {
  return (side == Side::kAhead ? r[0] < 0.0 : r[0] > 0.0) ? std::sqrt(r[1] * r[1] + r[2] * r[2]) : norm(r);
}

bool BorderPoints::is_far(const BorderCluster& c, Side side) const {
  const double away = distance(wide(c.centre) - middle(), side);
  return is_smooth(away - c.radius) && c.radius < kFar * free(away);
}

BorderPoints::Weights BorderPoints::weights(double cells) {
  Weights w;
  for (std::size_t p = 0; p < kPoints; ++p) {
    double product = 1.0;
    for (std::size_t o = 0; o < kPoints; ++o)
      if (o != p)
        product *= (cells * static_cast<double>(kSolidQuanta) - static_cast<double>(kNodes[o])) /
                   static_cast<double>(kNodes[p] - kNodes[o]);
    w[p] = product;
  }
  return w;
}

BorderPoints::Weights BorderPoints::line(const Weights& y, const Weights& z) const {
  Weights line{};
  for (std::size_t k = 0; k < kPoints; ++k)
    for (std::size_t j = 0; j < kPoints; ++j) {
      const double weight = z[k] * y[j];
      for (std::size_t i = 0; i < kPoints; ++i) line[i] += weight * sum_[kPoints * (kPoints * k + j) + i];
    }
  return line;
}

double BorderPoints::at(const Int3& node) const {
  const auto along_axis = [&](std::size_t a) { return weights((node[a] - corner_[a]) / scale_); };
  const Weights x = along_axis(0), along = line(along_axis(1), along_axis(2));
  double sum = 0.0;
  for (std::size_t i = 0; i < kPoints; ++i) sum += x[i] * along[i];
  return sum;
}

void BorderPoints::add_from(const BorderPoints& wider) {
  std::array<std::array<Weights, kPoints>, 3> weight;
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t p = 0; p < kPoints; ++p)
      weight[a][p] = weights((corner_[a] - wider.corner_[a] + place(p)) / wider.scale_);
  for (std::size_t row = 0; row < kPoints * kPoints; ++row) {
    const Weights along = wider.line(weight[1][row % kPoints], weight[2][row / kPoints]);
    for (std::size_t p = 0; p < kPoints; ++p)
      for (std::size_t i = 0; i < kPoints; ++i) sum_[kPoints * row + p] += weight[0][p][i] * along[i];
  }
}

/// Adds the form g (e_x x r) . dl with g = 1 / (s (s + r_x)) at all points, to second order about the cluster's centre.
void BorderPoints::add_cluster(const BorderCluster& c, Side side) {
  // Ribbons to -x infinity are those to +x infinity in a mirror, where solid angles change their sign.
  const double turn = side == Side::kAhead ? 1.0 : -1.0;
  const Double4 x = turn * points_from(c.centre[0]);
  const auto &sy = c.second[0], &sz = c.second[1];
  const double curl = c.moment[3 * 2 + 1] - c.moment[3 * 1 + 2];
  // Twice the second moments where the other factor is the derivative of v = (0, -z, y).
  const double k0 = 2.0 * (sz[3] - sy[4]), k1 = 2.0 * (sz[1] - sy[5]), k2 = 2.0 * (sz[5] - sy[2]);
  for (std::size_t row = 0; row < kPoints * kPoints; ++row) {
    const double y = c.centre[1] - row_y(row), z = c.centre[2] - row_z(row);
    std::array<double, 6> a;  // v . second
    for (std::size_t m = 0; m < 6; ++m) a[m] = y * sz[m] - z * sy[m];
    a[3] *= turn, a[4] *= turn;  // xy, xz
    // First order: v . moment, and k, both against the slope of g.
    const double m0 = turn * (y * c.moment[6] - z * c.moment[3] + k0),
                 m1 = y * c.moment[7] - z * c.moment[4] + k1, m2 = y * c.moment[8] - z * c.moment[5] + k2;
    const double linear = a[3] * y + a[4] * z, across = a[1] * y * y + a[2] * z * z + 2.0 * a[5] * y * z;
    const double trace = a[0] + a[1] + a[2];
    const Double4 s = square_root(x * x + (y * y + z * z));
    // 1 / g = d = s^2 + s x has the slope r t + s e_x, t = 2 + x / s.
    const Double4 part = s * (s + x), inverse = 1.0 / (s * part), g = inverse * s, one = inverse * part;
    const Double4 t = 2.0 + x * one, ar = x * a[0] + linear, rar = x * (ar + linear) + across;
    const Double4 along = (x * m0 + (y * m1 + z * m2)) * t + s * m0;
    const Double4 quadratic = t * (t * rar + 2.0 * s * ar) + s * s * a[0];
    const Double4 curve = t * trace + one * (2.0 * ar - x * one * one * rar);
    const Double4 winding =
        g * ((y * c.sum[2] - z * c.sum[1] + curl) - g * (along + curve - 2.0 * g * quadratic));
    double* to = &sum_[kPoints * row];
    store4(to, load4(to) + turn * winding);
  }
}

void BorderPoints::add_edge(const Double3& middle, const Double3& edge, double count, Side side) {
  const double turn = side == Side::kAhead ? 1.0 : -1.0;
  const Double3 a = middle - edge * kGauss, b = middle + edge * kGauss;
  const Double4 ax = turn * points_from(a[0]), bx = turn * points_from(b[0]);
  const double wy = 0.5 * count * edge[1], wz = 0.5 * count * edge[2];
  for (std::size_t row = 0; row < kPoints * kPoints; ++row) {
    const double ay = a[1] - row_y(row), az = a[2] - row_z(row), by = b[1] - row_y(row),
                 bz = b[2] - row_z(row);
    const Double4 sa = square_root(ax * ax + (ay * ay + az * az)),
                  sb = square_root(bx * bx + (by * by + bz * bz));
    const Double4 da = sa * (sa + ax), db = sb * (sb + bx);
    const Double4 winding = ((ay * wz - az * wy) * db + (by * wz - bz * wy) * da) / (da * db);
    double* to = &sum_[kPoints * row];
    store4(to, load4(to) + turn * winding);
  }
}

Double4 BorderPoints::points_from(double x) const {
  Double4 out;
  for (std::size_t p = 0; p < kPoints; ++p) out[p] = x - corner_[0] - place(p);
  return out;
}

}  // namespace tessera
