#include "kernels/solid/border_leaf.h"

#include <algorithm>

#include "kernels/solid/ribbon_angles.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

using Side = BorderPoints::Side;

constexpr float kNarrow = 8.0f;    ///< cells: of wider clusters most ribbons do not pass near
constexpr double kFarEdge = 0.25;  ///< half its length over distance from which two points stand for an edge

}  // namespace

const std::array<BorderPoints::Weights, 8>& BorderLeaf::weights() {
  static const auto made = [] {
    std::array<BorderPoints::Weights, 8> w;
    for (std::size_t n = 0; n < 8; ++n) w[n] = BorderPoints::weights(static_cast<double>(n));
    return w;
  }();
  return made;
}

BorderLeaf::BorderLeaf(const BorderWinding& border, const BorderRegion& region, const Int3& corner)
    : border_(border), corner_(corner), smooth_(corner, 1) {
  if (border.empty()) return;
  smooth_.add_from(region.far());
  if (region.near().empty()) return;
  std::vector<BoundaryStripRow<1>> rows;
  rows.reserve(kPoints * kPoints);
  for (std::size_t row = 0; row < kPoints * kPoints; ++row) {
    std::array<std::int64_t, kPoints> x;
    for (std::size_t p = 0; p < kPoints; ++p) x[p] = corner[0] * kSolidQuanta + BorderPoints::kNodes[p];
    rows.emplace_back(x, corner[1] * kSolidQuanta + BorderPoints::kNodes[row % kPoints],
                      corner[2] * kSolidQuanta + BorderPoints::kNodes[row / kPoints]);
  }
  const Double3 middle = smooth_.middle();
  const auto add_edge = [&](std::uint32_t e) {
    const BorderEdge& edge = border.edges()[e];
    Double3 a, b;
    for (std::size_t k = 0; k < 3; ++k) {
      a[k] = static_cast<double>(edge.a[k]) * kCellsPerQuantum;
      b[k] = static_cast<double>(edge.b[k]) * kCellsPerQuantum;
    }
    const Double3 centre = (a + b) * 0.5;
    const double near = BorderPoints::distance(centre - middle, Side::kAhead), radius = 0.5 * norm(b - a);
    if (!smooth_.is_smooth(near - radius)) {
      const double behind = BorderPoints::distance(centre - middle, Side::kBehind);
      if (smooth_.is_smooth(behind - radius) && radius < kFarEdge * smooth_.free(behind)) {
        smooth_.add_edge(centre, b - a, static_cast<double>(edge.count), Side::kBehind);
        behind_.push_back(e);
      } else {
        near_.push_back(e);
      }
    } else if (radius < kFarEdge * smooth_.free(near)) {
      smooth_.add_edge(centre, b - a, static_cast<double>(edge.count));
    } else {
      for (BoundaryStripRow<1>& row : rows) row.add(edge);
    }
  };
  std::array<std::uint32_t, BorderWinding::kStack> stack;
  for (const std::uint32_t root : region.near()) {
    std::size_t top = 0;
    stack[top++] = root;
    while (top > 0) {
      const BorderCluster& c = border.clusters()[stack[--top]];
      if (smooth_.is_far(c)) {
        smooth_.add_cluster(c);
      } else if (c.radius < kNarrow && smooth_.is_far(c, Side::kBehind)) {
        smooth_.add_cluster(c, Side::kBehind);
        for (std::uint32_t e = c.first; e < c.end; ++e) behind_.push_back(e);
      } else if (c.left != 0) {
        stack[top++] = c.left + 1;
        stack[top++] = c.left;
      } else {
        for (std::uint32_t e = c.first; e < c.end; ++e) add_edge(e);
      }
    }
  }
  for (std::size_t row = 0; row < rows.size(); ++row) {
    const auto half = rows[row].value();
    for (std::size_t p = 0; p < kPoints; ++p) smooth_.add(row, p, 2.0 * half[p]);
  }
}

void BorderLeaf::sum_strips(std::size_t z) {
  EndlessStripRows rows(corner_[1] * kSolidQuanta,
                        (corner_[2] + static_cast<std::int64_t>(z)) * kSolidQuanta);
  for (const std::uint32_t e : behind_) rows.add(border_.edges()[e]);
  const std::array<double, 8> half = rows.value();
  std::copy(half.begin(), half.end(), strips_.begin() + static_cast<std::ptrdiff_t>(8 * z));
  strips_summed_ |= 1u << z;
}

void BorderLeaf::sum_row(std::size_t row) {
  const std::size_t y = row % 8, z = row / 8;
  if (!behind_.empty() && !(strips_summed_ >> z & 1)) sum_strips(z);
  std::array<double, 8> half{};
  if (!near_.empty()) {
    std::array<std::int64_t, 8> x;
    for (std::size_t n = 0; n < 8; ++n) x[n] = (corner_[0] + static_cast<std::int64_t>(n)) * kSolidQuanta;
    BoundaryStripRow<2> strips(x, (corner_[1] + static_cast<std::int64_t>(y)) * kSolidQuanta,
                               (corner_[2] + static_cast<std::int64_t>(z)) * kSolidQuanta);
    for (const std::uint32_t e : near_) strips.add(border_.edges()[e]);
    half = strips.value();
  }
  const auto& w = weights();
  const BorderPoints::Weights line = smooth_.line(w[y], w[z]);
  for (std::size_t n = 0; n < 8; ++n) {
    double far = 0.0;
    for (std::size_t i = 0; i < kPoints; ++i) far += w[n][i] * line[i];
    share_[8 * row + n] = (far + 2.0 * (half[n] + strips_[row])) / (4.0 * kPi);
  }
  summed_ |= std::uint64_t{1} << row;
}

double BorderLeaf::at(std::size_t node) {
  if (border_.empty()) return 0.0;
  if (!(summed_ >> (node / 8) & 1)) sum_row(node / 8);
  return share_[node];
}

}  // namespace tessera
