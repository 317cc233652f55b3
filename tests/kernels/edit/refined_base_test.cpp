// Long edges of a base are halved where the support wants it: faces cover what they covered, and nothing else changes.
#include "kernels/edit/refined_base.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <map>

#include "kernels/edit/edit_basis.h"

namespace refined_base_test {

using namespace tessera;

namespace {

using Face = std::array<std::uint32_t, 3>;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// A sheet of n by m squares of sides x and y.
struct Sheet {
  std::vector<Double3> position;
  std::vector<Face> faces;
};
Sheet sheet(std::uint32_t n, std::uint32_t m, double x, double y) {
  Sheet out;
  for (std::uint32_t j = 0; j <= m; ++j)
    for (std::uint32_t i = 0; i <= n; ++i) out.position.push_back({i * x, j * y, 0});
  for (std::uint32_t j = 0; j < m; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = j * (n + 1) + i, b = a + n + 1;
      out.faces.push_back({a, a + 1, b + 1});
      out.faces.push_back({a, b + 1, b});
    }
  return out;
}

double area(const Sheet& s) {
  double sum = 0.0;
  for (const Face& f : s.faces) {
    const Double3 n = triangle_normal(s.position[f[0]], s.position[f[1]], s.position[f[2]]);
    CHECK(n[2] > 0.0);
    sum += 0.5 * n[2];
  }
  return sum;
}

/// Every edge of one face lies at the border, all others have two faces of opposite directions.
bool is_whole(const Sheet& s, double x, double y) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> half;
  for (const Face& f : s.faces)
    for (std::size_t k = 0; k < 3; ++k) ++half[{f[k], f[(k + 1) % 3]}];
  for (const auto& [e, count] : half) {
    if (count != 1) return false;
    if (half.count({e.second, e.first}) == 1) continue;
    const Double3 &a = s.position[e.first], &b = s.position[e.second];
    const auto along = [&](std::size_t c, double at) { return a[c] == at && b[c] == at; };
    if (!along(0, 0.0) && !along(0, x) && !along(1, 0.0) && !along(1, y)) return false;
  }
  return true;
}

double smallest_angle(const Sheet& s) {
  double least = 180.0;
  for (const Face& f : s.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 u = s.position[f[(k + 1) % 3]] - s.position[f[k]],
                    v = s.position[f[(k + 2) % 3]] - s.position[f[k]];
      least = std::min(least, std::atan2(norm(cross(u, v)), dot(u, v)) * 180.0 / 3.14159265358979);
    }
  return least;
}

}  // namespace

TEST_CASE("refined base: slivers become short faces that are no worse than half as sharp", "[unit]") {
  Sheet s = sheet(4, 60, 1.0, 0.1);
  const Sheet before = s;
  const double sharp = smallest_angle(s);
  const BaseSplits splits =
      split_long_edges(s.position, s.faces, std::vector<double>(s.position.size(), 0.15), 100000);
  CHECK(splits.splits == s.position.size() - before.position.size());
  CHECK(splits.longest == 1.0);
  CHECK(std::equal(before.position.begin(), before.position.end(), s.position.begin()));
  CHECK(area(s) == Approx(24.0));
  CHECK(is_whole(s, 4.0, 6.0));
  CHECK(smallest_angle(s) >= 0.5 * sharp);
  for (const Face& f : s.faces)
    for (std::size_t k = 0; k < 3; ++k) CHECK(norm(s.position[f[k]] - s.position[f[(k + 1) % 3]]) <= 0.15);
}

