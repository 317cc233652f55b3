/// \file pose_base.h
/// The base surface in a pose, and what is told of it: the part of an edit that does not stream.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "octree/placement.h"
#include "stream/stages/deform/deform_files.h"

namespace tessera {

struct PosedBase {
  std::vector<Double3> position;
  std::size_t flipped = 0;  ///< faces that turn over against how the smooth base turns
  std::string summary;      ///< JSON: volumes, faces that turn over and that cross others, for the report
};

/// 1 for faces of the base with a vertex of the support: those that a pose may turn over or push through others.
std::vector<std::uint8_t> watched_faces(const DeformBasis& basis);

/// Where every handle is mirrored and nothing is held, the whole mesh is a mirror image: the reflection x -> -x is then
/// taken out of the pose, which turns surfaces as other poses do. It is left to be applied to what comes out, whose
/// faces are to be turned. \returns whether it was
/// \throws InputError  a handle mirrors a whole connected part of the mesh beside others that keep their side
bool take_out_mirror(const DeformBasis& basis, std::vector<Placement>& pose);

/// \param check_stop  called between its steps
/// \throws InputError  the volume shall be kept, but a handle changes its own
PosedBase pose_base(const DeformBasis& basis, std::span<const Placement> pose,
                    const std::function<void()>& check_stop);

/// Upper bound of what it allocates, beside the basis.
std::uint64_t pose_base_bytes(std::uint64_t vertices, std::uint64_t faces, bool volumes);

}  // namespace tessera
