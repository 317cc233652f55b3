/// \file mesh_precision.h
/// Formats of 32-bit floats (STL, GLB, 3MF) hold a mesh far from zero as offsets from a local origin, and what their rounding
/// still moves is a number that proofs can add to their bounds.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "octree/lattice.h"
#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

/// How the positions of a mesh lie in its file.
struct MeshPlacement {
  Double3 origin = {0, 0, 0};  ///< subtracted from all positions before they are rounded
  /// No position moves farther than this when it is written and read back; 0: the file holds them as they are.
  double rounding = 0.0;
};

/// Whether the format of `path`, by its extension, has floats alone: .stl, .glb, .3mf.
bool holds_floats_only(const std::filesystem::path& path);

/// \param double_positions  positions need more than floats; of others nothing is rounded
/// \param low,high  box of all positions \param fine  rounding up to here is no matter: STL and 3MF, whose origin other
///   programs do not know, then get none. GLB gets one wherever that makes positions at least four times as precise.
/// \returns an origin of few decimal digits, {0, 0, 0} where it would not help
MeshPlacement place_mesh(const std::filesystem::path& path, bool double_positions, const Double3& low,
                         const Double3& high, double fine);

/// A thousandth of the mean edge that so many faces can be expected to have in this box, and no more than a hundredth of
/// the tolerance (0: none): for place_mesh.
double fine_rounding(std::uint64_t faces, const Double3& low, const Double3& high, double tolerance);

/// How far a position in the box moves at most when its offset from the origin is rounded to 32-bit floats.
double float_rounding(const Double3& origin, const Double3& low, const Double3& high);

/// What a job with a tolerance may use of it, so that the tolerance holds for the bytes that are written.
/// \param placement  with `rounding` for all that may be written
/// \throws ValidationError  where rounding takes more than half of it, with the reason and the way out
double tolerance_before_rounding(const std::filesystem::path& output, double tolerance,
                                 const MeshPlacement& placement);

/// What rounding or the format broke, a sentence each; empty as a rule.
std::vector<std::string> rounding_notices(const MeshRounding& rounding);

/// "OUT.stl.shift" for "OUT.stl", empty for other formats: where the origin of an STL stands for other programs.
std::filesystem::path stl_shift_path(const std::filesystem::path& output);
/// What 3MF makes other programs believe, a sentence each; empty for other formats. \param unit  metres; 0 = not known
std::vector<std::string> threemf_notices(const std::filesystem::path& output, const Double3& origin,
                                         double unit);
/// Its content: x y z in one line.
std::string stl_shift_text(const Double3& origin);
/// For people: what is to be added to the coordinates in the file, and where that stands.
std::string stl_shift_notice(const std::filesystem::path& output, const Double3& origin);

}  // namespace tessera
