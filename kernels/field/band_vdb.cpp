#include "kernels/field/band_vdb.h"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <bit>

namespace tessera {
namespace {

/// Outside the band, in cells: beyond any value in it.
constexpr float kBackground = 3.0f;

}  // namespace

struct VdbExport::Impl {
  openvdb::FloatGrid::Ptr grid;
  float h = 1.0f;
};

VdbExport::VdbExport(const Lattice& lattice) : impl_(std::make_unique<Impl>()) {
  openvdb::initialize();
  impl_->h = static_cast<float>(lattice.h);
  impl_->grid = openvdb::FloatGrid::create(kBackground * impl_->h);
  impl_->grid->setName("distance");
  impl_->grid->setGridClass(openvdb::GRID_LEVEL_SET);
  auto transform = openvdb::math::Transform::createLinearTransform(lattice.h);
  transform->postTranslate({lattice.world(0, 0.0), lattice.world(1, 0.0), lattice.world(2, 0.0)});
  impl_->grid->setTransform(transform);
}

VdbExport::~VdbExport() = default;

void VdbExport::add(const DirectedField& field) {
  auto accessor = impl_->grid->getAccessor();
  for (const BandLeaf& leaf : field.leaves) {
    // Lattice leaves are the grid's own leaves: both are aligned to 8 nodes.
    const openvdb::Coord origin(field.origin[0] + leaf.origin[0], field.origin[1] + leaf.origin[1],
                                field.origin[2] + leaf.origin[2]);
    auto* to = accessor.touchLeaf(origin);
    for (int z = 0; z < 8; ++z)
      for (std::uint64_t left = leaf.valid[static_cast<std::size_t>(z)]; left; left &= left - 1) {
        const int bit = std::countr_zero(left);
        const openvdb::Index offset = static_cast<openvdb::Index>((bit & 7) << 6 | (bit >> 3) << 3 | z);
        to->setValueOn(offset, leaf.value[static_cast<std::size_t>(bit + 64 * z)] * impl_->h);
      }
  }
}

std::size_t VdbExport::node_count() const {
  return static_cast<std::size_t>(impl_->grid->activeVoxelCount());
}

std::size_t VdbExport::bytes() const {
  return static_cast<std::size_t>(impl_->grid->memUsage());
}

void VdbExport::write(std::ostream& out) const {
  openvdb::io::Stream stream(out);
  stream.write(openvdb::GridCPtrVec{impl_->grid});
}

}  // namespace tessera
