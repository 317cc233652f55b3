#include "kernels/smooth/denoise.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "kernels/mesh/face_corners.h"
#include "kernels/smooth/normal_filter.h"
#include "kernels/smooth/smooth.h"
#include "kernels/smooth/star_sides.h"
#include "kernels/smooth/surface_window.h"
#include "kernels/smooth/window_fit.h"
#include "octree/portable_math.h"
#include "tests/helpers/block_meshes.h"

namespace denoise_test {

namespace {

using namespace tessera;

struct Errors {
  double rms = 0.0, maximum = 0.0, at_95 = 0.0;
};

Errors errors(std::vector<double> values) {
  Errors e;
  for (double& v : values) {
    v = std::abs(v);
    e.rms += v * v;
    e.maximum = std::max(e.maximum, v);
  }
  e.rms = std::sqrt(e.rms / static_cast<double>(values.size()));
  std::sort(values.begin(), values.end());
  e.at_95 = values[values.size() * 95 / 100];
  return e;
}

std::vector<Double3> denoised(const MeshBlock& block, const DenoiseOptions& options = {}) {
  const std::vector<std::uint8_t> all(block.position.size(), 1);
  const DenoisedBlock found = denoise(block, FaceCorners(block), options, all, all);
  CHECK(found.right == all);
  return found.position;
}

/// Of a unit cube: how far from the planes that each vertex of the clean cube lies on, by their number.
std::array<std::vector<double>, 4> off_cube(const MeshBlock& clean, const std::vector<Double3>& position) {
  std::array<std::vector<double>, 4> off;
  for (std::size_t v = 0; v < position.size(); ++v) {
    std::size_t sides = 0;
    double sum = 0.0;
    for (std::size_t a = 0; a < 3; ++a) {
      const double c = clean.position[v][a];
      if (c != 0.0 && c != 1.0) continue;
      ++sides;
      sum += (position[v][a] - c) * (position[v][a] - c);
    }
    off[sides].push_back(std::sqrt(sum));
  }
  return off;
}

void add_gaussian(MeshBlock& block, double deviation, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, deviation);
  for (Double3& p : block.position)
    for (double& x : p) x += normal(random);
}

/// A roof over a square grid of unit edges whose sides open by `degrees` along y, on the crease at x = columns / 2.
MeshBlock roof(int size, double degrees) {
  const double slope = std::tan(0.5 * degrees * 3.14159265358979 / 180.0);
  return test::grid_block(size, size, [&](double x, double) { return -slope * std::abs(x - size / 2); });
}

WindowSamples random_samples(int count, double noise, unsigned seed, double (*height)(double, double)) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> coordinate(-1.0, 1.0);
  std::normal_distribution<double> normal(0.0, 1.0);
  WindowSamples samples;
  for (int i = 0; i < count; ++i) {
    const double s = coordinate(random), t = coordinate(random);
    samples.add(s, t, height(s, t) + noise * normal(random), 1.0);
  }
  return samples;
}

double quadric(double s, double t) {
  return 0.3 - 0.2 * s + 0.5 * t + 0.7 * s * s - 0.4 * s * t + 0.1 * t * t;
}

}  // namespace

TEST_CASE("window fit: a quadric is found exactly, a plane where it is one", "[unit]") {
  const WindowSamples samples = random_samples(101, 0.0, 1, quadric);
  const auto fit = fit_window(samples, 0.9, 6);
  REQUIRE(fit);
  const std::array<double, 6> expected = {0.3, -0.2, 0.5, 0.7, -0.4, 0.1};
  for (std::size_t i = 0; i < 6; ++i) CHECK(fit->c[i] == Approx(expected[i]).margin(1e-12));
  CHECK(fit->residual_square < 1e-12);
  const WindowSamples flat = random_samples(50, 0.0, 2, [](double s, double t) { return 2.0 + s - t; });
  const auto plane = fit_window(flat, 2.0, 3);
  REQUIRE(plane);
  CHECK(plane->c[0] == Approx(2.0));
  CHECK(plane->c[1] == Approx(1.0));
  CHECK(plane->c[2] == Approx(-1.0));
  CHECK(plane->c[3] == 0.0);
}

TEST_CASE("window fit: too few samples, or samples on a line, make no fit", "[unit]") {
  CHECK_FALSE(fit_window(random_samples(7, 0.0, 3, quadric), 5.0, 6));
  CHECK(fit_window(random_samples(7, 0.0, 3, quadric), 5.0, 3));
  WindowSamples line;
  for (int i = -20; i <= 20; ++i) line.add(0.01 * i, 0.02 * i, 0.0, 1.0);
  CHECK_FALSE(fit_window(line, 5.0, 6));
  CHECK_FALSE(fit_window(line, 5.0, 3));
}

