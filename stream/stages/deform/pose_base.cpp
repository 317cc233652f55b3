#include "stream/stages/deform/pose_base.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "kernels/edit/base_volume.h"
#include "kernels/edit/displacement_volumes.h"
#include "kernels/edit/self_intersections.h"
#include "kernels/edit/unflip_faces.h"
#include "kernels/mesh/face_components.h"
#include "octree/error.h"
#include "stream/files/json.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;
using Face = std::array<std::uint32_t, 3>;

constexpr double kSameVolume = 1e-9;  ///< of a handle's motion: determinants nearer to 1 keep volumes

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void require_volume_kept(std::span<const Placement> pose) {
  for (const Placement& p : pose)
    if (std::fabs(p.determinant() - 1.0) > kSameVolume)
      throw InputError(
          "\"keep_volume\" goes with handles that move and turn, but one of them changes volumes by a factor "
          "of " +
          dump_json(Json(p.determinant())) + ": leave it out");
}

}  // namespace

std::vector<std::uint8_t> watched_faces(const DeformBasis& basis) {
  std::vector<std::uint8_t> watched;
  watched.reserve(basis.base.faces.size());
  for (const Face& f : basis.base.faces)
    watched.push_back(std::any_of(f.begin(), f.end(),
                                  [&](std::uint32_t v) { return basis.edit.role[v] == kSupportVertex; }));
  return watched;
}

bool take_out_mirror(const DeformBasis& basis, std::vector<Placement>& pose) {
  const auto mirrored = [&](std::int32_t role) {
    return role >= 0 && pose[static_cast<std::size_t>(role)].determinant() < 0.0;
  };
  const FaceComponents parts = find_components(basis.base.position.size(), basis.base.faces);
  enum : std::uint8_t { kMirrored = 1, kKept = 2 };
  std::vector<std::uint8_t> seen(parts.faces.size(), 0);
  std::int32_t mirror = -1;
  for (std::size_t v = 0; v < basis.edit.role.size(); ++v) {
    const std::int32_t role = basis.edit.role[v];
    if (role == kSupportVertex || parts.faces[parts.of_vertex[v]] == 0) continue;
    seen[parts.of_vertex[v]] |= mirrored(role) ? kMirrored : kKept;
    if (mirrored(role)) mirror = role;
  }
  // A part that is mirrored at one end alone stays in one piece: its faces keep their side.
  const bool whole = std::find(seen.begin(), seen.end(), kMirrored) != seen.end();
  if (!whole) return false;
  if (std::any_of(seen.begin(), seen.end(), [](std::uint8_t s) { return (s & kKept) != 0; }))
    throw InputError(
        "the motion of '" +
        parse_json(basis.about).at("handles").at(static_cast<std::size_t>(mirror)).get<std::string>() +
        "' mirrors a whole part of the mesh, which would be inside out beside the others: deform "
        "that part by itself");
  for (Placement& p : pose) p = Placement{{-1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}}.after(p);
  return true;
}

