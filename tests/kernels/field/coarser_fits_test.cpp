// Where samples are too sparse for the cells, those of twice the edge tell: no hole there, none closed amid dense samples.
#include "kernels/field/coarser_fits.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "kernels/field/field.h"
#include "tests/helpers/oriented_samples.h"
#include "tests/helpers/random.h"

namespace coarser_fits_test {

using namespace tessera;

namespace {

const Int3 kSize = {64, 64, 64};
const Double3 kNormal = unit_or_zero(Double3{-0.1, 0.2, 1.0});

double height(double x, double y) {
  return 96.3 + 0.1 * (x - 96.0) - 0.2 * (y - 96.0);
}

/// Samples of a plane over [40, 152)^2, of which `keep` has a say.
template <class Keep>
test::Samples plane(double apart, const Keep& keep) {
  test::Samples out;
  test::Random random(3);
  for (double y = 40.0; y < 152.0; y += apart)
    for (double x = 40.0; x < 152.0; x += apart) {
      const double u = x + apart * random.in(0.0, 0.4), v = y + apart * random.in(0.0, 0.4);
      if (keep(u, v)) out.push_back({{u, v, height(u, v)}, kNormal, 0});
    }
  return out;
}

CoarserFits coarser_of(const test::Samples& samples, const Int3& origin) {
  CoarserFits out{SparseNodes(test::make_block(samples, origin, kSize, kLeafCells)), {}};
  test::Samples coarse = samples;
  for (auto& s : coarse) s.p = s.p * 0.5;
  out.band = fit_field(
      test::make_block(coarse, out.sparse.origin(), out.sparse.cells(), field_halo_cells({})), {},
      [&](const Int3& leaf) {
        LeafWords words{};
        for (int n = 0; n < 512; ++n) {
          const Int3 at = {8 * leaf[0] + (n & 7), 8 * leaf[1] + (n >> 3 & 7), 8 * leaf[2] + (n >> 6)};
          bool within = true;
          for (std::size_t a = 0; a < 3; ++a)
            within = within && at[a] >= -1 && at[a] <= out.sparse.cells()[a] + 1;
          if (within && out.sparse.depth(at) >= -kBoundaryMargin)
            words[static_cast<std::size_t>(n >> 6)] |= std::uint64_t{1} << (n & 63);
        }
        return words;
      },
      nullptr);
  return out;
}

DirectedField field_of(const test::Samples& samples, const Int3& origin, const CoarserFits* coarser) {
  return evaluate_field(test::make_block(samples, origin, kSize, field_halo_cells({})), {}, {}, coarser);
}

/// Cells over [low, high)^2 that the surface passes and that take part.
int cells_in(const DirectedField& f, double low, double high) {
  int count = 0;
  for (const BandLeaf& leaf : f.leaves)
    for (int n = 0; n < 512; ++n) {
      const Int3 at = {leaf.origin[0] + (n & 7), leaf.origin[1] + (n >> 3 & 7), leaf.origin[2] + (n >> 6)};
      const auto x = static_cast<double>(f.origin[0] + at[0]), y = static_cast<double>(f.origin[1] + at[1]);
      if (x < low || y < low || x >= high || y >= high) continue;
      if (leaf.ended[static_cast<std::size_t>(n >> 6)] >> (n & 63) & 1) continue;
      count += f.root_at(at[0], at[1], at[2], 2) != nullptr;
    }
  return count;
}

}  // namespace

TEST_CASE("coarser fits: no hole between scan lines that lie too far apart", "[unit]") {
  const Int3 origin = {64, 64, 64};
  // Dense where x < 90, then lines that seven cells part.
  const test::Samples samples =
      plane(0.5, [](double x, double) { return x < 90.0 || std::fmod(x - 90.0, 7.0) < 0.5; });
  const CoarserFits coarser = coarser_of(samples, origin);
  REQUIRE(coarser.sparse.any());
  const DirectedField alone = field_of(samples, origin, nullptr),
                      filled = field_of(samples, origin, &coarser);
  CHECK(cells_in(alone, 66.0, 126.0) < 3000);
  CHECK(cells_in(filled, 66.0, 126.0) == 3600);
  double worst = 0.0;
  for (const BandLeaf& leaf : filled.leaves)
    for (int n = 0; n < 512; ++n) {
      if (!leaf.is_valid(static_cast<std::size_t>(n))) continue;
      const Double3 p = {64.0 + leaf.origin[0] + (n & 7), 64.0 + leaf.origin[1] + (n >> 3 & 7),
                         64.0 + leaf.origin[2] + (n >> 6)};
      const double exact = kNormal[2] * (p[2] - height(p[0], p[1]));
      worst = std::max(worst, std::fabs(exact - double{leaf.value(static_cast<std::size_t>(n))}));
    }
  CHECK(worst < 0.02);
}

TEST_CASE("coarser fits: holes amid dense samples stay", "[unit]") {
  const Int3 origin = {64, 64, 64};
  const auto radius = GENERATE(3.0, 5.0, 8.0);
  CAPTURE(radius);
  const test::Samples samples =
      plane(0.4, [&](double x, double y) { return std::hypot(x - 96.0, y - 96.0) > radius; });
  const CoarserFits coarser = coarser_of(samples, origin);
  const DirectedField alone = field_of(samples, origin, nullptr),
                      filled = field_of(samples, origin, &coarser);
  CHECK(cells_in(filled, 80.0, 112.0) <= cells_in(alone, 80.0, 112.0) + 16);
}

TEST_CASE("coarser fits: the same bits for every block", "[property]") {
  test::Random random(5);
  const test::Samples samples =
      plane(1.5, [&](double x, double) { return x < 80.0 || random.unit() < 0.15; });
  const Int3 first = {64, 64, 64}, second = {72, 56, 72};
  const CoarserFits a = coarser_of(samples, first), b = coarser_of(samples, second);
  const DirectedField f = field_of(samples, first, &a), g = field_of(samples, second, &b);
  int compared = 0;
  for (const BandLeaf& leaf : f.leaves)
    for (int n = 0; n < 512; ++n) {
      Int3 at;
      bool within = true;
      const Int3 in_leaf = {n & 7, n >> 3 & 7, n >> 6};
      for (std::size_t c = 0; c < 3; ++c) {
        at[c] = leaf.origin[c] + in_leaf[c] + first[c] - second[c];
        within = within && at[c] >= 0 && at[c] <= 64 && leaf.origin[c] + in_leaf[c] >= 0 &&
                 leaf.origin[c] + in_leaf[c] <= 64;
      }
      if (!within) continue;
      const BandLeaf* other = g.leaf_at(at[0], at[1], at[2]);
      const std::size_t there = BandLeaf::node(at[0], at[1], at[2]);
      const bool here = leaf.is_valid(static_cast<std::size_t>(n));
      REQUIRE(here == (other && other->is_valid(there)));
      if (!here) continue;
      const float x = leaf.value(static_cast<std::size_t>(n)), y = other->value(there);
      REQUIRE(std::memcmp(&x, &y, sizeof x) == 0);
      ++compared;
    }
  CHECK(compared > 5000);
}

}  // namespace coarser_fits_test
