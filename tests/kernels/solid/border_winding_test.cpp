#include "kernels/solid/border_winding.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <random>

#include "kernels/solid/border_leaf.h"
#include "octree/portable_math.h"

namespace border_winding_test {

using namespace tessera;

namespace {

using Corners = std::array<Long3, 3>;

/// Triangles that share nothing, about as large as `edge` cells, some with corners on nodes and edges along the axes.
std::vector<Corners> soup(std::size_t faces, double edge, std::uint64_t seed, double from = 40.0) {
  std::vector<Corners> out(faces);
  std::mt19937_64 bits(seed);
  const auto draw = [&] { return static_cast<double>(bits() >> 11) * 0x1p-53; };
  for (std::size_t f = 0; f < faces; ++f) {
    Double3 at;
    for (double& c : at) c = from + 160.0 * draw();
    for (Long3& corner : out[f])
      for (std::size_t k = 0; k < 3; ++k) {
        const double c = at[k] + edge * (draw() - 0.5);
        corner[k] = f % 4 == 0 ? kSolidQuanta * static_cast<std::int64_t>(c)
                               : static_cast<std::int64_t>(c * static_cast<double>(kSolidQuanta));
      }
    if (f % 8 == 0) out[f][1] = {out[f][0][0] + 3 * kSolidQuanta, out[f][0][1], out[f][0][2]};
  }
  return out;
}

std::vector<BorderEdge> border_of(const std::vector<Corners>& faces) {
  std::map<std::pair<Long3, Long3>, std::int64_t> edges;
  for (const Corners& t : faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const Long3 &a = t[k], &b = t[(k + 1) % 3];
      if (a < b) ++edges[{a, b}];
      if (b < a) --edges[{b, a}];
    }
  std::vector<BorderEdge> border;
  for (const auto& [ends, count] : edges)
    if (count != 0) border.push_back({ends.first, ends.second, count});
  return border;
}

/// Solid angle of all faces over 4 pi; infinite where a face holds the place.
double winding_of(const std::vector<Corners>& faces, const Double3& x) {
  double sum = 0.0;
  for (const Corners& t : faces) {
    std::array<Double3, 3> p;
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t a = 0; a < 3; ++a)
        p[c][a] = static_cast<double>(t[c][a]) / static_cast<double>(kSolidQuanta) - x[a];
    const double la = norm(p[0]), lb = norm(p[1]), lc = norm(p[2]), volume = dot(p[0], cross(p[1], p[2]));
    const double along = la * lb * lc + dot(p[0], p[1]) * lc + dot(p[1], p[2]) * la + dot(p[0], p[2]) * lb;
    if (std::fabs(volume) <= 1e-9 * la * lb * lc && along <= 1e-9 * la * lb * lc) return HUGE_VAL;
    sum += 2.0 * std::atan2(volume, along);
  }
  return sum / (4.0 * kPi);
}

}  // namespace

TEST_CASE("border winding: nodes of a leaf in a soup, against the sum of solid angles", "[property]") {
  for (const std::size_t count : {std::size_t{40}, std::size_t{8000}}) {
    const std::vector<Corners> faces = soup(count, 6.0, 7 + count);
    const BorderWinding border(border_of(faces));
    double leaf_error = 0.0, node_error = 0.0;
    std::size_t checked = 0;
    for (int l = 0; l < 24; ++l) {
      const Int3 corner = {8 * (4 + l), 8 * (6 + 7 * l % 19), 8 * (6 + 11 * l % 19)};
      BorderRegions regions;
      BorderLeaf leaf(border, regions.of(border, {corner[0] / 8, corner[1] / 8, corner[2] / 8}), corner);
      for (std::size_t n = 0; n < 512; n += 47) {
        const Int3 node = {corner[0] + static_cast<int>(n & 7), corner[1] + static_cast<int>(n >> 3 & 7),
                           corner[2] + static_cast<int>(n >> 6)};
        const double truth = winding_of(faces, {static_cast<double>(node[0]), static_cast<double>(node[1]),
                                                static_cast<double>(node[2])});
        if (!std::isfinite(truth)) continue;
        // Faces add whole turns.
        const auto off = [&](double share) { return std::fabs(share - truth - std::round(share - truth)); };
        const double of_leaf = off(leaf.at(n)), of_node = off(border.at(node));
        leaf_error = std::max(leaf_error, of_leaf), node_error = std::max(node_error, of_node);
        // The two agree about the turns, too, whichever shadows the node lies in.
        CHECK(std::fabs(leaf.at(n) - border.at(node)) < 0.1);
        ++checked;
      }
    }
    CHECK(checked > 200);
    INFO(border.size() << " edges, errors " << leaf_error << " of a leaf, " << node_error << " of a node");
    const double bound = count < 100 ? 1e-4 : 1e-3;
    CHECK(leaf_error < bound);
    CHECK(node_error < bound);
  }
}

TEST_CASE("border winding: leaves far from a soup take what their region has, near ones their own part",
          "[property]") {
  const std::vector<Corners> faces = soup(3000, 6.0, 11, 600.0);
  const BorderWinding border(border_of(faces));
  BorderRegions regions;
  std::size_t whole = 0, checked = 0;
  double error = 0.0;
  for (int l = 0; l < 40; ++l) {
    // Beside it, behind it, and in the shadow of its ribbons.
    const Int3 corner = {8 * (5 + 17 * l % 150), 8 * (l % 3 == 0 ? 80 : 10 + 13 * l % 130),
                         8 * (l % 2 == 0 ? 85 : 20 + 7 * l % 120)};
    const BorderRegion& region = regions.of(border, {corner[0] / 8, corner[1] / 8, corner[2] / 8});
    whole += region.near().empty();
    BorderLeaf leaf(border, region, corner);
    double low = 1e9, high = -1e9;
    for (std::size_t n = 0; n < 512; n += 61) {
      const Double3 x = {corner[0] + static_cast<double>(n & 7), corner[1] + static_cast<double>(n >> 3 & 7),
                         corner[2] + static_cast<double>(n >> 6)};
      const double truth = winding_of(faces, x);
      if (!std::isfinite(truth)) continue;
      const double off = leaf.at(n) - truth;
      error = std::max(error, std::fabs(off - std::round(off)));
      low = std::min(low, truth), high = std::max(high, truth);
      ++checked;
    }
    if (region.near().empty()) CHECK(high - low <= region.change());
  }
  INFO("error " << error << ", " << whole << " regions without near clusters");
  CHECK(checked > 300);
  CHECK(whole > 5);
  CHECK(whole < 35);
  CHECK(error < 1e-3);
}

}  // namespace border_winding_test
