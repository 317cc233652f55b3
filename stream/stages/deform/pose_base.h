/// \file pose_base.h
/// The base surface in a pose, and what is told of it: the part of an edit that does not stream.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "kernels/edit/displacement_volumes.h"
#include "octree/placement.h"
#include "stream/files/json.h"
#include "stream/stages/deform/deform_files.h"

namespace tessera {

/// Details that were to keep their volumes.
struct VolumeDetails {
  DisplacementVolumeReport volumes;
  std::size_t crossing_of_vectors = 0, crossing_of_volumes = 0;  ///< faces that cross others
  double seconds = 0.0;
  /// Thin layers over jagged bases may come out worse than vectors leave them: then those stay.
  bool kept() const { return crossing_of_volumes <= crossing_of_vectors; }
};

struct PosedBase {
  std::vector<Double3> position;
  std::size_t flipped_by_rotations = 0;      ///< faces, before anything was done about them
  std::size_t flipped = 0;                   ///< faces that turn over against how the smooth base turns
  std::optional<std::size_t> flipped_given;  ///< of a split base: the same of the mesh's own faces
  std::size_t crossing_before = 0;           ///< faces that cross others, at rest
  std::size_t crossing = 0, crossing_local = 0;
  double volume = 0.0, volume_before = 0.0;
  std::optional<VolumeDetails> details;
  double basis_s = 0.0, rotations_s = 0.0, pose_s = 0.0;
};

/// For the report.
Json pose_json(const PosedBase& pose);
/// Sentences for who made the edit. \param faces  of the base
std::vector<std::string> pose_warnings(const PosedBase& pose, std::size_t faces);

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
