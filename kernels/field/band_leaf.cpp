#include "kernels/field/band_leaf.h"

#include "kernels/field/vdb_leaf.h"

namespace tessera {

BandLeaf::BandLeaf(const Int3& block, const Int3& at)
    : origin(at),
      vdb_(
          new VdbLeaf(openvdb::Coord(block[0] + at[0], block[1] + at[1], block[2] + at[2]), kBandBackground)),
      values_(vdb_->buffer().data()),
      mask_(&vdb_->getValueMask().getWord<std::uint64_t>(0)) {}

void BandLeaf::Delete::operator()(VdbLeaf* leaf) const noexcept {
  delete leaf;
}

}  // namespace tessera