TEST_CASE("window fit: its variance is that of repeated fits, its residual the noise", "[property]") {
  const int repeats = 400;
  const double noise = 0.1;
  double squares = 0.0, expected = 0.0, residual = 0.0;
  std::vector<double> between;
  for (int i = 0; i < repeats; ++i) {
    const WindowSamples samples = random_samples(150, noise, 100 + static_cast<unsigned>(i), quadric);
    const auto fit = fit_window(samples, 1.0, 6);
    REQUIRE(fit);
    squares += (fit->c[0] - 0.3) * (fit->c[0] - 0.3);
    expected += fit->variance * noise * noise;
    residual += fit->residual_square;
    between.push_back(noise_square_between(samples, 0.6, 1.2));
  }
  CHECK(squares / expected == Approx(1.0).margin(0.2));
  CHECK(std::sqrt(residual / repeats) == Approx(noise).epsilon(0.1));
  std::nth_element(between.begin(), between.begin() + repeats / 2, between.end());
  CHECK(std::sqrt(between[repeats / 2] / 0.4549) == Approx(noise).epsilon(0.15));
}

TEST_CASE("window choice: wide on a smooth surface, narrow before a step", "[unit]") {
  const double noise = 0.02;
  const auto chosen = [&](double (*height)(double, double)) {
    const WindowSamples samples = random_samples(2000, noise, 7, height);
    WindowChoice choice(noise);
    int windows = 0;
    for (double radius = 0.15; radius < 1.0 && choice.offer(samples, radius); radius *= 1.35) ++windows;
    const auto fit = choice.result(samples);
    REQUIRE(fit);
    return std::pair{windows, *fit};
  };
  const auto [all, smooth] = chosen(quadric);
  CHECK(all == 7);
  CHECK(std::abs(smooth.c[0] - 0.3) < 3.0 * noise * std::sqrt(smooth.variance));
  const auto [few, stepped] = chosen([](double s, double) { return s > 0.3 ? 0.5 : 0.0; });
  CHECK(few < 5);
  CHECK(std::abs(stepped.c[0]) < 2.0 * noise);
}

TEST_CASE("star sides: one on a face, two at an edge, three at a corner of a cube", "[unit]") {
  const MeshBlock cube = test::cube_block(6);
  const FaceCorners corners(cube);
  const std::vector<Float3> normals = filter_normals(cube, corners, {.normal_rounds = 4});
  std::array<int, 4> found = {};
  StarSides sides;
  for (std::uint32_t v = 0; v < cube.position.size(); ++v) {
    sides.find(cube, corners.at(v), normals, cube.position);
    std::size_t planes = 0, faces = 0;
    for (const double c : cube.position[v]) planes += c == 0.0 || c == 1.0;
    CHECK(sides.count() == planes);
    for (std::size_t k = 0; k < sides.count(); ++k) faces += sides.faces(k).size();
    CHECK(faces == corners.at(v).size());
    ++found[sides.count()];
  }
  CHECK(found[2] == 12 * 5);
  CHECK(found[3] == 8);
}

TEST_CASE("normal filter: normals of some faces are those that all faces give", "[unit]") {
  MeshBlock block = roof(40, 60.0);
  test::add_noise(block, 0.2, 5);
  const FaceCorners corners(block);
  for (const int rounds : {1, 4, 8}) {
    CAPTURE(rounds);
    const NormalFilterOptions options = {.normal_rounds = rounds};
    const std::vector<Float3> all = filter_normals(block, corners, options);
    std::vector<std::uint8_t> wanted(block.faces.size(), 0);
    for (std::size_t f = 900; f < 920; ++f) wanted[f] = 1;
    const std::vector<Float3> some = filter_normals(block, corners, options, wanted);
    std::size_t others = 0;
    for (std::size_t f = 0; f < all.size(); ++f)
      if (wanted[f] != 0)
        CHECK(some[f] == all[f]);
      else
        others += some[f] != all[f];
    CHECK(others > all.size() / 4);  // they are not filtered
  }
}

TEST_CASE("normal filter: faces at the tip of a wide fan are not neighbours, faces that share an edge are",
          "[unit]") {
  // A flat disk of 20,000 sides: its pairs alone would be 400 million weights.
  constexpr std::uint32_t kSides = 20'000;
  std::vector<Double3> position = {{0, 0, 0}};
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (std::uint32_t i = 0; i < kSides; ++i) {
    const double angle = 2.0 * kPi * i / kSides;
    position.push_back({std::cos(angle), std::sin(angle), i % 2 == 0 ? 0.0 : 1e-5});
    faces.push_back({0, 1 + i, 1 + (i + 1) % kSides});
  }
  const MeshBlock block = test::make_block(position, faces);
  const FaceCorners corners(block);
  const std::vector<Float3> raw = filter_normals(block, corners, {.normal_rounds = 0});
  const std::vector<Float3> filtered = filter_normals(block, corners, {.normal_rounds = 8});
  const auto lowest = [](const std::vector<Float3>& normals) {
    float z = 1.0F;
    for (const Float3& n : normals) z = std::min(z, n[2]);
    return z;
  };
  CHECK(lowest(raw) < 0.9996F);
  CHECK(lowest(filtered) > 0.99999F);
}

