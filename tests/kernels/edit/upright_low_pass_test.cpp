// A low-pass takes its waves from a body, but no thin one flat.
#include "kernels/edit/upright_low_pass.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/helpers/surfaces.h"

namespace upright_low_pass_test {

using namespace tessera;
using namespace tessera::test;

namespace {

std::size_t flat_faces(const Surface& s, const std::vector<Double3>& p) {
  std::size_t count = 0;
  for (const auto& f : s.faces) {
    const Double3 was = triangle_normal(s.position[f[0]], s.position[f[1]], s.position[f[2]]),
                  is = triangle_normal(p[f[0]], p[f[1]], p[f[2]]);
    if (!(dot(is, was) >= 0.25 * dot(was, was))) ++count;
  }
  return count;
}

}  // namespace

TEST_CASE("upright low-pass: what it only evens out stays so, bit for bit", "[unit]") {
  const Surface s = height_grid(20, 20.0, [](double x, double y) { return 0.3 * std::sin(x) * std::cos(y); });
  std::vector<Double3> smooth = s.position;
  for (Double3& p : smooth) p[2] *= 0.1;
  const std::vector<Double3> want = smooth;
  CHECK(undo_flattening(s.position, s.faces, smooth) == 0);
  CHECK(smooth == want);
}

TEST_CASE("upright low-pass: a wire pressed to a line gets its thickness back, what is far stays", "[unit]") {
  Surface s;
  const int along = 60, around = 5;
  for (int i = 0; i <= along; ++i)
    for (int j = 0; j < around; ++j) {
      const double t = 2.0 * 3.14159265358979 * j / around;
      s.position.push_back({1.0 * i, std::cos(t), std::sin(t)});
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * around + j % around); };
  for (int i = 0; i < along; ++i)
    for (int j = 0; j < around; ++j) {
      s.faces.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
      s.faces.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
    }
  std::vector<Double3> smooth = s.position;
  for (Double3& p : smooth)
    if (p[0] > 30.0) p[1] *= -0.01, p[2] *= 0.01;  // inside out, nearly a line
  const std::vector<Double3> pressed = smooth;
  REQUIRE(flat_faces(s, smooth) > 200);
  CHECK(undo_flattening(s.position, s.faces, smooth) > 150);
  CHECK(flat_faces(s, smooth) == 0);
  for (std::size_t v = 0; v < smooth.size(); ++v)
    if (s.position[v][0] < 20.0) CHECK(smooth[v] == pressed[v]);
}

}  // namespace upright_low_pass_test
