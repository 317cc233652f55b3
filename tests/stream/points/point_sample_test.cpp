#include "stream/points/point_sample.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "stream/points/normal_sample.h"
#include "stream/points/sampled_layers.h"
#include "stream/runtime/parallel.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::point_sample_test {
namespace {

constexpr double kCoarsest = 8.0;
constexpr LayeredSampler::Limits kLimits = {2048, 2048, 2048, 2048};

/// A level surface of side^2 unit squares with two points in each.
std::vector<Double3> sheet(int side) {
  test::Random random(7);
  std::vector<Double3> points;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (int k = 0; k < 2; ++k)
        points.push_back({i + random.unit(), j + random.unit(), 0.1 * random.unit()});
  return points;
}

struct Sampled {
  double share = 0.0;
  std::vector<Double3> points;
  bool operator==(const Sampled&) const = default;
};

std::vector<Sampled> spend(LayeredSampler& sampler) {
  std::vector<Sampled> out;
  for (CellSampler& layer : sampler.layers()) {
    Sampled s;
    for (const CellSampler::Cell& c : layer.take())
      s.points.insert(s.points.end(), c.points.begin(), c.points.end());
    s.share = layer.share();
    out.push_back(std::move(s));
  }
  return out;
}

std::vector<Sampled> sample(std::span<const Double3> points, std::uint64_t told) {
  LayeredSampler sampler(kCoarsest, kLimits, told);
  for (const Double3& p : points) sampler.add(p);
  return spend(sampler);
}

TEST_CASE("point sample: knowing how many points come changes nothing of even layers", "[unit]") {
  const std::vector<Double3> points = sheet(200);
  const auto all = sample(points, 0), known = sample(points, points.size());
  for (std::size_t k = 0; k < LayeredSampler::kLayers; ++k) {
    CAPTURE(k);
    CHECK(all[k] == known[k]);
    CHECK(all[k].points.size() <= kLimits[k]);
    CHECK(all[k].points.size() > kLimits[k] / 2);
    CHECK(all[k].share < 0.1);
  }
}

TEST_CASE("sampled layers: what cells tell is the same on any number of threads", "[property]") {
  const std::vector<Double3> points = sheet(200);
  const auto measured = [&] {
    LayeredSampler sampler(kCoarsest, kLimits, 0);
    for (const Double3& p : points) sampler.add(p);
    const SampledLayers layers(sampler);
    std::vector<double> all;
    for (const SpacingProbe& p : layers.probes())
      all.insert(all.end(), {p.spacing, p.nearest, p.gap, p.area, p.on_surface ? 1.0 : 0.0});
    const ScaleHistogram residuals = layers.residuals(1.5);
    all.insert(all.end(), {static_cast<double>(residuals.count()), residuals.quantile(0.25)});
    return all;
  };
  const std::vector<double> alone = measured();
  REQUIRE(alone.size() > 1500);
  WorkerPool pool(3);
  std::vector<double> together;
  pool.run_here([&] { together = measured(); });
  CHECK(together == alone);
}

TEST_CASE("point sample: parts of a stream merge to the sample of the whole", "[property]") {
  std::vector<Double3> points = sheet(150);
  const std::uint64_t told = GENERATE(0, 45000);
  const auto whole = sample(points, told);
  std::reverse(points.begin(), points.end());
  const test::TempFolder folder;
  LayeredSampler merged(kCoarsest, kLimits, told);
  const std::size_t parts = 4;
  for (std::size_t k = 0; k < parts; ++k) {
    LayeredSampler part(kCoarsest, kLimits, told);
    for (std::size_t i = k; i < points.size(); i += parts) part.add(points[i]);
    part.save(folder / "part");
    merged.merge(folder / "part");
  }
  CHECK(spend(merged) == whole);
}

TEST_CASE("point sample: crowded cells count the same in every order", "[property]") {
  // Clumps of many points in a cell of every layer, whose last points may come long before those of others.
  std::vector<Double3> points = sheet(90);
  test::Random random(11);
  for (int clump = 0; clump < 12; ++clump) {
    const Double3 at = {random.in(0, 90), random.in(0, 90), 3.0};
    for (int k = 0; k < 900; ++k)
      points.push_back(
          {at[0] + 0.01 * random.unit(), at[1] + 0.01 * random.unit(), at[2] + 0.01 * random.unit()});
  }
  const auto crowded = [](const std::vector<Double3>& from) {
    LayeredSampler sampler(kCoarsest, kLimits, 0);
    for (const Double3& p : from) sampler.add(p);
    spend(sampler);
    std::vector<bool> out;
    for (const CellSampler& layer : sampler.layers()) out.push_back(layer.any_crowded());
    return out;
  };
  const auto forward = sample(points, 0);
  const std::vector<bool> any = crowded(points);
  CHECK(any[1]);
  for (const Sampled& s : forward) CHECK(s.points.size() <= kLimits[0]);
  for (const std::uint64_t seed : {1, 2, 3}) {
    test::Random order(seed);
    for (std::size_t i = points.size(); i-- > 1;)
      std::swap(points[i], points[static_cast<std::size_t>(order.in(0, static_cast<double>(i) + 0.999))]);
    CHECK(sample(points, 0) == forward);
    CHECK(crowded(points) == any);
  }
  std::sort(points.begin(), points.end());
  CHECK(sample(points, 0) == forward);
  const test::TempFolder folder;
  LayeredSampler merged(kCoarsest, kLimits, 0);
  for (std::size_t k = 0; k < 5; ++k) {
    LayeredSampler part(kCoarsest, kLimits, 0);
    for (std::size_t i = k * points.size() / 5; i < (k + 1) * points.size() / 5; ++i) part.add(points[i]);
    part.save(folder / "part");
    merged.merge(folder / "part");
  }
  CHECK(spend(merged) == forward);
}

TEST_CASE("point sample: few points among many that were told are all that is sampled of their share",
          "[unit]") {
  const std::vector<Double3> points = sheet(100);
  const std::uint64_t told = 100 * points.size();
  const auto few = sample(points, told);
  CHECK(few[0].points.size() > kLimits[0] / 2);  // the first layer looks everywhere
  for (std::size_t k = 1; k < LayeredSampler::kLayers; ++k) {
    CHECK(few[k].share == Approx(max_sampled_share(kLimits[k], told)));
    CHECK(few[k].points.size() == Approx(few[k].share * static_cast<double>(points.size())).epsilon(0.4));
  }
}

TEST_CASE("point sample: the points with the smallest hashes, each position once", "[unit]") {
  const std::vector<Double3> points = sheet(60);
  const auto take = [](std::span<const Double3> from, int times) {
    PointSampler sampler(500);
    for (int k = 0; k < times; ++k)
      for (const Double3& p : from) sampler.add(p);
    return sampler.take();
  };
  const std::vector<Double3> once = take(points, 1);
  CHECK(once.size() == 500);
  CHECK(take(points, 5) == once);
  const std::vector<Double3> backwards(points.rbegin(), points.rend());
  CHECK(take(backwards, 1) == once);
  CHECK(take(std::span(points).first(40), 90).size() == 40);
}

TEST_CASE("normal sample: the same agreement whether the number of points is known or not", "[unit]") {
  const std::vector<Double3> points =
      sheet(400);  // quanta are as long as it takes: cells of 3 h hold ten points
  const auto measure = [&](std::uint64_t told) {
    NormalSampler sampler(told);
    std::size_t i = 0;
    for (const Double3& p : points)
      sampler.add({p[0] * 1000, p[1] * 1000, p[2] * 1000}, {0, 0, ++i % 8 == 0 ? -1.0f : 1.0f});
    return sampler.measure();
  };
  const NormalAgreement all = measure(0), known = measure(points.size());
  CHECK(all.cells > 100);
  CHECK(all.cells == known.cells);
  CHECK(all.pairs == known.pairs);
  CHECK(all.against == known.against);
}

}  // namespace
}  // namespace tessera::point_sample_test
