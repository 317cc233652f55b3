// Heights over a base: they give the surface back, and turn with the base.
#include "kernels/edit/normal_displacement.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/placement.h"
#include "tests/helpers/random.h"
#include "tests/helpers/surfaces.h"

namespace normal_displacement_test {

namespace {

using namespace tessera;
using namespace tessera::test;

std::vector<Double3> rough_points(std::size_t count, double depth, Random& random) {
  std::vector<Double3> out;
  while (out.size() < count) {
    const Double3 p = {random.in(-1, 1), random.in(-1, 1), random.in(-1, 1)};
    if (norm(p) > 0.1) out.push_back(unit(p) * (1.0 + random.in(-depth, depth)));
  }
  return out;
}

}  // namespace

TEST_CASE("normal displacement: the fine surface comes back and turns with the base", "[unit]") {
  const Surface base = sphere(3, 1.0);
  const BaseState rest(base.position, base.faces);
  const DisplacementEncoder encoder(rest);
  Random random(11);
  const std::vector<Double3> fine = rough_points(3000, 0.08, random);
  const double diagonal = 2.0 * std::sqrt(3.0);
  const Placement motion = rotation(unit(Double3{1, 1, 3}), 130.0).about({4, 5, 6});
  std::vector<Double3> rotated;
  for (const Double3& p : base.position) rotated.push_back(motion.apply(p));
  const BaseState posed(rotated, base.faces);
  std::size_t tangents = 0;
  for (const Double3& p : fine) {
    TangentRest residual;
    const NormalDisplacement d = encoder.encode(p, diagonal, residual);
    const TangentRest* with = (d.face & kHasTangent) != 0 ? &residual : nullptr;
    tangents += with != nullptr;
    CHECK(norm(rest.decode(d, with) - p) < 1e-6 * diagonal);
    CHECK(norm(posed.decode(d, with) - motion.apply(p)) < 1e-6 * diagonal);
    CHECK(std::fabs(d.height) < 0.12);
  }
  // Steps of 16 bits over edges of a tenth of the diagonal are coarser than what is promised; those take the rest along.
  CHECK(tangents < fine.size());
}

TEST_CASE("normal displacement: on a fine base no rest is left, and a vertex is itself", "[unit]") {
  const Surface base = sphere(5, 1.0);
  const BaseState rest(base.position, base.faces);
  const DisplacementEncoder encoder(rest);
  Random random(5);
  const double diagonal = 2.0 * std::sqrt(3.0);
  for (const Double3& p : rough_points(2000, 0.01, random)) {
    TangentRest residual;
    const NormalDisplacement d = encoder.encode(p, diagonal, residual);
    CHECK((d.face & kHasTangent) == 0);
    CHECK(norm(rest.decode(d, nullptr) - p) < 1e-6 * diagonal);
  }
  for (const Double3& p : base.position) {
    TangentRest residual;
    const NormalDisplacement d = encoder.encode(p, diagonal, residual);
    CHECK(norm(rest.decode(d, nullptr) - p) < 1e-12);
    CHECK(std::fabs(d.height) < 1e-12);
  }
}

TEST_CASE("normal displacement: beyond a border the rest is kept beside the normal", "[unit]") {
  const Surface base = height_grid(4, 4.0, [](double, double) { return 0.0; });
  const BaseState rest(base.position, base.faces);
  const DisplacementEncoder encoder(rest);
  const Double3 p = {-0.7, 2.2, 0.4};
  TangentRest residual;
  const NormalDisplacement d = encoder.encode(p, 5.0, residual);
  CHECK((d.face & kHasTangent) != 0);
  CHECK(d.height == Approx(0.4));
  CHECK(norm(rest.decode(d, &residual) - p) < 1e-6);
  std::vector<Double3> rotated;
  const Placement motion = rotation({0, 1, 0}, 90.0);
  for (const Double3& v : base.position) rotated.push_back(motion.apply(v));
  CHECK(norm(BaseState(rotated, base.faces).decode(d, &residual) - motion.apply(p)) < 1e-6);
}

TEST_CASE("normal displacement: faces without area and folds do no harm", "[unit]") {
  Surface base = height_grid(3, 3.0, [](double, double) { return 0.0; });
  base.faces.push_back({0, 1, 1});
  base.faces.push_back({5, 6, 6});
  const std::size_t n = base.faces.size();
  for (std::size_t f = 0; f < n; ++f)
    base.faces.push_back({base.faces[f][0], base.faces[f][2], base.faces[f][1]});
  const BaseState rest(base.position, base.faces);  // normals cancel everywhere
  const DisplacementEncoder encoder(rest);
  Random random(2);
  for (int k = 0; k < 200; ++k) {
    const Double3 p = {random.in(-1, 4), random.in(-1, 4), random.in(-1, 1)};
    TangentRest residual;
    const NormalDisplacement d = encoder.encode(p, 4.0, residual);
    const Double3 back = rest.decode(d, (d.face & kHasTangent) != 0 ? &residual : nullptr);
    CHECK(std::isfinite(norm(back)));
  }
}

}  // namespace normal_displacement_test
