// Faces and lines drawn by the processor alone: the picture that OpenGL draws, band by band the same, from before and behind the eye.
#include <catch2/catch.hpp>

#include <cstdlib>
#include <vector>

#include "kernels/picture/picture.h"
#include "octree/vector.h"
#include "tests/helpers/icosphere.h"

namespace band_rasterizer_test {

using namespace tessera;
using namespace tessera::test;

namespace {

PictureVertex vertex(const Double3& p, std::uint32_t rgba = kClay) {
  PictureVertex v;
  v.x = static_cast<float>(p[0]), v.y = static_cast<float>(p[1]), v.z = static_cast<float>(p[2]);
  v.rgba = rgba;
  return v;
}

void add_face(std::vector<PictureVertex>& corners, const std::array<Double3, 3>& p,
              const std::array<std::uint32_t, 3>& rgba) {
  const Double3 n = cross(p[1] - p[0], p[2] - p[0]);
  for (std::size_t k = 0; k < 3; ++k) {
    corners.push_back(vertex(p[k], rgba[k]));
    set_normal(corners.back(), static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2]));
  }
}

/// A heap of balls, dark where they touch, of a colour that runs across them; one is open, its inside seen.
std::vector<PictureVertex> balls(int level) {
  std::vector<PictureVertex> corners;
  const Icosphere ball = icosphere(level);
  for (const Double3& centre :
       {Double3{0, 0, 0}, Double3{0.9, 0.3, 0.2}, Double3{-0.7, 0.5, 0.9}, Double3{0.2, -0.8, 0.7}})
    for (const auto& f : ball.faces) {
      std::array<Double3, 3> p;
      std::array<std::uint32_t, 3> rgba{};
      bool cap = false;
      for (std::size_t k = 0; k < 3; ++k) {
        const Double3& n = ball.positions[f[k]];
        p[k] = centre + n;
        rgba[k] = 0xff000000u | static_cast<std::uint32_t>(128.0 + 100.0 * n[0]) |
                  static_cast<std::uint32_t>(128.0 + 100.0 * n[1]) << 8 | 0x400000u;
        cap = cap || (centre[2] > 0.8 && n[2] > 0.5);
      }
      if (!cap) add_face(corners, p, rgba);
    }
  return corners;
}

struct Scene {
  std::vector<PictureVertex> corners, ends;
  PictureOptions options;
  PictureView view;

  Scene(int level, const std::string& from) : corners(balls(level)) {
    for (int i = 0; i < 40; ++i) {
      const double x = -1.6 + 0.08 * i;
      ends.push_back(vertex({x, -1.7, -0.9}, kBorderEdge));
      ends.push_back(vertex({x + 0.08, -1.7, -0.9 + 0.02 * (i % 3)}, kBorderEdge));
    }
    options.width = view.width = 300;
    options.height = view.height = 240;
    options.supersample = 2;
    const std::vector<Float3> around = {{-2, -2, -2}, {2, 2, 2}};
    view.camera = fit_camera(parse_view(from, {0, 0, 1}), around, 300.0 / 240.0, 1.6);
    set_depth_range(view.camera, {-2, -2, -2}, {2, 2, 2});
  }
  std::vector<std::uint8_t> drawn(bool only_faces, bool cut = false) {
    options.only_faces = only_faces;
    return drawn(picture_bands(options, std::span(&view, 1)), 1, cut);
  }
  std::vector<std::uint8_t> drawn(const std::vector<PictureBand>& bands, std::size_t at_once, bool cut) {
    Picture picture(options, std::span(&view, 1));
    Image image = blank_picture(options);
    for (std::size_t i = 0; i < bands.size(); i += at_once) {
      picture.begin(std::span(bands).subspan(i, std::min(at_once, bands.size() - i)));
      picture.set_offset({0.1, 0.0, 0.0});
      picture.cut_backs(cut);
      picture.triangles(corners);
      picture.lines(ends, 2.6f, 0.08f);
      picture.finish(image);
    }
    return image.rgb;
  }
};

/// Share of the bytes that differ by more than `step`.
double differing(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b, int step) {
  REQUIRE(a.size() == b.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) count += std::abs(int{a[i]} - int{b[i]}) > step;
  return static_cast<double>(count) / static_cast<double>(a.size());
}

}  // namespace

TEST_CASE("band rasterizer: it draws what OpenGL draws", "[unit]") {
  const std::string from = GENERATE("front", "iso", "top");
  const int level = GENERATE(1, 3, 5);  // large faces, small ones, some below a sample
  const bool cut = GENERATE(false, true);
  CAPTURE(from, level, cut);
  Scene scene(level, from);
  const auto want = scene.drawn(false, cut), got = scene.drawn(true, cut);
  // Samples on outlines, and taps of occlusion that lie half a pixel elsewhere.
  CHECK(differing(want, got, 40) < 0.002);
  CHECK(differing(want, got, 12) < 0.02);
  CHECK(differing(want, blank_picture(scene.options).rgb, 40) > 0.1);  // something is there
  if (from != "front")
    CHECK(differing(got, scene.drawn(true, !cut), 40) > 0.0005);  // the inside of the open ball
}

