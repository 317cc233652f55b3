/// \file vdb_leaf.h
/// OpenVDB's leaf, complete. Include this before any other header of OpenVDB.
///
/// A leaf of a .vdb file can leave its values on disk until they are read. Those of the band never do, and the code that
/// fetches them is all that ties a leaf to libopenvdb, which costs 28 MB and 60 ms at every start: so without it.
/// Whoever reads a .vdb file beside this reads it whole: OpenVDB's readers take `delayLoad = false`.
#pragma once
#include <openvdb/tree/LeafBuffer.h>

#include <stdexcept>

#include "kernels/field/band_leaf.h"

namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME::tree {
/// Hidden: libopenvdb keeps its own for grids that it reads.
template <>
// NOLINTNEXTLINE(readability-identifier-naming): OpenVDB's name
[[gnu::visibility("hidden")]] inline void LeafBuffer<float, tessera::kLeafBits>::doLoad() const {
  throw std::logic_error("a leaf whose values are on disk: read the grid with delayLoad = false");
}
}  // namespace OPENVDB_VERSION_NAME::tree
}  // namespace openvdb

#include <openvdb/tree/LeafNode.h>
