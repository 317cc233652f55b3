#include "kernels/picture/band_rasterizer.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/vector.h"

namespace tessera {
namespace {

constexpr std::int64_t kParts = 256;     // of a sample
constexpr std::int64_t kMiddle = 128;    // of a sample
constexpr std::int64_t kOneColour = 16;  // samples: light hardly changes within a face so small
constexpr std::int64_t kTested = 8;      // samples: of a row so short each is tested
constexpr float kNothing = -std::numeric_limits<float>::max();

Float3 albedo_of(std::uint32_t rgba) {
  Float3 linear;
  for (std::size_t c = 0; c < 3; ++c) {
    const float stored = static_cast<float>((rgba >> (8 * c)) & 0xffu) / 255.0f;
    linear[c] = stored * stored;
  }
  return linear;
}

/// The root by which colours are stored.
std::uint8_t stored_byte(float linear) {
  return static_cast<std::uint8_t>(std::sqrt(std::clamp(linear, 0.0f, 1.0f)) * 255.0f + 0.5f);
}

Float3 normalized(const Float3& v) {
  return v * (1.0f / std::sqrt(dot(v, v)));
}

/// lit() of picture_shaders.h, stored.
std::uint32_t lit(const Float3& albedo, const Float3& n, const Float3& v) {
  constexpr Float3 kKey = {-0.4537f, 0.5672f, 0.6874f}, kFill = {0.7303f, -0.0913f, 0.6771f};
  float spec = std::max(dot(n, normalized(kKey + v)), 0.0f);
  for (int i = 0; i < 5; ++i) spec *= spec;
  const float wrap = std::max(dot(n, kKey) * 0.85f + 0.15f, 0.0f);
  const float light = 0.86f * wrap + 0.20f * std::max(dot(n, kFill), 0.0f) +
                      0.12f * std::max(dot(n, v), 0.0f) + 0.09f + 0.06f * n[1];
  std::uint32_t rgba = 0xff000000u;
  for (std::size_t c = 0; c < 3; ++c) {
    rgba |= std::uint32_t{stored_byte(albedo[c] * light + 0.035f * spec)} << (8 * c);
  }
  return rgba;
}

std::uint32_t unlit(const Float3& albedo) {
  std::uint32_t rgba = 0xff000000u;
  for (std::size_t c = 0; c < 3; ++c) rgba |= std::uint32_t{stored_byte(albedo[c])} << (8 * c);
  return rgba;
}

std::int64_t floor_div(std::int64_t a, std::int64_t b) {  // b > 0
  const std::int64_t q = a / b;
  return q - (a % b < 0 ? 1 : 0);
}

/// The first and last sample of a row at which all three edge functions are not below zero.
std::array<std::int64_t, 2> span_of(const std::array<std::int64_t, 3>& at,
                                    const std::array<std::int64_t, 3>& step, std::int64_t count) {
  std::int64_t first = 0, last = count - 1;
  for (std::size_t k = 0; k < 3; ++k) {
    if (step[k] > 0)
      first = std::max(first, -floor_div(at[k], step[k]));
    else if (step[k] < 0)
      last = std::min(last, floor_div(at[k], -step[k]));
    else if (at[k] < 0)
      last = -1;
  }
  return {first, last};
}

/// Where in a pixel the sample lies that its depth is taken from: the middle one, or the next.
double middle_sample(int samples) {
  const int middle = samples / 2;
  return (middle + 0.5) / samples;
}

}  // namespace

BandRasterizer::BandRasterizer(const PictureView& view, const PictureBand& band, int samples)
    : samples_(samples) {
  begin(view, band);
}

void BandRasterizer::begin(const PictureView& view, const PictureBand& band) {
  view_ = view;
  band_ = band;
  width_ = view.width;
  rows_ = band.drawn_high - band.drawn_low;
  light_.begin(view.camera, view.width, view.height, band.drawn_low, rows_, middle_sample(samples_));
  const std::size_t count =
      static_cast<std::size_t>(width_ * samples_) * static_cast<std::size_t>(rows_ * samples_);
  nearness_.assign(count, kNothing);
  rgba_.assign(count, 0);
}

std::uint64_t BandRasterizer::bytes(int width, int rows, int samples) {
  const std::uint64_t all = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(rows) *
                            static_cast<std::uint64_t>(samples * samples);
  return all * (sizeof(float) + sizeof(std::uint32_t)) + ScreenLight::bytes(width, rows);
}

void BandRasterizer::set_eye(const Double3& offset) {
  Camera camera = view_.camera;
  for (std::size_t i = 0; i < 3; ++i) camera.eye[i] -= offset[i];
  const std::array<float, 16> m = camera.view_matrix();
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 4; ++column) eye_[4 * row + column] = m[4 * column + row];
}

