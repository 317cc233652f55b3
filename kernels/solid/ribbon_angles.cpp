#include "kernels/solid/ribbon_angles.h"

#include <algorithm>

#include "octree/portable_math.h"

namespace tessera {
namespace {

__extension__ using Wide = __int128;

constexpr double kMinAngle = 1e-30;  ///< stands for none at all, so that it has a sign
constexpr double kSureArea = 1e-14;  ///< of its parts: the sign of a rounded area is that of the exact one

/// Sign of the doubled area of (a, b, node) seen from +x, with the node moved.
bool is_left(const BorderEdge& e, const Long3& x) {
  const Wide ay = e.a[1] - x[1], az = e.a[2] - x[2], by = e.b[1] - x[1], bz = e.b[2] - x[2];
  const Wide area = ay * bz - az * by;
  if (area != 0) return area > 0;
  if (az != bz) return az > bz;
  return by > ay;
}

/// Adds the angle of an edge, times its count. \param left  the exact sign of `area`
void add_angle(const BorderEdge& edge, bool left, double along, double area, AngleSum& half) {
  const double width = std::max(std::fabs(area), kMinAngle * std::fabs(along));
  const double across = left != (edge.count < 0) ? width : -width;
  for (std::int64_t n = std::abs(edge.count); n > 0; --n) half.add(along, across);
}

double angle_of(double re, double im, double windings) {
  const double angle = angle_between({1.0, 0.0, 0.0}, {re, im, 0.0});
  return (im < 0.0 ? -angle : angle) + 2.0 * kPi * windings;
}

}  // namespace

void AngleSum::add(double re, double im) {
  const bool up = im_ >= 0.0, other_up = !std::signbit(im);
  const double r = re_ * re - im_ * im, i = re_ * im + im_ * re;
  const double scale = 1.0 / std::sqrt(r * r + i * i);
  re_ = r * scale;
  im_ = i * scale;
  const bool now_up = im_ >= 0.0;
  if (up && other_up && !now_up) ++windings_;
  if (!up && !other_up && now_up) --windings_;
}

double AngleSum::value() const {
  return angle_of(re_, im_, windings_);
}

template <std::size_t kVectors>
AngleSums<kVectors>::AngleSums() {
  re_.fill(Double4{} + 1.0);
  im_.fill(Double4{});
}

template <std::size_t kVectors>
void AngleSums<kVectors>::scale() {
  for (std::size_t v = 0; v < kVectors; ++v) {
    const Double4 factor = 1.0 / square_root(re_[v] * re_[v] + im_[v] * im_[v]);
    re_[v] *= factor;
    im_[v] *= factor;
  }
  factors_ = 0;
}

template <std::size_t kVectors>
std::array<double, 4 * kVectors> AngleSums<kVectors>::value() {
  scale();
  std::array<double, 4 * kVectors> out;
  for (std::size_t l = 0; l < out.size(); ++l) {
    const std::size_t v = l / 4, k = l % 4;
    out[l] = angle_of(re_[v][k], im_[v][k], static_cast<double>(windings_[v][k]));
  }
  return out;
}

void add_boundary_strip(const BorderEdge& edge, const Long3& x, AngleSum& half) {
  Double3 a, b;
  for (std::size_t k = 0; k < 3; ++k) {
    a[k] = static_cast<double>(edge.a[k] - x[k]) * kCellsPerQuantum;
    b[k] = static_cast<double>(edge.b[k] - x[k]) * kCellsPerQuantum;
  }
  const double p = a[1] * b[2], q = a[2] * b[1], la = norm(a), lb = norm(b);
  double area = p - q;
  const bool sure = std::fabs(area) > kSureArea * (std::fabs(p) + std::fabs(q));
  const bool left = sure ? area > 0.0 : is_left(edge, x);
  double along = la * lb + dot(a, b) + a[0] * lb + b[0] * la;
  // An end straight behind the node, seen from where the node is moved to: what is left to first order.
  const bool at_a = a[1] == 0.0 && a[2] == 0.0 && a[0] < 0.0, at_b = b[1] == 0.0 && b[2] == 0.0 && b[0] < 0.0;
  if (at_a && at_b) return;
  if (at_a) along = -b[1], area = b[2];
  if (at_b) along = -a[1], area = a[2];
  if (!(along * along + area * area > 0.0)) return;
  add_angle(edge, left, along, area, half);
}

template <std::size_t kVectors>
BoundaryStripRow<kVectors>::BoundaryStripRow(const std::array<std::int64_t, kTargets>& x, std::int64_t y,
                                             std::int64_t z)
    : quanta_(x), y_(y), z_(z) {
  for (std::size_t v = 0; v < kVectors; ++v)
    for (std::size_t l = 0; l < 4; ++l) {
      x_[v][l] = static_cast<double>(x[4 * v + l]) * kCellsPerQuantum;
    }
}

template <std::size_t kVectors>
void BoundaryStripRow<kVectors>::add(const BorderEdge& edge) {
  const double ay = static_cast<double>(edge.a[1] - y_) * kCellsPerQuantum,
               az = static_cast<double>(edge.a[2] - z_) * kCellsPerQuantum,
               by = static_cast<double>(edge.b[1] - y_) * kCellsPerQuantum,
               bz = static_cast<double>(edge.b[2] - z_) * kCellsPerQuantum;
  const double p = ay * bz, q = az * by, area = p - q, dot_ab = ay * by + az * bz;
  if (area == 0.0 && dot_ab <= 0.0) {  // the line meets the edge's shadow, or one of its ends
    any_apart_ = true;
    for (std::size_t l = 0; l < kTargets; ++l) add_boundary_strip(edge, {quanta_[l], y_, z_}, apart_[l]);
    return;
  }
  const bool sure = std::fabs(area) > kSureArea * (std::fabs(p) + std::fabs(q));
  const bool left = sure ? area > 0.0 : is_left(edge, {quanta_[0], y_, z_});
  const bool up = left != (edge.count < 0);
  const double width = std::fabs(area), sign = up ? 1.0 : -1.0;
  const double ax = static_cast<double>(edge.a[0]) * kCellsPerQuantum,
               bx = static_cast<double>(edge.b[0]) * kCellsPerQuantum;
  const double qa = ay * ay + az * az, qb = by * by + bz * bz;
  std::array<Double4, kVectors> along, across;
  for (std::size_t v = 0; v < kVectors; ++v) {
    const Double4 x = ax - x_[v], y = bx - x_[v];
    const Double4 la = square_root(x * x + qa), lb = square_root(y * y + qb);
    along[v] = la * lb + (x * y + dot_ab) + x * lb + y * la;
    const Double4 size = along[v] < 0.0 ? -along[v] : along[v];
    const Double4 minimum = kMinAngle * size;
    across[v] = sign * (minimum > width ? minimum : width + 0.0 * minimum);
  }
  std::array<Mask4, kVectors> ups;
  ups.fill(Mask4{} - static_cast<std::int64_t>(up));
  half_.add(along, across, ups, std::abs(edge.count));
}

template <std::size_t kVectors>
std::array<double, BoundaryStripRow<kVectors>::kTargets> BoundaryStripRow<kVectors>::value() {
  std::array<double, kTargets> out = half_.value();
  for (std::size_t l = 0; l < kTargets && any_apart_; ++l) out[l] += apart_[l].value();
  return out;
}

namespace {

/// Half the solid angle of the endless strip through an edge, times its count, seen from a place in quanta.
void add_endless_strip(const BorderEdge& edge, const Long3& x, AngleSum& half) {
  double ay = static_cast<double>(edge.a[1] - x[1]), az = static_cast<double>(edge.a[2] - x[2]);
  double by = static_cast<double>(edge.b[1] - x[1]), bz = static_cast<double>(edge.b[2] - x[2]);
  // From where the place is moved to, an end on its line lies in direction -y.
  const bool at_a = ay == 0.0 && az == 0.0, at_b = by == 0.0 && bz == 0.0;
  if (at_a && at_b) return;
  if (at_a) ay = -1.0;
  if (at_b) by = -1.0;
  const double p = ay * bz, q = az * by, area = p - q, along = ay * by + az * bz;
  const bool sure = std::fabs(area) > kSureArea * (std::fabs(p) + std::fabs(q));
  const bool left = sure ? area > 0.0 : is_left(edge, x);
  add_angle(edge, left, along, area, half);
}

}  // namespace

EndlessStripRows::EndlessStripRows(std::int64_t y, std::int64_t z) : y_(y), z_(z) {
  for (std::size_t l = 0; l < 8; ++l) at_[l / 4][l % 4] = static_cast<double>(l);
}

void EndlessStripRows::add(const BorderEdge& edge) {
  const double ay = static_cast<double>(edge.a[1] - y_) * kCellsPerQuantum,
               az = static_cast<double>(edge.a[2] - z_) * kCellsPerQuantum,
               by = static_cast<double>(edge.b[1] - y_) * kCellsPerQuantum,
               bz = static_cast<double>(edge.b[2] - z_) * kCellsPerQuantum;
  std::array<Double4, 2> along, across;
  std::array<Mask4, 2> up;
  Mask4 sure = Mask4{} - 1;
  for (std::size_t v = 0; v < 2; ++v) {
    const Double4 p = (ay - at_[v]) * bz, q = az * (by - at_[v]), area = p - q;
    const Double4 size = area < 0.0 ? -area : area, parts = (p < 0.0 ? -p : p) + (q < 0.0 ? -q : q);
    sure &= size > kSureArea * parts;
    along[v] = (ay - at_[v]) * (by - at_[v]) + az * bz;
    across[v] = edge.count < 0 ? -area : area;
    up[v] = across[v] > 0.0;
  }
  if ((sure[0] & sure[1] & sure[2] & sure[3]) == 0) {
    any_apart_ = true;
    for (std::size_t l = 0; l < 8; ++l)
      add_endless_strip(edge, {0, y_ + static_cast<std::int64_t>(l) * kSolidQuanta, z_}, apart_[l]);
    return;
  }
  half_.add(along, across, up, std::abs(edge.count));
}

std::array<double, 8> EndlessStripRows::value() {
  std::array<double, 8> out = half_.value();
  for (std::size_t l = 0; l < 8 && any_apart_; ++l) out[l] += apart_[l].value();
  return out;
}

template class BoundaryStripRow<1>;
template class BoundaryStripRow<2>;

}  // namespace tessera
