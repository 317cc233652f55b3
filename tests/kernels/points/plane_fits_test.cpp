#include "kernels/points/plane_fits.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>

#include "octree/small_matrix.h"

namespace plane_fits_test {

using namespace tessera;

namespace {

/// Numbers in [-1, 1) that do not repeat soon.
class Numbers {
 public:
  double next() {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(state_ >> 11) * 0x1p-52 - 1.0;
  }

 private:
  std::uint64_t state_ = 19;
};

struct Cloud {
  double flat = 0.0, lean = 0.0, across = 1.0;
  int points = 20;
};

/// Sums over a cloud, thin along one axis or two, into a lane.
void add_cloud(const Cloud& cloud, Numbers& numbers, NeighbourSums& sums, std::size_t lane) {
  using S = NeighbourSums;
  for (std::size_t r = 0; r < S::kRows; ++r) sums.row[r][lane] = 0.0;
  for (int i = 0; i < cloud.points; ++i) {
    const double w = 1.5 + numbers.next(), x = numbers.next(), y = cloud.across * numbers.next();
    const double z = cloud.flat * numbers.next() + cloud.lean * x + 0.2;
    const double row[S::kRows] = {w,         w * x,     w * y,     w * z,     w * x * x,
                                  w * x * y, w * x * z, w * y * y, w * y * z, w * z * z};
    for (std::size_t r = 0; r < S::kRows; ++r) sums.row[r][lane] += row[r];
  }
}

}  // namespace

TEST_CASE("plane fits: four at once are those of one eigenproblem after the other, bit for bit",
          "[property]") {
  Numbers numbers;
  using S = NeighbourSums;
  int planes = 0, lines = 0;
  for (int trial = 0; trial < 500; ++trial) {
    NeighbourSums sums;
    for (std::size_t lane = 0; lane < S::kLanes; ++lane)
      add_cloud({trial % 3 == 0 ? 0.0 : 0.3 * numbers.next(), trial % 5 == 0 ? 0.0 : 3.0 * numbers.next(),
                 trial % 7 == 0 ? 0.0 : 1.0, trial % 11 == 0 ? 1 : 20},
                numbers, sums, lane);
    const auto fits = fit_planes(sums);
    for (std::size_t lane = 0; lane < S::kLanes; ++lane) {
      const auto at = [&](S::Row r) { return sums.row[r][lane] / sums.row[S::kWeight][lane]; };
      const double x = at(S::kX), y = at(S::kY), z = at(S::kZ);
      const MinEigen3 e = min_eigen3({at(S::kXX) - x * x, at(S::kXY) - x * y, at(S::kXZ) - x * z,
                                      at(S::kYY) - y * y, at(S::kYZ) - y * z, at(S::kZZ) - z * z});
      const double minimum = std::fmax(e.values[0], 0.0), sum = minimum + e.values[1] + e.values[2];
      const FittedPlane& fit = fits[lane];
      if (!(sum > 0.0) || e.values[1] < 0.0025 * e.values[2]) {
        ++lines;
        CHECK(fit.normal == Float3{0, 0, 0});
        CHECK(fit.variation == kNoPlane);
        continue;
      }
      ++planes;
      const double sign = static_cast<double>(fit.normal[0]) * e.vector[0] +
                                      static_cast<double>(fit.normal[1]) * e.vector[1] +
                                      static_cast<double>(fit.normal[2]) * e.vector[2] <
                                  0.0
                              ? -1.0
                              : 1.0;
      for (std::size_t a = 0; a < 3; ++a) CHECK(fit.normal[a] == static_cast<float>(sign * e.vector[a]));
      CHECK(fit.variation == static_cast<float>(minimum / sum));
      CHECK(fit.residual == static_cast<float>(std::sqrt(minimum)));
    }
  }
  CHECK(planes > 1000);
  CHECK(lines > 100);
}

TEST_CASE("plane fits: a lane does not hang on those beside it, and the largest component is positive",
          "[unit]") {
  Numbers numbers;
  NeighbourSums sums;
  for (std::size_t lane = 0; lane < NeighbourSums::kLanes; ++lane)
    add_cloud({0.01, lane % 2 == 0 ? -4.0 : 0.1, 1.0, 20}, numbers, sums, lane);
  const auto fits = fit_planes(sums);
  for (std::size_t lane = 0; lane < NeighbourSums::kLanes; ++lane) {
    NeighbourSums alone;  // beside empty lanes
    for (std::size_t r = 0; r < NeighbourSums::kRows; ++r) alone.row[r][0] = sums.row[r][lane];
    const auto one = fit_planes(alone);
    CHECK(one[0].normal == fits[lane].normal);
    CHECK(one[0].residual == fits[lane].residual);
    CHECK(one[1].normal == Float3{0, 0, 0});
    CHECK(fits[lane].normal[lane % 2 == 0 ? 0 : 2] > 0.7f);
    CHECK(fits[lane].variation < 0.001f);
  }
}

}  // namespace plane_fits_test
