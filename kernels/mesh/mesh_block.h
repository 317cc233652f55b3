/// \file mesh_block.h
/// A piece of a mesh in memory: the block that decimation, smoothing and the certificate work on.
///
/// Vertices bear a global name (their key), so pieces join by key alone. Whether a vertex may change is
/// decided locally: its star is complete when every edge at it has two faces in the block or is marked as a
/// border.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/mesh/patch.h"
#include "octree/lattice.h"

namespace tessera {

/// Bits of MeshBlock::face_flags.
enum MeshFaceFlag : std::uint8_t {
  kFaceBorder01 = 1,  ///< the surface ends at the edge from corner 0 to corner 1
  kFaceBorder12 = 2,
  kFaceBorder20 = 4,
  kFaceSynthetic = 8,  ///< closes a hole: no data there
  kFaceDone = 16,      ///< a pass of decimation found nothing to do at its corners, with complete stars
  kFaceCrease01 = 32,  ///< the edge from corner 0 to corner 1 is a crease: for those who carry creases along
  kFaceCrease12 = 64,
  kFaceCrease20 = 128,
};

/// n vertices, m faces. Canonical: keys ascending; the smallest index of a face first; faces ascending.
struct MeshBlock {
  std::vector<std::uint64_t> key;         ///< n, unique over the whole mesh
  std::vector<Double3> position;          ///< n, scan units, world frame: exactly what the file holds
  std::vector<VertexClass> vertex_class;  ///< n
  std::vector<std::uint32_t> rgba;        ///< n, or empty without colour; as PointRecord::rgba
  std::vector<std::array<std::uint32_t, 3>> faces;  ///< m, counter-clockwise from outside
  std::vector<std::uint8_t> face_flags;             ///< m, bits of MeshFaceFlag
  /// m, or empty (all 0): bound of the distance between the face and what it stands for in the reference,
  /// both ways, scan units. Decimation keeps it below the tolerance; carry it with the faces from pass to
  /// pass.
  std::vector<float> face_bound;
};

}  // namespace tessera
