#include "kernels/decimate/star_lanes.h"

#include <catch2/catch.hpp>

#include <algorithm>

#include "kernels/decimate/collapse_costs.h"
#include "kernels/decimate/collapse_deviation.h"
#include "octree/portable_math.h"

namespace tessera::star_lanes_test {
namespace {

/// A fan of `size` faces around vertex 0, its rim scattered around a circle, heights up to `rough`.
MeshBlock fan(std::size_t size, double rough, std::uint64_t seed) {
  MeshBlock b;
  const auto noise = [&](std::uint64_t stream, std::size_t i) {
    return 2.0 * to_unit(random_bits(seed, stream, i)) - 1.0;
  };
  b.position.push_back({0.3 * noise(0, 0), 0.3 * noise(0, 1), rough * noise(0, 2)});
  for (std::size_t i = 0; i < size; ++i) {
    const SinCos angle =
        sin_cos(2.0 * kPi * (static_cast<double>(i) + 0.3 * noise(1, i)) / static_cast<double>(size));
    const double r = 1.0 + 0.4 * noise(2, i);
    b.position.push_back({r * angle.cos, r * angle.sin, rough * noise(3, i)});
  }
  for (Double3& p : b.position) p = p + Double3{7.0, -3.0, 2.0};
  for (std::uint32_t i = 1; i <= size; ++i) b.faces.push_back({0, i, i < size ? i + 1 : 1});
  b.face_flags.assign(size, kFaceBorder12);
  for (std::uint64_t v = 0; v <= size; ++v) b.key.push_back(v);
  b.vertex_class.assign(size + 1, VertexClass::kSmooth);
  return b;
}

struct OneStar {
  OneStar(const MeshBlock& block) : mesh(block, {6.0, -4.5, 1.0}) {
    for (std::uint32_t v = 0; v < mesh.vertices(); ++v)
      if (mesh.block_vertex(v) == 0) centre = v;
    REQUIRE(mesh.gather(centre, star));
  }
  LinkLoop link(std::size_t at) const {
    LinkLoop loop;
    for (std::size_t n = 0; n < star.faces; ++n)
      loop.at[loop.size++] = mesh.at(star.ring[(at + n) % star.faces]) - mesh.at(star.ring[at]);
    return loop;
  }
  CollapseMesh mesh;
  std::uint32_t centre = 0;
  Star star;
};

}  // namespace

TEST_CASE("star lanes: distances and folds are those of fan_gap()", "[property]") {
  std::size_t good = 0, refused = 0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const std::size_t size = 4 + seed % 5;
    const OneStar s(fan(size, 0.25, seed));
    StarLanes lanes(0.1, 0.0);
    REQUIRE(lanes.load(s.mesh, s.centre, s.star));
    for (std::size_t at = 0; at < size; ++at) {
      double deviation = 0.0, exact = 0.0;
      const StarLanes::Answer answer = lanes.judge(at, deviation);
      const bool graph =
          fan_deviation(s.link(at), s.mesh.at(s.centre) - s.mesh.at(s.star.ring[at]), kNoFlatEdge, exact);
      if (answer == StarLanes::Answer::kGood) {
        REQUIRE(graph);
        CHECK(deviation >= exact);
        CHECK(deviation < exact * 1.01 + 1e-4);
        ++good;
      }
      refused += answer == StarLanes::Answer::kRefused;
    }
  }
  CHECK(good > 1000);  // else the rest proves nothing
  CHECK(refused > 1000);
}

TEST_CASE("star lanes: costs are those of endpoint quadrics", "[property]") {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const std::size_t size = 4 + seed % 5;
    OneStar s(fan(size, 0.25, seed));
    Quadric q;
    for (std::size_t i = 0; i < size; ++i) {
      const Double3 &a = s.mesh.at(s.centre), &b = s.mesh.at(s.star.ring[i]),
                    &c = s.mesh.at(s.star.ring[(i + 1) % size]);
      const Double3 normal = cross(b - a, c - a);
      q += plane_quadric(unit(normal), a, norm(normal) / 6.0);
      s.mesh.node(s.star.ring[i]).error = 0.001 * static_cast<double>(i);
    }
    StarLanes lanes(0.1, 0.0);
    REQUIRE(lanes.load(s.mesh, s.centre, s.star));
    std::array<double, 8> cost{};
    lanes.costs(q, s.mesh.at(s.centre), cost);
    for (std::size_t i = 0; i < size; ++i) {
      const CollapseVertex& to = s.mesh.node(s.star.ring[i]);
      CHECK(cost[i] == Approx(endpoint_cost(q, to)).epsilon(1e-4).margin(1e-7));
    }
    const StarLanes::Cheapest best = lanes.cheapest(q, s.mesh.at(s.centre));
    CHECK(best.cost == *std::min_element(cost.begin(), cost.begin() + static_cast<std::ptrdiff_t>(size)));
    CHECK(best.cost == cost[best.at]);
  }
}

TEST_CASE("star lanes: open stars, large ones and sizes out of proportion are left to others", "[unit]") {
  const OneStar nine(fan(9, 0.25, 1)), six(fan(6, 0.25, 1));
  CHECK_FALSE(StarLanes(0.1, 0.0).load(nine.mesh, nine.centre, nine.star));
  CHECK(StarLanes(0.1, 0.0).load(six.mesh, six.centre, six.star));
  CHECK_FALSE(StarLanes(1e-6, 0.0).load(six.mesh, six.centre, six.star));
  CHECK_FALSE(StarLanes(1e+6, 0.0).load(six.mesh, six.centre, six.star));
  Star link;
  REQUIRE(six.mesh.gather(six.star.ring[0], link));
  CHECK_FALSE(StarLanes(0.1, 0.0).load(six.mesh, six.star.ring[0], link));
}

TEST_CASE("star lanes: what is flat is left to doubles", "[unit]") {
  const OneStar s(fan(6, 0.0, 3));
  StarLanes lanes(0.1, 0.0);
  REQUIRE(lanes.load(s.mesh, s.centre, s.star));
  double deviation = 0.0;
  for (std::size_t at = 0; at < 6; ++at) CHECK(lanes.judge(at, deviation) != StarLanes::Answer::kGood);
}

TEST_CASE("star lanes: what is surely flat turns by less from its first face, and most that does is",
          "[property]") {
  constexpr double kCosine = 0.7;
  std::size_t flat = 0, sure = 0;
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    const OneStar s(fan(4 + seed % 5, 0.1 + 0.6 * static_cast<double>(seed) / 3000.0, seed));
    StarLanes lanes(0.1, 0.0);
    REQUIRE(lanes.load(s.mesh, s.centre, s.star));
    const auto normal = [&](std::size_t i) {
      const Double3 n = cross(s.mesh.at(s.star.ring[i]) - s.mesh.at(s.centre),
                              s.mesh.at(s.star.ring[s.star.following(i)]) - s.mesh.at(s.centre));
      return n * (1.0 / norm(n));
    };
    double least = 1.0;
    for (std::size_t i = 1; i < s.star.faces; ++i) least = std::min(least, dot(normal(0), normal(i)));
    const bool surely = lanes.is_surely_flat(static_cast<float>(kCosine));
    if (surely) CHECK(least > kCosine);
    flat += least > kCosine;
    sure += surely;
  }
  CHECK(flat > 500);
  CHECK(flat < 2500);
  CHECK(sure * 20 > flat * 19);
}

}  // namespace tessera::star_lanes_test
