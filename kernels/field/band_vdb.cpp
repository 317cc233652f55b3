#include "kernels/field/band_vdb.h"

#include "kernels/field/vdb_leaf.h"
//
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <bit>

namespace tessera {

struct VdbExport::Impl {
  openvdb::FloatGrid::Ptr grid;
  float h = 1.0f;
};

VdbExport::VdbExport(const Lattice& lattice) : impl_(std::make_unique<Impl>()) {
  openvdb::initialize();
  impl_->h = static_cast<float>(lattice.h);
  impl_->grid = openvdb::FloatGrid::create(kBandBackground * impl_->h);
  impl_->grid->setName("distance");
  impl_->grid->setGridClass(openvdb::GRID_LEVEL_SET);
  auto transform = openvdb::math::Transform::createLinearTransform(lattice.h);
  transform->postTranslate({lattice.world(0, 0.0), lattice.world(1, 0.0), lattice.world(2, 0.0)});
  impl_->grid->setTransform(transform);
}

VdbExport::~VdbExport() = default;

void VdbExport::add(DirectedField&& field) {
  auto& tree = impl_->grid->tree();
  for (BandLeaf& leaf : field.leaves) {
    VdbLeaf* from = leaf.release();
    float* value = from->buffer().data();
    for (std::size_t n = 0; n < VdbLeaf::SIZE; ++n) value[n] *= impl_->h;
    VdbLeaf* to = tree.probeLeaf(from->origin());
    if (!to) {
      tree.addLeaf(from);
      continue;
    }
    // A leaf on the common face of two blocks: each holds nodes of its own.
    for (openvdb::Index word = 0; word < 8; ++word) {
      const auto nodes = from->getValueMask().getWord<std::uint64_t>(word);
      for (std::uint64_t left = nodes; left; left &= left - 1) {
        const auto n = 64 * word + static_cast<openvdb::Index>(std::countr_zero(left));
        to->buffer().data()[n] = value[n];
      }
      to->getValueMask().getWord<std::uint64_t>(word) |= nodes;
    }
    delete from;
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