TEST_CASE("band rasterizer: bands have the pixels of the whole view, however many are held", "[property]") {
  const std::string from = GENERATE("front", "iso");
  Scene scene(3, from);
  scene.options.only_faces = true;
  const std::vector<PictureBand> whole = picture_bands(scene.options, std::span(&scene.view, 1));
  REQUIRE(whole.size() == 1);
  std::vector<PictureBand> parts;
  const int margin = from == "front" ? 20 : 80;  // pixels: more than occlusion looks at
  for (int low = 0; low < 240; low += 48)
    parts.push_back({0, low, low + 48, std::max(low - margin, 0), std::min(low + 48 + margin, 240)});
  const auto got = scene.drawn(parts, 2, false);
  CHECK((got == scene.drawn(parts, 1, false)));
  CHECK((got == scene.drawn(parts, 5, false)));
  CHECK(differing(got, scene.drawn(whole, 1, false), 2) < 0.001);  // floats round otherwise
}

TEST_CASE("band rasterizer: a floor that reaches behind the eye covers what lies below the horizon",
          "[unit]") {
  PictureOptions options;
  options.width = options.height = 100;
  options.supersample = 1;
  options.occlusion = 0.0;
  options.only_faces = true;
  PictureView view;
  view.width = view.height = 100;
  const std::vector<Float3> around = {{-1, -1, -1}, {1, 1, 1}};
  view.camera = fit_camera(eye_view({0, 0, 1}, {0, 1, 1}, {0, 0, 1}), around, 1.0, 1.0);
  const double size = GENERATE(1e3, 1e4);  // the near plane keeps to a ten-thousandth of it
  set_depth_range(view.camera, {-size, -size, 0}, {size, size, 2});
  std::vector<PictureVertex> corners;
  const std::uint32_t red = 0xff0000ffu;
  add_face(corners, {Double3{-size, -size, 0}, Double3{size, -size, 0}, Double3{size, size, 0}},
           {red, red, red});
  add_face(corners, {Double3{-size, -size, 0}, Double3{size, size, 0}, Double3{-size, size, 0}},
           {red, red, red});
  Picture picture(options, std::span(&view, 1));
  Image image = blank_picture(options);
  const std::vector<PictureBand> bands = picture_bands(options, std::span(&view, 1));
  picture.begin(bands);
  picture.triangles(corners);
  picture.finish(image);
  int covered = 0;
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 100; ++x) {
      const std::uint8_t* rgb = image.pixel(x, y);
      covered += rgb[0] > rgb[2] + 30;
      if (y < 49) CHECK(rgb[0] <= rgb[2] + 30);
    }
  CHECK(covered >=
        4700);  // the near plane cuts nothing that is seen, the far end is less than a few rows away
  CHECK(covered <= 5000);
}

TEST_CASE("band rasterizer: a sheet of long thin faces has neither gaps nor specks beside it", "[unit]") {
  PictureOptions options;
  options.width = options.height = 200;
  options.supersample = 1;
  options.only_faces = true;
  PictureView view;
  view.width = view.height = 200;
  const std::vector<Float3> around = {{-1, -1, 0}, {1, 1, 0}};
  view.camera = fit_camera(parse_view("top", {0, 0, 1}), around, 1.0, 1.0);
  set_depth_range(view.camera, {-1, -1, -0.1}, {1, 1, 0.1});
  std::vector<PictureVertex> corners;
  const std::uint32_t red = 0xff0000ffu;
  const int fans = 997;  // around a corner of the square
  const auto at = [&](int i) {
    const double t = 2.0 * i / fans;
    return t <= 1.0 ? Double3{1, -1 + 2 * t, 0} : Double3{1 - 2 * (t - 1), 1, 0};
  };
  for (int i = 0; i < fans; ++i) {
    const Double3 a = at(i), b = at(i + 1);
    add_face(corners, {Double3{-1, -1, 0}, a, b}, {red, red, red});
    if (a[0] == 1.0 && b[0] < 1.0) add_face(corners, {a, Double3{1, 1, 0}, b}, {red, red, red});
  }
  Picture picture(options, std::span(&view, 1));
  Image image = blank_picture(options);
  picture.begin(picture_bands(options, std::span(&view, 1)));
  picture.triangles(corners);
  picture.finish(image);
  int covered = 0;
  for (int y = 0; y < 200; ++y)
    for (int x = 0; x < 200; ++x) covered += image.pixel(x, y)[0] > image.pixel(x, y)[2] + 30;
  const double side = 200.0 / 1.10;  // the fit leaves a margin
  CHECK(covered == Approx(side * side).epsilon(0.006));
}

}  // namespace band_rasterizer_test