Float3 BandRasterizer::to_eye(const PictureVertex& v) const {
  Float3 p;
  for (std::size_t row = 0; row < 3; ++row)
    p[row] = eye_[4 * row] * v.x + eye_[4 * row + 1] * v.y + eye_[4 * row + 2] * v.z + eye_[4 * row + 3];
  return p;
}

/// Before the near plane, and not so far beside the frame that numbers of parts would not hold it.
bool BandRasterizer::in_sight(const Float3& p) const {
  constexpr double kBeside = 64.0;  // frames: products of two parts stay far from overflow
  const Camera& c = view_.camera;
  const double away = c.orthographic ? 1.0 : -double{p[2]};
  return (c.orthographic || away >= c.near_plane) && std::abs(p[0]) <= kBeside * c.half_width * away &&
         std::abs(p[1]) <= kBeside * c.half_height * away;
}

BandRasterizer::Spot BandRasterizer::spot(const Float3& p) const {
  const Camera& c = view_.camera;
  const double near = c.orthographic ? 1.0 : -1.0 / double{p[2]};
  const auto parts = [&](double at, double half, int pixels) {
    const double sample = 0.5 * (at * near / half + 1.0) * pixels * samples_;
    return static_cast<std::int64_t>(std::floor(sample * static_cast<double>(kParts) + 0.5));
  };
  // Bands have the parts of the whole view.
  return {parts(p[0], c.half_width, view_.width),
          parts(p[1], c.half_height, view_.height) - band_.drawn_low * samples_ * kParts,
          c.orthographic ? p[2] : static_cast<float>(near)};
}

/// Unit, towards the viewer. \param x, y  samples from the lower left of the band
Float3 BandRasterizer::view_at(double x, double y) const {
  const Camera& c = view_.camera;
  if (c.orthographic) return {0.0f, 0.0f, 1.0f};
  const double right = (2.0 * x / (view_.width * samples_) - 1.0) * c.half_width;
  const double up =
      (2.0 * (y + band_.drawn_low * samples_) / (view_.height * samples_) - 1.0) * c.half_height;
  return normalized({static_cast<float>(-right), static_cast<float>(-up), 1.0f});
}

void BandRasterizer::triangles(std::span<const PictureVertex> corners, const Double3& offset,
                               bool cut_backs) {
  if (corners.empty()) return;
  set_eye(offset);
  std::uint32_t last = ~corners.front().rgba;
  Float3 albedo{};
  for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
    const PictureVertex& v = corners[i];
    Look look;
    look.cut_backs = cut_backs;
    for (std::size_t row = 0; row < 3; ++row)
      look.normal[row] = eye_[4 * row] * static_cast<float>(v.nx) +
                         eye_[4 * row + 1] * static_cast<float>(v.ny) +
                         eye_[4 * row + 2] * static_cast<float>(v.nz);
    std::array<Corner, 3> face_corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const PictureVertex& corner = corners[i + k];
      if (corner.rgba != last) {
        last = corner.rgba;
        albedo = albedo_of(last);
      }
      face_corners[k] = {to_eye(corner), albedo};
    }
    face(face_corners, look);
  }
}

