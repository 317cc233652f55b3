#include "octree/small_matrix.h"

#include <catch2/catch.hpp>

namespace tessera::small_matrix_test {

TEST_CASE("small matrix: Cholesky, elimination and Cramer solve what was made from a known solution",
          "[unit]") {
  Matrix3 a = {{4, 12, -16, 12, 37, -43, -16, -43, 98}};  // = L L', L = (2; 6 1; -8 5 3)
  const std::array<double, 3> b = {-20, -43, 192};        // = a (1, 2, 3)
  const std::array<double, 3> x = {1, 2, 3};

  Matrix3 factor = a;
  REQUIRE(cholesky_factor<3>(factor));
  CHECK(factor(0, 0) == 2.0);
  CHECK(factor(1, 0) == 6.0);
  CHECK(factor(2, 1) == 5.0);
  CHECK(factor(2, 2) == 3.0);
  std::array<double, 3> y = b;
  cholesky_solve<3>(factor, y);
  CHECK(y == x);

  Matrix3 m = a;
  y = b;
  eliminate<3>(m, y);
  CHECK(y == x);

  const Cramer3 cramer{4, 12, -16, 37, -43, 98};
  CHECK(cramer.determinant == 36.0);
  CHECK(cramer.solve({-20, -43, 192}) == Double3{1, 2, 3});
}

TEST_CASE("small matrix: the leading block alone, and a pivot that is too small", "[unit]") {
  Matrix3 a = {{4, 2, 0, 2, 5, 0, 0, 0, -1}};
  Matrix3 factor = a;
  CHECK_FALSE(cholesky_factor<3>(factor));
  factor = a;
  REQUIRE(cholesky_factor<3>(factor, 0.0, 0.0, 2));
  std::array<double, 3> x = {8, 12, 99};
  cholesky_solve<3>(factor, x, 2);
  CHECK(x == std::array<double, 3>{1, 2, 99});
  factor = a;
  CHECK_FALSE(cholesky_factor<3>(factor, 4.0, 0.0, 2));  // second pivot: 5 - 1
}

TEST_CASE("small matrix: eigenvalues ascend, vectors are theirs", "[unit]") {
  Double3 values;
  std::array<Double3, 3> vectors;
  symmetric_eigen3({2, 1, 0, 2, 0, 7}, values, vectors);  // 1 along (1,-1,0), 3 along (1,1,0), 7 along z
  CHECK(values[0] == Approx(1.0));
  CHECK(values[1] == Approx(3.0));
  CHECK(values[2] == Approx(7.0));
  CHECK(std::abs(dot(vectors[0], unit(Double3{1, -1, 0}))) == Approx(1.0));
  CHECK(std::abs(dot(vectors[1], unit(Double3{1, 1, 0}))) == Approx(1.0));
  CHECK(std::abs(vectors[2][2]) == Approx(1.0));
  symmetric_eigen3({5, 0, 0, 5, 0, 5}, values, vectors);
  CHECK(values == Double3{5, 5, 5});
}

TEST_CASE("small matrix: the least eigenvalue without rotations is that of the rotations", "[unit]") {
  std::uint64_t state = 1;
  const auto next = [&state] {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state >> 11) * 0x1p-52 - 1.0;
  };
  const double flat = GENERATE(1.0, 1e-3, 1e-8, 0.0);  // scale of one axis: planes, and exact ones
  for (int k = 0; k < 500; ++k) {
    std::array<double, 6> m{};
    for (int p = 0; p < 6; ++p) {  // a cloud, leaning
      const Double3 at = {next() + 0.3 * next(), next(), flat * next()};
      const Double3 rotated = {0.6 * at[0] - 0.8 * at[2], at[1], 0.8 * at[0] + 0.6 * at[2]};
      m[0] += rotated[0] * rotated[0], m[1] += rotated[0] * rotated[1], m[2] += rotated[0] * rotated[2];
      m[3] += rotated[1] * rotated[1], m[4] += rotated[1] * rotated[2], m[5] += rotated[2] * rotated[2];
    }
    Double3 values;
    std::array<Double3, 3> vectors;
    symmetric_eigen3(m, values, vectors);
    const MinEigen3 minimum = min_eigen3(m);
    for (std::size_t i = 0; i < 3; ++i)
      CHECK(minimum.values[i] == Approx(values[i]).margin(1e-13 * values[2]));
    CHECK(norm(minimum.vector) == Approx(1.0));
    if (values[1] - values[0] > 1e-3 * values[2])
      CHECK(std::abs(dot(minimum.vector, vectors[0])) == Approx(1.0).margin(1e-9));
  }
}

TEST_CASE("small matrix: a line and a ball have a least eigenvector too", "[unit]") {
  const MinEigen3 line = min_eigen3({4, 0, 0, 0, 0, 0});
  CHECK(std::abs(line.vector[0]) < 1e-12);
  CHECK(norm(line.vector) == Approx(1.0));
  CHECK(line.values[1] == Approx(0.0).margin(1e-12));
  const MinEigen3 ball = min_eigen3({5, 0, 0, 5, 0, 5});
  CHECK(ball.values == Double3{5, 5, 5});
  CHECK(norm(ball.vector) == Approx(1.0));
  CHECK(min_eigen3({}).values == Double3{0, 0, 0});
}

}  // namespace tessera::small_matrix_test
