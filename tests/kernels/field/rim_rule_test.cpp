#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>

#include "kernels/field/rim_rule.h"
#include "octree/vector.h"

namespace rim_rule_test {

using namespace tessera;

namespace {

constexpr float kThickness = 0.6f, kWithin = 0.9f, kValue = 0.2f;

void add(LocalSamples& samples, const Float3& at, const Float3& normal) {
  samples.reserve(samples.size + 1);
  const std::size_t i = samples.size++;
  samples.x[i] = at[0], samples.y[i] = at[1], samples.z[i] = at[2];
  samples.nx[i] = normal[0], samples.ny[i] = normal[1], samples.nz[i] = normal[2];
}

/// A sample on the plane below a node, at an angle about its foot point.
void add_around(LocalSamples& samples, double degrees, float distance, const Float3& normal = {0, 0, 1}) {
  const double a = degrees * 3.14159265358979 / 180.0;
  add(samples,
      {distance * static_cast<float>(std::cos(a)), distance * static_cast<float>(std::sin(a)), -kValue},
      normal);
}

bool surrounded(const LocalSamples& samples) {
  return is_surrounded(samples, kValue, {0, 0, 1}, kThickness, kWithin);
}

}  // namespace

TEST_CASE("rim rule: the widest gap about the foot point decides, wherever it lies", "[unit]") {
  for (int turn = 0; turn < 360; turn += 15) {
    INFO("gap from " << turn << " degrees");
    // 225 degrees of samples in the middles of sectors, the gap of 135 is one of six sectors.
    LocalSamples open, closed;
    for (double a = 11.25; a < 225.0; a += 22.5) add_around(open, turn + a, 0.5f);
    for (double a = 11.25; a < 247.5; a += 11.25) add_around(closed, turn + a, 0.5f);
    CHECK(!surrounded(open));
    CHECK(surrounded(closed));
  }
}

TEST_CASE("rim rule: samples count whatever their number, those beyond the end do not", "[unit]") {
  for (std::size_t n = 1; n <= 40; ++n) {
    LocalSamples samples;
    for (std::size_t i = 0; i < n; ++i)
      add_around(samples, 360.0 * static_cast<double>(i) / static_cast<double>(n) + 1.0, 0.5f);
    INFO(n << " samples evenly around");
    CHECK(surrounded(samples) == (n >= 3));
    // What an earlier list left behind the end is no sample.
    samples.size = std::min<std::size_t>(n, 2);
    CHECK(!surrounded(samples));
  }
}

TEST_CASE("rim rule: other sheets and far samples do not surround", "[unit]") {
  LocalSamples samples;
  for (int a = 0; a < 180; a += 20) add_around(samples, a + 1.0, 0.5f);
  REQUIRE(!surrounded(samples));
  LocalSamples turned = samples, off = samples, whole = samples;
  for (int a = 180; a < 360; a += 20) {
    add_around(whole, a + 1.0, 0.5f);
    add_around(turned, a + 1.0, 0.5f, {0.9f, 0.0f, 0.43f});
    add(off, {0.5f * std::cos(static_cast<float>(a)), -0.4f, 1.0f}, {0, 0, 1});
  }
  CHECK(surrounded(whole));
  CHECK(!surrounded(turned));
  CHECK(!surrounded(off));
  CHECK(!is_surrounded(whole, kValue, {0, 0, 1}, kThickness, 0.3f));  // none of them is near
}

}  // namespace rim_rule_test