TEST_CASE("refined base: only where it is wanted, and no more vertices than may be", "[unit]") {
  Sheet s = sheet(10, 10, 1.0, 1.0);
  std::vector<double> wanted(s.position.size(), kInfinite);
  wanted[0] = 0.2;
  const Sheet before = s;
  split_long_edges(s.position, s.faces, wanted, 100000);
  CHECK(area(s) == Approx(100.0));
  CHECK(is_whole(s, 10.0, 10.0));
  // Beyond, half the way from there is as long as an edge.
  for (std::size_t v = before.position.size(); v < s.position.size(); ++v)
    CHECK((s.position[v][0] <= 3.0 && s.position[v][1] <= 3.0));
  CHECK(std::find(s.faces.begin(), s.faces.end(), before.faces.back()) != s.faces.end());

  Sheet few = before;
  const BaseSplits splits =
      split_long_edges(few.position, few.faces, std::vector<double>(wanted.size(), 0.1), 500);
  CHECK(few.position.size() == 500);
  CHECK(splits.longest > 4.0);
  CHECK(area(few) == Approx(100.0));
  CHECK(is_whole(few, 10.0, 10.0));
}

TEST_CASE("refined base: an edge of three faces is split in all of them", "[unit]") {
  Sheet t{{{0, 0, 0}, {4, 0, 0}, {2, 1, 0}, {2, -1, 0}, {2, 0, 1}}, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}};
  split_long_edges(t.position, t.faces, std::vector<double>(5, 3.0), 100);
  CHECK(t.position.size() == 6);
  CHECK(t.position.back() == Double3{2, 0, 0});
  CHECK(t.faces.size() == 6);
}

TEST_CASE("refined base: what is wanted is a share of the support's width, piece by piece", "[unit]") {
  const Sheet s = sheet(40, 4, 1.0, 1.0);
  std::vector<std::int32_t> role;
  for (const Double3& p : s.position)
    role.push_back((p[0] > 4.5 && p[0] < 14.5) || (p[0] > 29.5 && p[0] < 33.5) ? kSupportVertex
                                                                               : kFixedVertex);
  const std::vector<double> wanted = wanted_edges(s.position, s.faces, role, 0.1, SupportPart::kAll);
  for (std::size_t v = 0; v < wanted.size(); ++v) {
    const double x = s.position[v][0];
    if (x > 3.5 && x < 15.5)
      CHECK(wanted[v] == Approx(1.0).epsilon(0.2));  // 11 wide
    else if (x > 28.5 && x < 34.5)
      CHECK(wanted[v] == Approx(0.5).epsilon(0.25));  // 5 wide
    else
      CHECK(wanted[v] == kInfinite);
  }
  const std::vector<double> edge = wanted_edges(s.position, s.faces, role, 0.1, SupportPart::kEdge);
  for (std::size_t v = 0; v < edge.size(); ++v) {
    const double x = s.position[v][0];
    const bool ends = std::fabs(x - 4.5) < 1.0 || std::fabs(x - 14.5) < 1.0 || std::fabs(x - 29.5) < 1.0 ||
                      std::fabs(x - 33.5) < 1.0;
    CHECK(edge[v] == (ends ? wanted[v] : kInfinite));
  }
  // Squares with diagonals of 1.41.
  CHECK(coarse_share(s.position, s.faces, wanted, 10.0) == 0.0);
  CHECK(coarse_share(s.position, s.faces, wanted, 2.0) == Approx(5.0 / 16.0).epsilon(0.2));
  CHECK(coarse_share(s.position, s.faces, wanted, 1.0) == 1.0);
  CHECK(least_height(s.position, s.faces, wanted) == Approx(0.5));
  auto faces = s.faces;
  faces.push_back({faces[30][0], faces[30][1], faces[30][0]});
  CHECK(least_height(s.position, faces, std::vector<double>(role.size(), 1.0)) == 0.0);
  CHECK(least_height(s.position, faces, std::vector<double>(role.size(), kInfinite)) == kInfinite);
  CHECK(refined_base_bytes(100, 200) > 100 * sizeof(Double3));
  // Nothing is held.
  const std::vector<double> free = wanted_edges(
      s.position, s.faces, std::vector<std::int32_t>(role.size(), kSupportVertex), 0.1, SupportPart::kAll);
  CHECK(free == std::vector<double>(role.size(), kInfinite));
  CHECK(coarse_share(s.position, s.faces, free, 2.0) == 0.0);
}

}  // namespace refined_base_test
