#include "octree/small_matrix.h"

#include <catch2/catch.hpp>

namespace tessera {

TEST_CASE("small matrix: Cholesky, elimination and Cramer solve what was made from a known solution",
          "[unit]") {
  Matrix3 a;
  a << 4, 12, -16, 12, 37, -43, -16, -43, 98;       // = L L', L = (2; 6 1; -8 5 3)
  const std::array<double, 3> b = {-20, -43, 192};  // = a (1, 2, 3)
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
  Matrix3 a;
  a << 4, 2, 0, 2, 5, 0, 0, 0, -1;
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

}  // namespace tessera
