#include "stream/points/point_sample.h"

#include <algorithm>
#include <array>

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
    const std::vector<std::filesystem::path> saved = {folder / "part"};
    merged.merge(saved);
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
    const std::vector<std::filesystem::path> saved = {folder / "part"};
    merged.merge(saved);
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

TEST_CASE("rotated points: many at a time lie in the cells that each lies in alone", "[unit]") {
  test::Random random(3);
  RotatedPoints rotated;
  std::array<std::vector<double>, 3> p;
  // On and beside the walls of cells, on both sides of zero, and as far away as is allowed.
  for (std::size_t i = 0; i < RotatedPoints::kMost; ++i)
    for (auto& axis : p) {
      const double far = i % 3 == 0 ? 1e15 : i % 3 == 1 ? 1000.0 : 2.0;
      axis.push_back(i < 8 ? -39.0 * static_cast<double>(i) : random.in(-far, far));
    }
  rotated.take(p[0], p[1], p[2]);
  for (const double per_unit : {1.0, 0.25, 1.0 / 3072.0}) {
    rotated.find_cells(per_unit);
    rotated.hash_cells();
    rotated.hash_wider();
    for (std::size_t i = 0; i < RotatedPoints::kMost; ++i) {
      const Double3 turned = LayeredSampler::rotate({p[0][i], p[1][i], p[2][i]});
      CAPTURE(i, per_unit);
      REQUIRE(Double3{rotated.p[0][i], rotated.p[1][i], rotated.p[2][i]} == turned);
      CellSampler::CellIndex cell = cell_of(turned, per_unit);
      REQUIRE(rotated.cell_hash[i] == CellSampler::hash_of(cell));
      for (std::int64_t& c : cell) c >>= 2;
      REQUIRE(rotated.wider_hash[i] == CellSampler::hash_of(cell));
    }
  }
}

TEST_CASE("normal sample: crowded cells and parts of a stream change nothing", "[property]") {
  // More points than a sample holds, most of them in a few cells.
  std::vector<Double3> points = sheet(250);
  test::Random random(5);
  for (int k = 0; k < 60000; ++k) points.push_back({30 * (k % 7) + random.unit(), random.unit(), 0.0});
  const auto add = [&](NormalSampler& sampler, std::size_t first, std::size_t step) {
    std::array<std::vector<double>, 3> p;
    std::array<std::vector<float>, 3> n;
    for (std::size_t i = first; i < points.size(); i += step) {
      for (std::size_t a = 0; a < 3; ++a) p[a].push_back(points[i][a] * 1000), n[a].push_back(0.0f);
      n[2].back() = i % 8 == 0 ? -1.0f : 1.0f;
    }
    sampler.add({p[0], p[1], p[2]}, {n[0], n[1], n[2]});
  };
  NormalSampler whole, merged;
  add(whole, 0, 1);
  const test::TempFolder folder;
  for (std::size_t k = 0; k < 5; ++k) {
    NormalSampler part;
    add(part, 4 - k, 5);
    part.save(folder / "part");
    merged.merge(folder / "part");
  }
  const NormalAgreement a = whole.measure(), b = merged.measure();
  CHECK(a.cells > 1000);
  CHECK(a.cells == b.cells);
  CHECK(a.pairs == b.pairs);
  CHECK(a.against == b.against);
}

TEST_CASE("point sample: many at a time are the same as one by one", "[unit]") {
  const std::vector<Double3> points = sheet(60);
  std::array<std::vector<double>, 3> axes;
  for (const Double3& p : points)
    for (std::size_t a = 0; a < 3; ++a) axes[a].push_back(p[a]);
  PointSampler one(500), many(500);
  for (const Double3& p : points) one.add(p);
  many.add(axes[0], axes[1], axes[2]);
  CHECK(one.take() == many.take());
  LayeredSampler together(kCoarsest, kLimits, 0);
  together.add(axes[0], axes[1], axes[2]);
  CHECK(spend(together) == sample(points, 0));
}

TEST_CASE("normal sample: the same agreement whether the number of points is known or not", "[unit]") {
  const std::vector<Double3> points =
      sheet(400);  // quanta are as long as it takes: cells of 3 h hold ten points
  const auto measure = [&](std::uint64_t told) {
    NormalSampler sampler(told);
    std::array<std::vector<double>, 3> p;
    for (const Double3& at : points)
      for (std::size_t a = 0; a < 3; ++a) p[a].push_back(at[a] * 1000);
    const std::vector<float> level(points.size(), 0.0f);
    std::vector<float> up(points.size(), 1.0f);
    for (std::size_t i = 7; i < up.size(); i += 8) up[i] = -1.0f;
    CHECK(sampler.add({p[0], p[1], p[2]}, {level, level, up}) == points.size());
    CHECK(sampler.add({p[0], p[1], p[2]}, {level, level, level}) == 0);
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