void BandRasterizer::face(const std::array<Corner, 3>& corners, const Look& look) {
  for (const Corner& c : corners)
    if (!in_sight(c.at)) return clipped(corners, look);
  fill(corners, {spot(corners[0].at), spot(corners[1].at), spot(corners[2].at)}, look);
}

/// What lies before the near plane and within a frame somewhat wider than the view.
void BandRasterizer::clipped(const std::array<Corner, 3>& corners, const Look& look) {
  constexpr double kWider = 2.0;
  const Camera& c = view_.camera;
  const double w = kWider * c.half_width, h = kWider * c.half_height;
  const double along = c.orthographic ? 0.0 : -1.0, across = c.orthographic ? 1.0 : 0.0;
  // Inside where x a + y b + z c + d is not below zero.
  const std::array<std::array<double, 4>, 5> planes = {{{0.0, 0.0, along, -c.near_plane * (1.0 - across)},
                                                        {1.0, 0.0, along * w, across * w},
                                                        {-1.0, 0.0, along * w, across * w},
                                                        {0.0, 1.0, along * h, across * h},
                                                        {0.0, -1.0, along * h, across * h}}};
  std::vector<Corner> polygon(corners.begin(), corners.end()), inside;
  for (const auto& plane : planes) {
    const auto side = [&](const Corner& corner) {
      return plane[0] * corner.at[0] + plane[1] * corner.at[1] + plane[2] * corner.at[2] + plane[3];
    };
    inside.clear();
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Corner &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
      const double at_a = side(a), at_b = side(b);
      if (at_a >= 0.0) inside.push_back(a);
      if ((at_a >= 0.0) == (at_b >= 0.0)) continue;
      const auto t = static_cast<float>(at_a / (at_a - at_b));
      inside.push_back({a.at + (b.at - a.at) * t, a.albedo + (b.albedo - a.albedo) * t});
    }
    polygon.swap(inside);
  }
  for (std::size_t i = 2; i < polygon.size(); ++i)
    fill({polygon[0], polygon[i - 1], polygon[i]},
         {spot(polygon[0].at), spot(polygon[i - 1].at), spot(polygon[i].at)}, look);
}

void BandRasterizer::put(std::size_t sample, int x, int y, float nearness, std::uint32_t rgba,
                         const Float3& normal) {
  if (!(nearness > nearness_[sample])) return;
  nearness_[sample] = nearness;
  rgba_[sample] = rgba;
  const int middle = samples_ / 2;
  const int px = x / samples_, py = y / samples_;
  if (x - px * samples_ != middle || y - py * samples_ != middle) return;
  light_.set_normal(px, py, normal);
}

