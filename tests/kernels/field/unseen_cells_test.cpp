// Which faces of a surface nobody saw.
#include <algorithm>
#include <catch2/catch.hpp>
#include <utility>
#include <vector>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/field/field.h"

namespace unseen_cells_test {

using namespace tessera;

namespace {

constexpr int kCells = 64;
constexpr float kHalf = 30.0f;  ///< samples beyond it in x were not seen

/// A level sheet of samples, half a cell apart, in canonical order.
PointBlock sheet(bool flags) {
  PointBlock block;
  block.cells = {kCells, kCells, kCells};
  std::vector<std::pair<std::uint64_t, Float3>> samples;
  for (float y = 0.25f; y < kCells; y += 0.5f)
    for (float x = 0.25f; x < kCells; x += 0.5f)
      samples.push_back(
          {morton_encode(static_cast<std::uint32_t>(x * 4), static_cast<std::uint32_t>(y * 4), 133u),
           {x, y, 33.25f}});
  std::sort(samples.begin(), samples.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  for (const auto& [key, p] : samples) {
    block.x.push_back(p[0]), block.y.push_back(p[1]), block.z.push_back(p[2]);
    block.nx.push_back(0), block.ny.push_back(0), block.nz.push_back(1);
    if (flags) block.flags.push_back(p[0] > kHalf ? kPointSynthetic | kPointUnseen : std::uint16_t{0});
  }
  return block;
}

/// Faces of the sheet beyond `x`, and how many of these are marked.
std::pair<int, int> faces_beyond(const DirectedField& field, float x, bool beyond) {
  int all = 0, marked = 0;
  extract_surface(field, {}, [&](Patch&& patch) {
    for (std::size_t f = 0; f < patch.faces.size(); ++f) {
      float low = kCells, high = 0;
      bool own = true;
      for (const std::uint32_t v : patch.faces[f]) {
        own = own && v < patch.position.size();
        if (!own) break;
        const float at = patch.position[v][0] + static_cast<float>(patch.brick[0] * kBrickCells);
        low = std::min(low, at), high = std::max(high, at);
      }
      if (!own || (beyond ? low < x : high > x)) continue;
      ++all;
      marked += !patch.synthetic.empty() && patch.synthetic[f] != 0;
    }
  });
  return {all, marked};
}

}  // namespace

TEST_CASE("unseen cells: faces far from every measured sample are marked, others are not", "[unit]") {
  const DirectedField field = evaluate_field(sheet(true), {});
  const auto [unseen, marked] = faces_beyond(field, kHalf + 3, true);
  CHECK(unseen > 1000);
  CHECK(marked == unseen);
  const auto [seen, wrong] = faces_beyond(field, kHalf, false);
  CHECK(seen > 1000);
  CHECK(wrong == 0);
}

TEST_CASE("unseen cells: none where samples bring no flags", "[unit]") {
  const DirectedField field = evaluate_field(sheet(false), {});
  for (const BandLeaf& leaf : field.leaves) CHECK(leaf.unseen == LeafWords{});
}

}  // namespace unseen_cells_test