TEST_CASE("surface window: it does not pass a crease", "[unit]") {
  const MeshBlock block = roof(40, 60.0);
  const FaceCorners corners(block);
  const std::vector<Float3> normals = filter_normals(block, corners, {});
  SurfaceWindow window(block, corners, normals, block.position, block.position);
  StarSides sides;
  for (std::uint32_t v = 0; v < block.position.size(); ++v) {
    if (block.position[v][0] != 17.0 || block.position[v][1] != 20.0) continue;
    sides.find(block, corners.at(v), normals, block.position);
    REQUIRE(sides.count() == 1);
    window.begin(v, sides.normal(0), sides.faces(0));
    for (const double radius : {2.0, 4.0, 8.0}) {
      window.grow(radius);
      std::size_t beyond = 0;
      double nearest = 40.0;
      const WindowFrame& frame = window.frame();
      for (std::size_t k = 0; k < window.samples().size(); ++k) {
        const WindowSamples::Pack& pack = window.samples().packs()[k / 4];
        const double x = frame.origin[0] + frame.a[0] * pack.s[k % 4] + frame.b[0] * pack.t[k % 4] +
                         frame.n[0] * pack.z[k % 4];
        beyond += x > 20.0 + 1e-9;
        nearest = std::min(nearest, std::abs(x - 20.0));
      }
      CHECK(beyond == 0);
      CHECK(nearest < (radius > 3.5 ? 1e-9 : 3.0));
    }
    CHECK(window.samples().size() > 80);
    return;
  }
  FAIL("no such vertex");
}

TEST_CASE("denoise: a noisy cube gets its planes, edges and corners back", "[property]") {
  const int n = 30;
  const MeshBlock clean = test::cube_block(n);
  const double edge = 1.0 / n, share = GENERATE(0.1, 0.2);
  MeshBlock noisy = clean;
  add_gaussian(noisy, share * edge, 5);
  const auto before = off_cube(clean, noisy.position), after = off_cube(clean, denoised(noisy));
  CHECK(after[2].size() == 12 * (n - 1));
  CHECK(errors(after[1]).rms < 0.125 * errors(before[1]).rms);
  CHECK(errors(after[2]).rms < 0.3 * errors(before[2]).rms);
  CHECK(errors(after[2]).at_95 < 0.6 * share * edge);
  // A corner of three faces has little to tell its sides by.
  std::vector<double> corners = after[3];
  std::sort(corners.begin(), corners.end());
  CHECK(corners[3] < share * edge);
}

TEST_CASE("denoise: a clean cube stays as it is", "[unit]") {
  const MeshBlock cube = test::cube_block(12);
  const std::vector<Double3> now = denoised(cube);
  double maximum = 0.0;
  for (std::size_t v = 0; v < now.size(); ++v)
    for (std::size_t a = 0; a < 3; ++a)
      maximum = std::max(maximum, std::abs(now[v][a] - cube.position[v][a]));
  CHECK(maximum < 1e-6);
}

TEST_CASE("denoise: a rounded edge stays rounded", "[property]") {
  // A quarter of a cylinder of two edges' radius between two planes.
  const int size = 60;
  const auto height = [](double x, double) {
    const double u = x - 30.0, r = 2.0 * 1.41421356;
    return std::abs(u) > 2.0 ? -std::abs(u) : std::sqrt(r * r - u * u) - 2.0 * r * 0.70710678 - 0.0;
  };
  const MeshBlock clean = test::grid_block(size, size, height);
  MeshBlock noisy = clean;
  add_gaussian(noisy, 0.05, 61);
  const std::vector<Double3> now = denoised(noisy);
  std::vector<double> before, after;
  for (std::size_t v = 0; v < now.size(); ++v) {
    const Double3& c = clean.position[v];
    if (std::abs(c[0] - 30.0) > 2.5 || c[1] < 5 || c[1] > size - 5) continue;
    before.push_back(noisy.position[v][2] - height(noisy.position[v][0], 0.0));
    after.push_back(now[v][2] - height(now[v][0], 0.0));
  }
  CHECK(after.size() > 200);
  CHECK(errors(after).maximum < 0.45);
  CHECK(errors(after).rms < 1.5 * errors(before).rms);
}