void BandRasterizer::fill(const std::array<Corner, 3>& corners, const std::array<Spot, 3>& spots,
                          const Look& look) {
  const auto turn = [](const Spot& a, const Spot& b, const Spot& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  };
  std::int64_t area = turn(spots[0], spots[1], spots[2]);
  if (area == 0) return;
  const bool front = area > 0;
  if (!front && look.is_lit && look.cut_backs) return;
  // Samples whose middles may lie inside.
  const auto [x_low, x_high] = std::minmax({spots[0].x, spots[1].x, spots[2].x});
  const auto [y_low, y_high] = std::minmax({spots[0].y, spots[1].y, spots[2].y});
  const std::int64_t x0 = std::max<std::int64_t>((x_low - kMiddle + kParts - 1) >> 8, 0),
                     y0 = std::max<std::int64_t>((y_low - kMiddle + kParts - 1) >> 8, 0),
                     x1 = std::min<std::int64_t>((x_high - kMiddle) >> 8, width_ * samples_ - 1),
                     y1 = std::min<std::int64_t>((y_high - kMiddle) >> 8, rows_ * samples_ - 1);
  if (x0 > x1 || y0 > y1) return;

  // Counter-clockwise from here on.
  const std::size_t second = front ? 1 : 2, third = front ? 2 : 1;
  const std::array<const Spot*, 3> p = {&spots[0], &spots[second], &spots[third]};
  const std::array<const Corner*, 3> q = {&corners[0], &corners[second], &corners[third]};
  area = std::abs(area);
  std::array<std::int64_t, 3> row_at{}, step_x{}, step_y{};
  for (std::size_t k = 0; k < 3; ++k) {
    const Spot &a = *p[(k + 1) % 3], &b = *p[(k + 2) % 3];
    step_x[k] = -(b.y - a.y) * kParts;
    step_y[k] = (b.x - a.x) * kParts;
    row_at[k] = (b.x - a.x) * (y0 * kParts + kMiddle - a.y) - (b.y - a.y) * (x0 * kParts + kMiddle - a.x);
  }
  const double inverse = 1.0 / static_cast<double>(area);
  const double slope1 = (double{p[1]->nearness} - p[0]->nearness) * inverse,
               slope2 = (double{p[2]->nearness} - p[0]->nearness) * inverse;

  static const Float3 kBack = albedo_of(kBackFace);
  const std::int64_t longest = std::max(x1 - x0, y1 - y0) + 1;
  const bool one_albedo =
      !front || longest <= 2 || (q[0]->albedo == q[1]->albedo && q[0]->albedo == q[2]->albedo);
  const bool one_light = view_.camera.orthographic || longest <= kOneColour || !look.is_lit;
  const Float3 mean = look.is_lit && !front ? kBack
                      : q[0]->albedo == q[1]->albedo && q[0]->albedo == q[2]->albedo
                          ? q[0]->albedo
                          : (q[0]->albedo + q[1]->albedo + q[2]->albedo) * (1.0f / 3.0f);
  // Known once something of the face is seen; no colour is 0.
  Float3 normal = {0.0f, 0.0f, 1.0f}, middle_view;
  std::uint32_t one = 0;
  const auto look_at_it = [&] {
    middle_view = view_at(static_cast<double>(x0 + x1 + 1) * 0.5, static_cast<double>(y0 + y1 + 1) * 0.5);
    if (!look.is_lit) {
      one = unlit(mean);
      return;
    }
    const float size = dot(look.normal, look.normal);
    normal = size > 0.0f ? look.normal * ((front ? 1.0f : -1.0f) / std::sqrt(size))
                         : middle_view * (front ? 1.0f : -1.0f);
    one = lit(mean, normal, middle_view);
  };

  const auto wide = static_cast<std::size_t>(width_ * samples_);
  const auto fragment = [&](std::int64_t x, std::int64_t y, std::int64_t e1, std::int64_t e2) {
    const auto nearness = static_cast<float>(p[0]->nearness + static_cast<double>(e1) * slope1 +
                                             static_cast<double>(e2) * slope2);
    const std::size_t sample = static_cast<std::size_t>(y) * wide + static_cast<std::size_t>(x);
    if (!(nearness > nearness_[sample])) return;
    if (one == 0) look_at_it();
    std::uint32_t rgba = one;
    if (!one_albedo || !one_light) {
      Float3 albedo = mean;
      if (!one_albedo) {
        // By what is linear on the face, not on the screen.
        double w1 = static_cast<double>(e1) * inverse, w2 = static_cast<double>(e2) * inverse,
               w0 = 1.0 - w1 - w2;
        if (!view_.camera.orthographic) {
          w0 *= p[0]->nearness, w1 *= p[1]->nearness, w2 *= p[2]->nearness;
          const double all = w0 + w1 + w2;
          w0 /= all, w1 /= all, w2 /= all;
        }
        for (std::size_t c = 0; c < 3; ++c)
          albedo[c] = static_cast<float>(
              std::max(w0 * q[0]->albedo[c] + w1 * q[1]->albedo[c] + w2 * q[2]->albedo[c], 0.0));
      }
      rgba = !look.is_lit
                 ? unlit(albedo)
                 : lit(albedo, normal,
                       one_light ? middle_view
                                 : view_at(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5));
    }
    put(sample, static_cast<int>(x), static_cast<int>(y), nearness, rgba, normal);
  };
  const std::int64_t count = x1 - x0 + 1;
  for (std::int64_t y = y0; y <= y1; ++y) {
    if (count > kTested) {
      const auto [first, last] = span_of(row_at, step_x, count);
      for (std::int64_t i = first; i <= last; ++i)
        fragment(x0 + i, y, row_at[1] + i * step_x[1], row_at[2] + i * step_x[2]);
    } else {
      std::array<std::int64_t, 3> at = row_at;
      for (std::int64_t x = x0; x <= x1; ++x) {
        if ((at[0] | at[1] | at[2]) >= 0) fragment(x, y, at[1], at[2]);
        for (std::size_t k = 0; k < 3; ++k) at[k] += step_x[k];
      }
    }
    for (std::size_t k = 0; k < 3; ++k) row_at[k] += step_y[k];
  }
}

