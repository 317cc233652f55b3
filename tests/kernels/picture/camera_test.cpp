#include "kernels/picture/camera.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "octree/vector.h"

namespace tessera::camera_test {

namespace {

void check_direction(const std::string& name, const Double3& up, const Double3& back) {
  CAPTURE(name);
  const ViewSpec view = parse_view(name, up);
  for (std::size_t k = 0; k < 3; ++k) CHECK(view.back[k] == Approx(back[k]).margin(1e-12));
}

/// Clip coordinates of a point, after the division.
Double3 clip(const Camera& camera, const Double3& p) {
  const auto v = camera.view_matrix(), c = camera.projection_matrix();
  std::array<double, 4> eye{}, out{};
  for (std::size_t r = 0; r < 4; ++r)
    for (std::size_t k = 0; k < 4; ++k) eye[r] += static_cast<double>(v[4 * k + r]) * (k < 3 ? p[k] : 1.0);
  for (std::size_t r = 0; r < 4; ++r)
    for (std::size_t k = 0; k < 4; ++k) out[r] += static_cast<double>(c[4 * k + r]) * eye[k];
  return {out[0] / out[3], out[1] / out[3], out[2] / out[3]};
}

const std::vector<Float3> kCube = {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1},
                                   {-1, -1, 1},  {1, -1, 1},  {-1, 1, 1},  {1, 1, 1}};

}  // namespace

TEST_CASE("camera: named views look from where they say", "[unit]") {
  check_direction("front", {0, 0, 1}, {0, -1, 0});
  check_direction("back", {0, 0, 1}, {0, 1, 0});
  check_direction("right", {0, 0, 1}, {1, 0, 0});
  check_direction("left", {0, 0, 1}, {-1, 0, 0});
  check_direction("top", {0, 0, 1}, {0, 0, 1});
  check_direction("bottom", {0, 0, 1}, {0, 0, -1});
  check_direction("front", {0, 1, 0}, {0, 0, 1});
  check_direction("front", {0, 0, 7}, {0, -1, 0});
  CHECK_THROWS_AS(parse_view("sideways", {0, 0, 1}), UsageError);
  CHECK_THROWS_AS(parse_view("turn:x", {0, 0, 1}), UsageError);
}

TEST_CASE("camera: an eye looks at its target, but not at itself", "[unit]") {
  const ViewSpec view = eye_view({0, -5, 0}, {0, 0, 0}, {0, 0, 1});
  CHECK(view.has_eye);
  CHECK_FALSE(view.orthographic);
  CHECK(view.back == Double3{0, -1, 0});
  CHECK_THROWS_AS(eye_view({1, 2, 3}, {1, 2, 3}, {0, 0, 1}), UsageError);
}

TEST_CASE("camera: what is seen fills the frame but for the margin, nearer is smaller in depth", "[unit]") {
  for (const std::string name : {"front", "iso", "turn:70"})
    for (const double aspect : {1.0, 2.0, 0.5}) {
      CAPTURE(name, aspect);
      Camera camera = fit_camera(parse_view(name, {0, 0, 1}), kCube, aspect, 1.0);
      set_depth_range(camera, {-1, -1, -1}, {1, 1, 1});
      double widest = 0.0;
      for (const Float3& p : kCube) {
        const Double3 q = clip(camera, {p[0], p[1], p[2]});
        for (std::size_t k = 0; k < 3; ++k) CHECK(std::abs(q[k]) <= 1.0 + 1e-5);
        widest = std::max({widest, std::abs(q[0]), std::abs(q[1])});
      }
      CHECK(widest == Approx(1.0 / 1.1).epsilon(1e-4));
      CHECK(clip(camera, camera.back)[2] < clip(camera, camera.back * -1.0)[2]);
      CHECK(dot(camera.right, camera.up) == Approx(0.0).margin(1e-12));
      CHECK(dot(camera.right, camera.back) == Approx(0.0).margin(1e-12));
    }
}

TEST_CASE("camera: zoom enlarges by its factor about the same centre", "[unit]") {
  const ViewSpec front = parse_view("front", {0, 0, 1});
  const Camera one = fit_camera(front, kCube, 1.0, 1.0), four = fit_camera(front, kCube, 1.0, 4.0);
  const Double3 corner = {1, 0, 1};
  CHECK(clip(four, corner)[0] == Approx(4.0 * clip(one, corner)[0]));
  CHECK(clip(four, corner)[1] == Approx(4.0 * clip(one, corner)[1]));
}

}  // namespace tessera::camera_test