TEST_CASE("denoise: a noisy sphere stays round and of its size", "[property]") {
  const MeshBlock clean = test::sphere_block(5);
  const double edge = 2.0 / std::sqrt(static_cast<double>(clean.position.size())) * 1.9;
  MeshBlock noisy = clean;
  add_gaussian(noisy, 0.2 * edge, 9);
  std::vector<double> before, after;
  double mean = 0.0;
  for (const Double3& p : noisy.position) before.push_back(std::hypot(p[0], p[1], p[2]) - 1.0);
  for (const Double3& p : denoised(noisy)) {
    after.push_back(std::hypot(p[0], p[1], p[2]) - 1.0);
    mean += after.back() / static_cast<double>(clean.position.size());
  }
  CHECK(errors(after).rms < errors(before).rms / 4.5);
  CHECK(std::abs(mean) < 0.02 * edge);
}

TEST_CASE("denoise: creases of 60 to 120 degrees stay where they are", "[property]") {
  const double degrees = GENERATE(60.0, 75.0, 90.0, 120.0);
  const int size = 60;
  const MeshBlock clean = roof(size, degrees);
  MeshBlock noisy = clean;
  add_gaussian(noisy, 0.1, 21);
  const std::vector<Double3> now = denoised(noisy);
  std::vector<double> before, after;
  for (std::size_t v = 0; v < now.size(); ++v) {
    const Double3& c = clean.position[v];
    if (c[0] != size / 2 || c[1] < 5 || c[1] > size - 5) continue;
    before.push_back(std::hypot(noisy.position[v][0] - c[0], noisy.position[v][2] - c[2]));
    after.push_back(std::hypot(now[v][0] - c[0], now[v][2] - c[2]));
  }
  CHECK(after.size() > 40);
  CHECK(errors(after).at_95 < 0.08);
  CHECK(errors(after).rms < 0.3 * errors(before).rms);
}

TEST_CASE("denoise: faces that noise turned over are spread out again", "[property]") {
  MeshBlock noisy = test::grid_block(50, 50, [](double, double) { return 0.0; });
  add_gaussian(noisy, 0.3, 33);
  const auto reversed = [&](const std::vector<Double3>& p) {
    std::size_t count = 0;
    for (const auto& f : noisy.faces)
      count += (p[f[1]][0] - p[f[0]][0]) * (p[f[2]][1] - p[f[0]][1]) <=
               (p[f[1]][1] - p[f[0]][1]) * (p[f[2]][0] - p[f[0]][0]);
    return count;
  };
  CHECK(reversed(noisy.position) > 100);
  CHECK(reversed(denoised(noisy)) < reversed(noisy.position) / 10);
}

TEST_CASE("denoise: noise that is given instead of measured decides how wide windows are", "[unit]") {
  const MeshBlock wavy = test::grid_block(60, 60, [](double x, double) { return 0.3 * std::sin(0.5 * x); });
  const auto moved = [&](double noise) {
    DenoiseOptions options;
    options.noise = noise;
    const std::vector<Double3> now = denoised(wavy, options);
    double sum = 0.0;
    for (std::size_t v = 0; v < now.size(); ++v) sum += std::abs(now[v][2] - wavy.position[v][2]);
    return sum / static_cast<double>(now.size());
  };
  CHECK(moved(1e-4) < 0.005);
  CHECK(moved(1.0) > 0.02);
}

TEST_CASE("denoise: same bits in every block with enough rings, and whatever else is wanted", "[property]") {
  MeshBlock whole = test::grid_block(
      190, 24, [](double x, double y) { return x < 100 ? 0.02 * y * y : 0.02 * y * y + 0.9 * (x - 100); });
  add_gaussian(whole, 0.15, 41);
  SmoothRound round;
  round.by_fits = true;
  round.noise = GENERATE(0.0, 0.1);
  const SmoothedBlock all = smooth_block(whole, round);
  std::vector<std::uint8_t> wanted(whole.position.size());
  for (std::size_t v = 0; v < wanted.size(); ++v) wanted[v] = v % 7 == 0;
  const SmoothedBlock some = smooth_block(whole, round, wanted);
  for (std::size_t v = 0; v < wanted.size(); ++v)
    if (some.complete[v] != 0) REQUIRE(some.position[v] == all.position[v]);
  for (const double cut : {90.0, 120.0}) {
    const MeshBlock piece =
        test::piece_of(whole, [&](std::uint32_t v) { return whole.position[v][0] < cut; });
    const SmoothedBlock part = smooth_block(piece, round);
    std::size_t complete = 0, at = 0;
    for (std::size_t v = 0; v < piece.position.size(); ++v) {
      while (whole.key[at] != piece.key[v]) ++at;
      if (part.complete[v] == 0) continue;
      ++complete;
      REQUIRE(part.position[v] == all.position[at]);
    }
    CHECK(complete > 500);
    CHECK(complete < piece.position.size() - 24 * 20);
  }
}

}  // namespace denoise_test