void BandRasterizer::lines(std::span<const PictureVertex> ends, const Double3& offset, float pixels,
                           float length) {
  set_eye(offset);
  const Camera& camera = view_.camera;
  const auto samples = static_cast<float>(samples_);
  const float most = 0.5f * pixels * samples, least = 0.5f * kMinLinePixels * samples;
  const auto eye_pixel = static_cast<float>(2.0 * camera.half_height / (view_.height * samples_));
  const auto size_at = [&](const Float3& p) {  // of a sample there
    return eye_pixel * (camera.orthographic ? 1.0f : std::max(-p[2], 1e-30f));
  };
  const auto half_width = [&](const Float3& p) {
    if (length <= 0.0f) return most;
    return std::clamp(0.43f * length / size_at(p), least, most);
  };
  const float limit = static_cast<float>(-camera.near_plane) * 1.0001f;
  Look look;
  look.is_lit = false;
  for (std::size_t i = 0; i + 1 < ends.size(); i += 2) {
    std::array<Float3, 2> p = {to_eye(ends[i]), to_eye(ends[i + 1])};
    if (!camera.orthographic) {
      if (p[0][2] > limit && p[1][2] > limit) continue;
      for (std::size_t k = 0; k < 2; ++k)
        if (p[k][2] > limit)
          p[k] = p[1 - k] + (p[k] - p[1 - k]) * ((limit - p[1 - k][2]) / (p[k][2] - p[1 - k][2]));
    }
    // Towards the viewer by a few times the line's width, in perspective along the ray (picture_shaders.h).
    std::array<float, 2> half{};
    for (std::size_t k = 0; k < 2; ++k) {
      half[k] = half_width(p[k]);
      const float width = 6.0f * half[k] * size_at(p[k]);
      if (camera.orthographic)
        p[k][2] += width;
      else
        p[k] = p[k] * std::max(1.0f - width / -p[k][2], 0.5f);
    }
    // In samples on the screen.
    const auto on_screen = [&](const Float3& at) {
      const float size = size_at(at);
      return std::array<float, 2>{at[0] / size, at[1] / size};
    };
    const auto a = on_screen(p[0]), b = on_screen(p[1]);
    std::array<float, 2> along = {b[0] - a[0], b[1] - a[1]};
    const float distance = std::sqrt(along[0] * along[0] + along[1] * along[1]);
    along = distance > 1e-6f ? std::array<float, 2>{along[0] / distance, along[1] / distance}
                             : std::array<float, 2>{1.0f, 0.0f};
    const std::array<float, 2> across = {-along[1], along[0]};
    const Float3 albedo = albedo_of(ends[i].rgba);
    const auto corner = [&](std::size_t end, float side) {
      const float size = half[end] * size_at(p[end]), forwards = end == 1 ? 1.0f : -1.0f;
      return Corner{{p[end][0] + (across[0] * side + along[0] * forwards) * size,
                     p[end][1] + (across[1] * side + along[1] * forwards) * size, p[end][2]},
                    albedo};
    };
    const std::array<Corner, 4> c = {corner(0, -1.0f), corner(0, 1.0f), corner(1, -1.0f), corner(1, 1.0f)};
    face({c[0], c[1], c[2]}, look);
    face({c[2], c[1], c[3]}, look);
  }
}

