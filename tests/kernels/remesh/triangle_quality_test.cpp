#include "kernels/remesh/triangle_quality.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/helpers/block_meshes.h"

namespace triangle_quality_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("triangle quality: equilateral triangles are regular to the last digit that is kept", "[unit]") {
  MeshBlock block = grid_block(12, 10, [](double, double) { return 0.0; });
  for (Double3& p : block.position) p = {p[0] - 0.5 * p[1], p[1] * std::sqrt(0.75), 0.0};
  TriangleQuality q;
  q.add(block, 1.0);
  CHECK(q.faces == 240);
  CHECK(q.smallest >= 59999);
  CHECK(q.angle_off <= 240 * 3);
  CHECK(q.length_off <= 240 * 3);
  CHECK(q.area_off <= 240);
  CHECK(q.angles[59] + q.angles[60] == 720);
  CHECK(q.valences[6] == 11 * 9);
  CHECK(q.cells[99] + q.cells[100] == 11 * 9);
  CHECK(q.mean_cell_deviation() < 1e-5);
  TriangleQuality twice = q;
  twice.merge(q);
  CHECK(twice.faces == 480);
  CHECK(twice.valences[6] == 2 * 11 * 9);

  CHECK(twice.cells[99] + twice.cells[100] == 2 * 11 * 9);

  TriangleQuality right;
  right.add(grid_block(4, 4, [](double, double) { return 0.0; }), 1.0);
  CHECK(right.smallest == 45000);
  CHECK(right.angle_off == 32u * (15000 + 15000 + 30000));
}

TEST_CASE("triangle quality: Voronoi cells of uneven rows are off their mean by what they are", "[unit]") {
  // Right triangles over columns of the widths 1 and 3: the cell of an inner vertex is half of both columns beside it.
  MeshBlock block = grid_block(3, 4, [](double, double) { return 0.0; });
  for (Double3& p : block.position) p[0] = p[0] < 0.5 ? 0.0 : p[0] < 1.5 ? 1.0 : p[0] < 2.5 ? 2.0 : 5.0;
  TriangleQuality q;
  q.add(block, 1.5);
  // Inner columns at x = 1 and 2: cells of 1 and 2, a third off their mean of 1.5.
  CHECK(q.mean_cell_deviation() == Approx(1.0 / 3.0).epsilon(1e-5));
}

TEST_CASE(
    "triangle quality: edges between coarse and fine neighbours are found, those of seams are not judged",
    "[unit]") {
  // A step from columns a unit wide to such twice as wide.
  MeshBlock block = grid_block(8, 6, [](double, double) { return 0.0; });
  const auto means_of = [&](double wide) {
    for (Double3& p : block.position) p[0] = p[0] > 4.0 ? 4.0 + wide * (p[0] - 4.0) : p[0];
    return mean_edges(block);
  };
  const std::vector<double> even = means_of(1.0);
  const double inside = (4.0 + 2.0 * std::sqrt(2.0)) / 6.0;
  CHECK(even[2 * 9 + 2] == Approx(inside).epsilon(1e-12));
  CHECK(even[2] == Approx((3.0 + std::sqrt(2.0)) / 4.0).epsilon(1e-12));
  CHECK(find_uneven(block, 1.5).uneven == 0);

  const std::vector<double> mean = means_of(6.0);
  const UnevenEdges found = find_uneven(block, 1.5);
  std::size_t expected = 0, edges = 0;
  double largest = 1.0;
  const auto ask = [&](std::size_t a, std::size_t b) {
    const double ratio = length_ratio(mean[a], mean[b]);
    ++edges;
    expected += ratio > 1.5;
    largest = std::max(largest, ratio);
  };
  for (std::size_t j = 0; j < 7; ++j)
    for (std::size_t i = 0; i < 9; ++i) {
      const std::size_t v = 9 * j + i;
      if (i < 8) ask(v, v + 1);
      if (j < 6) ask(v, v + 9);
      // The diagonal that the square has.
      if (i < 8 && j < 6) {
        const bool rising = std::any_of(block.faces.begin(), block.faces.end(), [&](const auto& f) {
          return std::find(f.begin(), f.end(), v) != f.end() &&
                 std::find(f.begin(), f.end(), v + 10) != f.end();
        });
        rising ? ask(v, v + 10) : ask(v + 1, v + 9);
      }
    }
  CHECK(expected > 10);
  CHECK(found.edges == edges);
  CHECK(found.uneven == expected);
  TriangleQuality q;
  q.add(block, 1.0);
  std::uint64_t all = 0, beyond = 0;
  for (std::size_t i = 0; i < q.ratios.size(); ++i) all += q.ratios[i], beyond += i < 10 ? 0 : q.ratios[i];
  CHECK(all == 2 * edges);
  CHECK(beyond == 2 * expected);
  CHECK(static_cast<double>(q.largest_ratio) == Approx(1e6 * largest).margin(1.0));

  const MeshBlock left = piece_of(block, [](std::uint32_t v) { return v % 9 < 6; });
  const std::vector<double> part = mean_edges(left);
  CHECK(std::count(part.begin(), part.end(), 0.0) == 7);  // the column at the seam
}

}  // namespace triangle_quality_test