PosedBase pose_base(const DeformBasis& basis, std::span<const Placement> pose,
                    const std::function<void()>& check_stop) {
  const Json about = parse_json(basis.about);
  Json summary;
  const std::vector<Double3>& at = basis.base.position;
  const std::vector<Face>& faces = basis.base.faces;
  const std::vector<Double3> rest = rest_base(basis.edit, at);
  const auto start = Clock::now();
  const std::vector<Double3> posed = smooth_base(basis.edit, at, pose);
  const double basis_s = since(start);
  const std::vector<Rotation> pose_rotation = pose_rotations(basis.edit, pose);
  const double rotations_s = since(start) - basis_s;
  PosedBase out;
  out.position = posed_base(basis.edit, at, pose_rotation, rest, posed);
  const double pose_s = since(start);
  check_stop();
  std::vector<Rotation> rotation(at.size(), Rotation{});
  for (std::size_t k = 0; k < pose_rotation.size(); ++k)
    rotation[static_cast<std::size_t>(basis.edit.active[k])] = pose_rotation[k];
  std::vector<std::uint8_t> free;
  for (const std::int32_t role : basis.edit.role) free.push_back(role == kSupportVertex);
  const RotatedBase rotated{at, faces, free, rotation};
  const UnflipReport flip_report = unflip(rotated, out.position);
  summary["base_flipped_by_turns"] = flip_report.before;
  out.flipped = flip_report.left;
  if (out.flipped > 0) {
    // Details that only move along: where nothing says how they turn, as on what has shrunk to a line.
    std::vector<Double3> moved = posed;
    for (const std::int32_t active : basis.edit.active) {
      const auto v = static_cast<std::size_t>(active);
      moved[v] = posed[v] + (at[v] - rest[v]);
    }
    const std::size_t without = flipped_faces(rotated, moved).size();
    if (2 * without < out.flipped) {
      out.position = std::move(moved);
      out.flipped = without;
    } else {
      out.flipped = yield_to(rotated, moved, out.flipped, out.position);
    }
  }
  check_stop();
  const std::vector<std::uint8_t> watched = watched_faces(basis);
  std::optional<SelfIntersections> crossing;
  if (about.at("volumes").get<bool>()) {
    const auto begun = Clock::now();
    std::vector<Double3> widening;
    if (about.value("keep_volume", false)) {
      require_volume_kept(pose);
      widening = volume_widening(basis.edit, rest, posed, faces);
    }
    DisplacementVolumeReport report;
    const std::vector<Double3> vectors = std::move(out.position);
    out.position = displacement_volumes({{rest, at}, {posed, vectors}, faces, free, rotation, widening},
                                        basis.levels, {}, report);
    summary["details"] = {{"prisms", report.prisms},
                          {"levels", report.levels},
                          {"volumes_off_before", report.off_before},
                          {"volumes_off", report.off_after},
                          {"seconds", since(begun)}};
    check_stop();
    std::size_t flipped = unflip(rotated, out.position).left;
    if (flipped > out.flipped) flipped = yield_to(rotated, vectors, flipped, out.position);
    // Thin layers over jagged bases may come out worse than vectors leave them.
    SelfIntersections by_vectors = self_intersections(vectors, faces, watched),
                      by_volumes = self_intersections(out.position, faces, watched);
    Json& details = summary["details"];
    details["crossing_faces_of_vectors"] = by_vectors.faces.size();
    details["crossing_faces_of_volumes"] = by_volumes.faces.size();
    const bool worse = by_volumes.faces.size() > by_vectors.faces.size();
    details["kept"] = worse ? "vectors" : "volumes";
    if (worse)
      out.position = vectors;
    else
      out.flipped = flipped;
    crossing = std::move(worse ? by_vectors : by_volumes);
    check_stop();
  }
  if (!crossing) crossing = self_intersections(out.position, faces, watched);
  check_stop();
  summary.update(Json{{"base_flipped_faces", out.flipped},
                      {"base_crossing_faces_before", about.at("crossing_faces").get<std::uint64_t>()},
                      {"base_crossing_faces", crossing->faces.size()},
                      {"base_crossing_local", crossing->local},
                      {"base_volume", enclosed_volume(out.position, faces)},
                      {"base_volume_before", enclosed_volume(at, faces)},
                      {"pose_basis_s", basis_s},
                      {"pose_turns_s", rotations_s},
                      {"pose_base_s", pose_s}});
  out.summary = dump_json(summary);
  return out;
}

std::uint64_t pose_base_bytes(std::uint64_t vertices, std::uint64_t faces, bool volumes) {
  return vertices * 600 + unflip_bytes(vertices, faces) +
         std::max(self_intersections_bytes(faces) + 48 * faces,
                  volumes ? displacement_volume_bytes(faces) : 0);
}

}  // namespace tessera