void BandRasterizer::finish(double strength, double occlusion_share, Image& image) {
  const Camera& c = view_.camera;
  const auto wide = static_cast<std::size_t>(width_ * samples_);
  const float behind = std::nextafter(static_cast<float>(c.far_plane), 0.0f);
  for (int y = 0; y < rows_; ++y)
    for (int x = 0; x < width_; ++x) {
      const float nearness = nearness_[static_cast<std::size_t>(y * samples_ + samples_ / 2) * wide +
                                       static_cast<std::size_t>(x * samples_ + samples_ / 2)];
      if (nearness != kNothing)
        light_.set_distance(x, y, std::min(c.orthographic ? -nearness : 1.0f / nearness, behind));
    }
  // In perspective a view's size grows with distance: measured where the scene begins.
  const double half_width = c.orthographic ? c.half_width : c.half_width * 0.5 * (c.near_plane + c.far_plane);
  light_.find_occlusion(strength, occlusion_share * half_width);
  std::vector<float> light(light_.row_size());
  const auto all = static_cast<float>(samples_ * samples_);
  for (int row = band_.low; row < band_.high; ++row) {
    const int y = row - band_.drawn_low;
    light_.shares(y, 0.02 * half_width, light);
    const float height = (static_cast<float>(row) + 0.5f) / static_cast<float>(view_.height);
    Float3 background;
    constexpr Float3 kLow = {0.70f, 0.72f, 0.74f}, kHigh = {0.93f, 0.94f, 0.95f};
    for (std::size_t k = 0; k < 3; ++k) {
      const float stored = kLow[k] + (kHigh[k] - kLow[k]) * height;
      background[k] = stored * stored;
    }
    const std::array<std::uint8_t, 3> nothing = {stored_byte(background[0]), stored_byte(background[1]),
                                                 stored_byte(background[2])};
    std::uint8_t* to = image.pixel(view_.x, view_.y + view_.height - 1 - row);
    for (int x = 0; x < width_; ++x) {
      std::array<std::uint32_t, 3> sum{};  // of squares
      std::uint32_t cover = 0;
      for (int j = 0; j < samples_; ++j) {
        const std::uint32_t* from = rgba_.data() + static_cast<std::size_t>(y * samples_ + j) * wide +
                                    static_cast<std::size_t>(x * samples_);
        for (int i = 0; i < samples_; ++i) {
          const std::uint32_t rgba = from[i];
          cover += rgba >> 31;
          for (std::size_t k = 0; k < 3; ++k) {
            const std::uint32_t stored = (rgba >> (8 * k)) & 0xffu;
            sum[k] += stored * stored;
          }
        }
      }
      if (cover == 0) {
        std::copy(nothing.begin(), nothing.end(), to + 3 * x);
        continue;
      }
      const float shown = light[static_cast<std::size_t>(x)] / (255.0f * 255.0f * all);
      const float open = 1.0f - static_cast<float>(cover) / all;
      for (std::size_t k = 0; k < 3; ++k) {
        const float linear = static_cast<float>(sum[k]) * shown + background[k] * open;
        to[3 * x + static_cast<int>(k)] = stored_byte(linear);
      }
    }
  }
}

}  // namespace tessera
