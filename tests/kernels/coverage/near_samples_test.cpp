// Which samples lie near some face, against looking at all pairs.
#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "kernels/coverage/near_samples.h"
#include "kernels/mesh/triangle_foot.h"
#include "tests/helpers/random.h"

namespace near_samples_test {

using namespace tessera;

TEST_CASE("near samples: the same as by looking at all pairs, small faces and one that reaches over all",
          "[unit]") {
  test::Random random(3);
  const auto place = [&](double low, double high) {
    return Double3{random.in(low, high), random.in(low, high), random.in(low, high)};
  };
  for (const double distance : {0.3, 2.0}) {
    std::vector<Double3> samples;
    for (int i = 0; i < 400; ++i) samples.push_back(place(10.0, 40.0));
    std::vector<std::array<Double3, 3>> faces;
    for (int i = 0; i < 600; ++i) {
      const Double3 at = place(5.0, 45.0);
      faces.push_back({at, at + place(-1.0, 1.0), at + place(-1.0, 1.0)});
    }
    faces.push_back({Double3{0, 0, 24}, Double3{60, 0, 25}, Double3{0, 60, 26}});
    faces.push_back({Double3{20, 20, 20}, Double3{20, 20, 20}, Double3{20, 20, 20}});  // a point
    NearSamples near(samples, distance), at_once(samples, distance);
    std::vector<Double3> corners;
    std::vector<std::array<std::uint32_t, 3>> numbers;
    for (const auto& f : faces) {
      near.add(f);
      const auto first = static_cast<std::uint32_t>(corners.size());
      corners.insert(corners.end(), f.begin(), f.end());
      numbers.push_back({first, first + 1, first + 2});
    }
    at_once.add(corners, numbers);
    std::size_t count = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const bool wanted = std::any_of(faces.begin(), faces.end(), [&](const auto& f) {
        const Double3 foot = foot_in_triangle(samples[i], f[0], f[1], f[2]).at;
        return squared_distance(samples[i], foot) < distance * distance;
      });
      CAPTURE(distance, i);
      REQUIRE((near.near()[i] != 0) == wanted);
      REQUIRE((at_once.near()[i] != 0) == wanted);
      count += wanted;
    }
    CHECK(count > 10);
    CHECK(count < samples.size());
  }
}

TEST_CASE("near samples: no sample is near anything", "[unit]") {
  NearSamples near({}, 1.0);
  near.add({Double3{0, 0, 0}, Double3{1, 0, 0}, Double3{0, 1, 0}});
  CHECK(near.near().empty());
}

}  // namespace near_samples_test
