#include "kernels/field/coarser_fits.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "octree/vector.h"

namespace tessera {
namespace {

constexpr float kSameSide = 0.5f;  ///< cosine between normals of fits that see one surface: 60 degrees

/// What coarser fits say at a node, in its cells.
struct CoarserNode {
  float value = 0.0f, depth = 0.0f;
  Float3 gradient{}, inward{};
  const Sheets* sheets = nullptr;  ///< those of `at`, its distance from the node in coarse cells
  Float3 at{};
};

std::size_t node_index(const Int3& node) {
  return static_cast<std::size_t>((node[0] & 7) + 8 * (node[1] & 7) + 64 * (node[2] & 7));
}

/// Index of a set bit among the set ones.
std::uint32_t rank(const std::array<std::uint64_t, 8>& words, const std::array<std::uint32_t, 8>& first,
                   std::size_t node) {
  const std::uint64_t below = (std::uint64_t{1} << (node & 63)) - 1;
  return first[node >> 6] + static_cast<std::uint32_t>(std::popcount(words[node >> 6] & below));
}
bool has(const std::array<std::uint64_t, 8>& words, std::size_t node) {
  return (words[node >> 6] >> (node & 63) & 1) != 0;
}

/// The mean over the coarse nodes around: exact for quadratic functions. \return false where one of them says nothing
bool look_up(const CoarserFits& coarser, const Int3& node, CoarserNode& out) {
  std::array<std::array<int, 2>, 3> around;
  for (std::size_t a = 0; a < 3; ++a)
    around[a] = {(node[a] >> 1) - coarser.band.origin[a], ((node[a] + 1) >> 1) - coarser.band.origin[a]};
  float count = 0.0f, value = 0.0f, depth = 0.0f, sparse_depth = SparseNodes::kDeep;
  Float3 gradient{}, inward{};
  for (int c = 0; c < 8; ++c) {
    Int3 at;
    bool again = false;
    Float3 d;  // from the coarse node to this one
    for (std::size_t a = 0; a < 3; ++a) {
      const auto side = static_cast<std::size_t>(c >> a & 1);
      again = again || (side == 1 && around[a][0] == around[a][1]);
      at[a] = around[a][side];
      d[a] = around[a][0] == around[a][1] ? 0.0f : side == 0 ? 0.5f : -0.5f;
    }
    if (again) continue;
    sparse_depth = std::min(sparse_depth, coarser.sparse.depth(at));
    if (sparse_depth < -kBoundaryMargin) return false;
    const LeafFit* fit = coarser.band.at(at);
    const std::size_t i = node_index(at);
    if (!fit || !has(fit->valid, i)) return false;
    const Float3 g = {fit->gradient[0][i], fit->gradient[1][i], fit->gradient[2][i]};
    value += fit->value[i] + 0.5f * dot(g, d);
    gradient = gradient + g;
    count += 1.0f;
    if (has(fit->at_boundary, i)) {
      const BoundaryNode& r = coarser.band.boundaries[rank(fit->at_boundary, fit->first_boundary, i)];
      depth += r.depth;
      inward = inward + r.inward;
    } else {
      depth += kBoundaryDepth;
    }
    if (has(fit->creased, i)) {
      const Sheets& s = coarser.band.sheets[rank(fit->creased, fit->first_sheets, i)];
      if (!out.sheets || s.count > out.sheets->count) out.sheets = &s, out.at = d;
    }
  }
  const float length = norm(gradient);
  if (!(length > 0.0f)) return false;
  out.gradient = gradient * (1.0f / length);
  out.value = 2.0f * value / count;
  out.depth = std::min(2.0f * depth / count, sparse_depth);
  out.inward = inward * (2.0f / count);
  return true;
}

/// Sheets relative to a node, in coarse cells, as they are relative to one at `d` from it, in cells of half the edge.
Sheets moved(const Sheets& sheets, const Float3& d) {
  Sheets out = sheets;
  for (int s = 0; s < sheets.count; ++s) {
    Sheet& f = out.sheet[static_cast<std::size_t>(s)];
    const auto& h = f.h;
    const Float3 hd = {h[0] * d[0] + h[1] * d[1] + h[2] * d[2], h[1] * d[0] + h[3] * d[1] + h[4] * d[2],
                       h[2] * d[0] + h[4] * d[1] + h[5] * d[2]};
    f.f0 = 2.0f * (f.f0 + dot(f.g, d) + 0.5f * dot(d, hd));
    f.g = f.g + hd;
    for (float& x : f.h) x *= 0.5f;
  }
  out.centroid = (sheets.centroid - d) * 2.0f;
  out.spread2 *= 4.0f;
  return out;
}

}  // namespace

const LeafFit* BandFits::at(const Int3& node) const {
  const Int3 d = {cells[0] / kLeafCells + 2, cells[1] / kLeafCells + 2, cells[2] / kLeafCells + 2};
  const auto i = static_cast<std::size_t>(
      (((node[2] >> kLeafBits) + 1) * d[1] + (node[1] >> kLeafBits) + 1) * d[0] + (node[0] >> kLeafBits) + 1);
  const std::int32_t leaf_of = leaf_index[i];
  return leaf_of < 0 ? nullptr : &fits[static_cast<std::size_t>(leaf_of)];
}

void keep_boundaries(const LeafBoundary& boundary, LeafFit& fit, std::vector<BoundaryNode>& boundaries) {
  for (std::size_t z = 0; z < 8; ++z) {
    fit.first_boundary[z] = static_cast<std::uint32_t>(boundaries.size());
    fit.at_boundary[z] = boundary.nodes[z] & fit.valid[z];
    for (std::uint64_t left = fit.at_boundary[z]; left; left &= left - 1)
      boundaries.push_back(boundary.at(64 * z + static_cast<std::size_t>(std::countr_zero(left))));
  }
}

void add_coarser_leaves(const CoarserFits& coarser, const Int3& origin, const Int3& cells,
                        std::vector<BandNodes>& band) {
  const Int3 dims = {cells[0] / kLeafCells + 2, cells[1] / kLeafCells + 2, cells[2] / kLeafCells + 2};
  std::vector<std::uint8_t> near(static_cast<std::size_t>(dims[0] * dims[1] * dims[2]), 0);
  for (const Int3& leaf : coarser.band.leaf) {
    // Nodes 8 leaf .. 8 leaf + 7 reach fine ones from twice the first less one to twice the last and one.
    Int3 first, last;
    for (std::size_t a = 0; a < 3; ++a) {
      const int low = 2 * (kLeafCells * leaf[a] + coarser.band.origin[a]) - origin[a];
      first[a] = std::max(-1, (low - 1) >> kLeafBits);
      last[a] = std::min(dims[a] - 2, (low + 2 * kLeafCells - 1) >> kLeafBits);
    }
    for (int k = first[2]; k <= last[2]; ++k)
      for (int j = first[1]; j <= last[1]; ++j)
        for (int i = first[0]; i <= last[0]; ++i)
          near[static_cast<std::size_t>(((k + 1) * dims[1] + j + 1) * dims[0] + i + 1)] = 1;
  }
  for (const BandNodes& b : band) near[b.leaf] = 0;
  for (std::size_t leaf = 0; leaf < near.size(); ++leaf)
    if (near[leaf]) band.push_back({static_cast<std::uint32_t>(leaf), {}});
  std::sort(band.begin(), band.end(), [](const BandNodes& a, const BandNodes& b) { return a.leaf < b.leaf; });
}

void fill_from_coarser(const CoarserFits& coarser, const Int3& origin, const Int3& leaf,
                       const std::array<std::uint64_t, 8>& nodes, LeafFit& fit, LeafBoundary& boundary,
                       std::vector<Sheets>& sheets) {
  std::vector<std::pair<std::size_t, Sheets>> more;  // of nodes that had none
  for (std::size_t z = 0; z < 8; ++z) {
    const std::uint64_t within = fit.valid[z] & ~boundary.nodes[z];
    for (std::uint64_t left = nodes[z] & ~within; left; left &= left - 1) {
      const auto b = static_cast<std::size_t>(std::countr_zero(left));
      const std::uint64_t bit = std::uint64_t{1} << b;
      const std::size_t i = 64 * z + b;
      CoarserNode found;
      const Int3 node = {origin[0] + kLeafCells * leaf[0] + static_cast<int>(b & 7),
                         origin[1] + kLeafCells * leaf[1] + static_cast<int>(b >> 3),
                         origin[2] + kLeafCells * leaf[2] + static_cast<int>(z)};
      if (!look_up(coarser, node, found) || found.depth < -kBoundaryMargin) continue;
      const bool valid = (fit.valid[z] & bit) != 0;
      const float depth = valid ? boundary.depth[i] : -kBoundaryMargin;
      if (depth >= found.depth) continue;
      Float3 own = {fit.gradient[0][i], fit.gradient[1][i], fit.gradient[2][i]};
      if (!valid) {
        if (found.sheets) {
          Sheets here = moved(*found.sheets, found.at);
          const SurfaceValue at = here.at({0, 0, 0});
          found.value = at.value;
          found.gradient = at.normal;
          if (std::abs(found.value) <= kLargestValue) more.emplace_back(i, here);
        }
        if (std::abs(found.value) > kLargestValue) continue;
        fit.value[i] = found.value;
        for (std::size_t c = 0; c < 3; ++c) fit.gradient[c][i] = found.gradient[c];
        fit.valid[z] |= bit;
      } else if (!(fit.creased[z] & bit) && dot(own, found.gradient) > kSameSide) {
        const float t = std::clamp(depth, 0.0f, 1.0f);
        own = unit_or_zero(own * t + found.gradient * (1.0f - t));
        fit.value[i] = t * fit.value[i] + (1.0f - t) * found.value;
        for (std::size_t c = 0; c < 3; ++c) fit.gradient[c][i] = own[c];
      }
      if (found.depth >= kBoundaryDepth) {
        boundary.nodes[z] &= ~bit;
        continue;
      }
      boundary.nodes[z] |= bit;
      boundary.depth[i] = found.depth;
      for (std::size_t c = 0; c < 3; ++c) boundary.inward[c][i] = found.inward[c];
    }
  }
  if (more.empty()) return;
  // Sheets in the order of their nodes: those of the leaf are the last ones.
  std::vector<Sheets> old(sheets.begin() + fit.first_sheets[0], sheets.end());
  sheets.resize(fit.first_sheets[0]);
  std::size_t next_old = 0, next = 0;
  for (std::size_t z = 0; z < 8; ++z) {
    fit.first_sheets[z] = static_cast<std::uint32_t>(sheets.size());
    std::uint64_t added = 0;
    for (std::size_t m = next; m < more.size() && more[m].first >> 6 == z; ++m)
      added |= std::uint64_t{1} << (more[m].first & 63);
    for (std::uint64_t left = fit.creased[z] | added; left; left &= left - 1)
      sheets.push_back(left & (~left + 1) & added ? more[next++].second : old[next_old++]);
    fit.creased[z] |= added;
  }
}

}  // namespace tessera
