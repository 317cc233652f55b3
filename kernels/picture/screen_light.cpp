#include "kernels/picture/screen_light.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "octree/lanes.h"

namespace tessera {
namespace {

/// Where the taps of occlusion lie: 20 on a spiral that turns from pixel to pixel in a pattern of 4 x 4, for a reach of one; of eight
/// pixels beside each other.
struct Taps {
  static constexpr std::size_t kCount = 20;
  struct Tap {
    alignas(32) std::array<float, 8> x, y;
    float r;
  };
  std::array<std::array<Tap, kCount>, 4> by_row;

  Taps() {
    constexpr std::array<int, 16> kBayer = {0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5};
    constexpr float kCos16 = 0.9238795f, kSin16 = 0.3826834f, kCosGolden = -0.7373689f,
                    kSinGolden = 0.6754903f;
    for (std::size_t row = 0; row < 4; ++row)
      for (std::size_t lane = 0; lane < 8; ++lane) {
        float x = 1.0f, y = 0.0f;
        const auto turn = [&](float c, float s) {
          const float turned = x * c - y * s;
          y = x * s + y * c;
          x = turned;
        };
        for (int i = 0; i < kBayer[(lane % 4) * 4 + row]; ++i) turn(kCos16, kSin16);
        for (std::size_t i = 0; i < kCount; ++i) {
          turn(kCosGolden, kSinGolden);
          const float share = (static_cast<float>(i) + 0.5f) / static_cast<float>(kCount);
          by_row[row][i].x[lane] = x;
          by_row[row][i].y[lane] = y;
          by_row[row][i].r = share * std::sqrt(share);
        }
      }
  }
};

Float8 all(double value) {
  return Float8{} + static_cast<float>(value);
}
Float8 load(const float* from) {
  return _mm256_loadu_ps(from);
}
Float8 root(Float8 v) {
  return _mm256_sqrt_ps(v);
}
Float8 clamped(Float8 v, Float8 low, Float8 high) {
  v = v < low ? low : v;
  return v > high ? high : v;
}
Int8 floor_of(Float8 v) {
  const Int8 towards_zero = __builtin_convertvector(v, Int8);
  return towards_zero + (__builtin_convertvector(towards_zero, Float8) > v);  // what holds is minus one
}

}  // namespace

void ScreenLight::begin(const Camera& camera, int width, int height, int first, int rows, double middle) {
  camera_ = camera;
  width_ = width, height_ = height;
  first_ = first, rows_ = rows;
  middle_ = middle;
  stride_ = stride_of(width);
  plane_size_ = stride_ * static_cast<std::size_t>(rows_ + 2 * kPad);
  planes_.reserve(kPlanes * plane_size_);
  planes_.assign(plane_size_, static_cast<float>(camera_.far_plane));
  planes_.resize((kOpen + 1) * plane_size_, 1.0f);
  planes_.resize(kPlanes * plane_size_, 0.0f);
}

std::uint64_t ScreenLight::bytes(int width, int rows) {
  return stride_of(width) * static_cast<std::uint64_t>(rows + 2 * kPad) * 5 * sizeof(float);
}

/// Repeats what lies at the border beyond it.
void ScreenLight::pad() {
  constexpr std::size_t kBeyond = 2;
  for (const Plane some : {kDistance, kOpen, kX, kY, kZ}) {
    float* p = plane(some);
    for (std::size_t y = kPad; y < static_cast<std::size_t>(rows_) + kPad; ++y) {
      float* row = p + y * stride_ + kPad;
      const auto end = static_cast<std::size_t>(width_);
      for (std::size_t i = 0; i < kBeyond; ++i) row[end + i] = row[end - 1], *(row - 1 - i) = row[0];
    }
    const auto rows = static_cast<std::size_t>(rows_);
    for (std::size_t i = 0; i < kBeyond; ++i) {
      std::copy_n(p + kPad * stride_, stride_, p + (kPad - 1 - i) * stride_);
      std::copy_n(p + (kPad + rows - 1) * stride_, stride_, p + (kPad + rows + i) * stride_);
    }
  }
}

void ScreenLight::find_occlusion(double strength, double radius) {
  if (!(strength > 0.0)) return pad();
  static const Taps kTaps;
  const Camera& c = camera_;
  const double step_x = 2.0 * c.half_width / width_, step_y = 2.0 * c.half_height / height_;
  const Float8 one = all(1.0), zero = all(0.0), far = all(c.far_plane);
  const Float8 first_x = all(middle_ * step_x - c.half_width),
               first_y = all((middle_ + first_) * step_y - c.half_height);
  const auto across = [&](Float8 column) { return column * static_cast<float>(step_x) + first_x; };
  const auto up = [&](Float8 row) { return row * static_cast<float>(step_y) + first_y; };
  const Float8 lanes = __builtin_convertvector(kLaneNumbers, Float8);
  const auto stride = static_cast<std::int32_t>(stride_);
  const float* distance = plane(kDistance);
  for (int y = 0; y < rows_; ++y) {
    const auto& taps = kTaps.by_row[static_cast<std::size_t>((y + first_) & 3)];
    const Float8 row = all(y);
    for (int x = 0; x < width_; x += 8) {
      const std::size_t pixel = index(x, y);
      const Float8 z = load(distance + pixel);
      const Mask8 there_is = z < far;
      if (bits_of(there_is) == 0) continue;
      const Float8 column = lanes + static_cast<float>(x), wide = c.orthographic ? one : z;
      const Float8x3 at = {across(column) * wide, up(row) * wide, zero - z};
      const Float8x3 normal = {load(plane(kX) + pixel), load(plane(kY) + pixel), load(plane(kZ) + pixel)};
      const Float8 per_unit = all(height_ / (2.0 * c.half_height)) / wide;
      const Float8 reach = clamped(per_unit * static_cast<float>(radius), all(4.0), all(0.3 * height_));
      // Squares of distances are compared with nine squares of a tap's own.
      const Float8 fading = per_unit * per_unit / 9.0f;
      Float8 sum = zero;
      for (const Taps::Tap& tap : taps) {
        const Float8 r = larger(reach * tap.r, one);
        const Int8 dx = floor_of(load(tap.x.data()) * r + 0.5f), dy = floor_of(load(tap.y.data()) * r + 0.5f);
        const Int8 tx = kLaneNumbers + x + dx, ty = dy + y;
        const Mask8 in = (tx >= 0) & (tx < width_) & (ty >= 0) & (ty < rows_);
        const Int8 there = ((ty + kPad) * stride + tx + kPad) & in;
        Float8 tz;
        for (int i = 0; i < 8; ++i) tz[i] = distance[static_cast<std::size_t>(there[i])];
        const Mask8 counts = in & (tz < far);
        const Float8 tap_wide = c.orthographic ? one : tz;
        const Float8x3 v = {across(__builtin_convertvector(tx, Float8)) * tap_wide - at[0],
                            up(__builtin_convertvector(ty, Float8)) * tap_wide - at[1], z - tz};
        const Float8 square = dot(v, v);
        const Float8 rise = larger(dot(v, normal) / root(larger(square, all(1e-30))) - 0.12f, zero);
        const Float8 fade = larger(one - square * fading / (r * r), zero);
        sum += counts ? rise * fade : zero;
      }
      const Float8 hidden =
          clamped(sum * static_cast<float>(strength * 1.9 / double{Taps::kCount}), zero, all(0.85));
      const Float8 open = there_is ? one - hidden : one;
      _mm256_storeu_ps(plane(kOpen) + pixel, open);
    }
  }
  pad();
}

void ScreenLight::shares(int row, double near_size, std::span<float> light) const {
  const Float8 near = all(near_size), one = all(1.0), zero = all(0.0), far = all(camera_.far_plane);
  const auto stride = static_cast<std::ptrdiff_t>(stride_);
  const float* distance = plane(kDistance);
  for (int x = 0; x < width_; x += 8) {
    const auto pixel = static_cast<std::ptrdiff_t>(index(x, row));
    const Float8 mine = load(distance + pixel);
    Float8 sum = zero, weights = zero;
    for (std::ptrdiff_t dy = -2; dy < 2; ++dy)
      for (std::ptrdiff_t dx = -2; dx < 2; ++dx) {
        const std::ptrdiff_t at = pixel + dy * stride + dx;
        const Float8 apart = absolute(load(distance + at) - mine);
        const Float8 weight = larger(one - apart / near, all(0.001));
        sum += weight * load(plane(kOpen) + at);
        weights += weight;
      }
    Float8 edge = zero;
    for (const std::ptrdiff_t at : {pixel + 1, pixel + stride}) {
      const Float8 other = load(distance + at);
      const Mask8 joined = (absolute(other - mine) <= near) & (mine < far) & (other < far);
      const auto times = [&](Plane n) { return load(plane(n) + pixel) * load(plane(n) + at); };
      // Faces that meet at 50 degrees or more.
      const Float8 t = clamped((times(kX) + times(kY) + times(kZ) - 0.40f) / (0.75f - 0.40f), zero, one);
      edge = larger(edge, joined ? one - t * t * (3.0f - 2.0f * t) : zero);
    }
    const Float8 share = sum / weights * (one - edge * 0.45f);
    _mm256_storeu_ps(light.data() + x, share);
  }
}

}  // namespace tessera
