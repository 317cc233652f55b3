#include "kernels/field/unseen_cells.h"

#include <algorithm>
#include <array>

#include "kernels/field/sample_list.h"

namespace tessera {
namespace {

/// Cells of a leaf and one around it, a bit each: rows along x.
using CellRows = std::array<std::array<std::uint16_t, kLeafCells + 2>, kLeafCells + 2>;

/// Those with a marked cell at most one away, without the outermost.
LeafWords spread(const CellRows& rows) {
  LeafWords out{};
  for (std::size_t z = 0; z < kLeafCells; ++z)
    for (std::size_t y = 0; y < kLeafCells; ++y) {
      unsigned near = 0;
      for (std::size_t dz = 0; dz < 3; ++dz)
        for (std::size_t dy = 0; dy < 3; ++dy) near |= rows[z + dz][y + dy];
      near = (near | near << 1 | near >> 1) >> 1 & 0xffu;
      out[z] |= std::uint64_t{near} << (8 * y);
    }
  return out;
}

}  // namespace

void mark_unseen_cells(const PointBlock& points, const PointLeaves& leaves, DirectedField& field) {
  const auto is_unseen = [](std::uint16_t flags) { return (flags & kPointUnseen) != 0; };
  if (std::none_of(points.flags.begin(), points.flags.end(), is_unseen)) return;
  const SampleBox box = {{-1.0f, -1.0f, -1.0f}, {9.0f, 9.0f, 9.0f}};
  SampleList samples;
  for (BandLeaf& leaf : field.leaves) {
    gather_samples(points, leaves, leaf.origin[0] / kLeafCells, leaf.origin[1] / kLeafCells,
                   leaf.origin[2] / kLeafCells, box, samples);
    CellRows unseen{}, seen{};
    const auto cell = [](float at) { return static_cast<std::size_t>(at + 1.0f); };
    for (std::size_t s = 0; s < samples.size; ++s) {
      CellRows& rows = is_unseen(points.flags[samples.point[s]]) ? unseen : seen;
      std::uint16_t& row = rows[cell(samples.z[s])][cell(samples.y[s])];
      row = static_cast<std::uint16_t>(row | 1u << cell(samples.x[s]));
    }
    const LeafWords some = spread(unseen), others = spread(seen);
    for (std::size_t z = 0; z < kLeafCells; ++z) leaf.unseen[z] = some[z] & ~others[z];
  }
}

}  // namespace tessera
