#include "stream/stages/deform/pose_base.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "kernels/edit/base_volume.h"
#include "kernels/edit/self_intersections.h"
#include "kernels/edit/unflip_faces.h"
#include "kernels/mesh/face_components.h"
#include "octree/error.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;
using Face = std::array<std::uint32_t, 3>;

constexpr std::size_t kManyFlips = 100;  ///< one in so many faces of the base is worth a warning
constexpr double kSameVolume = 1e-9;     ///< of a handle's motion: determinants nearer to 1 keep volumes

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

/// The smooth base at rest and in a pose.
struct SmoothPose {
  std::vector<Double3> rest, posed;
};

/// A surface over the smooth base, and how many of its faces are flipped.
struct Detailed {
  std::vector<Double3> position;
  std::size_t flipped = 0;
};

/// \param active  per active vertex \return n
std::vector<Rotation> rotations_of_all(const EditBasis& edit, std::span<const Rotation> active) {
  std::vector<Rotation> all(edit.role.size(), Rotation{});
  for (std::size_t k = 0; k < active.size(); ++k) all[static_cast<std::size_t>(edit.active[k])] = active[k];
  return all;
}

/// Details that only move along: where nothing says how they turn, as on what has shrunk to a line.
std::vector<Double3> moved_along(const DeformBasis& basis, const SmoothPose& smooth) {
  std::vector<Double3> moved = smooth.posed;
  for (const std::int32_t active : basis.edit.active) {
    const auto v = static_cast<std::size_t>(active);
    moved[v] = smooth.posed[v] + (basis.base.position[v] - smooth.rest[v]);
  }
  return moved;
}

/// Details without rotations, around flipped faces, or everywhere where that leaves less than half of them.
Detailed with_fewer_flips(const RotatedBase& rotated, std::vector<Double3> moved, Detailed details) {
  const std::size_t without = flipped_faces(rotated, moved).size();
  if (2 * without < details.flipped) return {std::move(moved), without};
  details.flipped = yield_to(rotated, moved, details.flipped, details.position);
  return details;
}

/// Faces of the mesh itself are larger than those of a split base, and may turn over where none of these do. Their corners are
/// its first vertices.
UnflipReport lift_given(const RotatedBase& rotated, std::span<const Face> given,
                        std::vector<Double3>& position) {
  std::size_t count = 0;
  for (const Face& f : given)
    for (const std::uint32_t v : f) count = std::max<std::size_t>(count, v + 1);
  std::vector<Double3> own(position.begin(), position.begin() + static_cast<std::ptrdiff_t>(count));
  const UnflipReport report = lift_flipped(
      {rotated.rest.first(count), given, rotated.free.first(count), rotated.rotation.first(count)}, own);
  std::copy(own.begin(), own.end(), position.begin());
  return report;
}

/// Details that keep the volumes of their prisms. \param vectors  where displacement vectors lead
Detailed with_volumes(const DeformBasis& basis, const SmoothPose& smooth, const RotatedBase& rotated,
                      std::span<const Double3> vectors, std::span<const Double3> widening,
                      const std::function<void()>& check_stop, VolumeDetails& report) {
  const auto begun = Clock::now();
  Detailed out;
  out.position = displacement_volumes({{smooth.rest, rotated.rest},
                                       {smooth.posed, vectors},
                                       rotated.faces,
                                       rotated.free,
                                       rotated.rotation,
                                       widening},
                                      basis.levels, {}, report.volumes);
  report.seconds = since(begun);
  check_stop();
  out.flipped = unflip(rotated, out.position).left;
  return out;
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
  const std::vector<Double3>& at = basis.base.position;
  const std::vector<Face>& faces = basis.base.faces;
  PosedBase out;
  SmoothPose smooth;
  smooth.rest = rest_base(basis.edit, at);
  const auto start = Clock::now();
  smooth.posed = smooth_base(basis.edit, at, pose);
  out.basis_s = since(start);
  std::vector<Rotation> active = pose_rotations(basis.edit, pose);
  out.rotations_s = since(start) - out.basis_s;
  Detailed details{posed_base(basis.edit, at, active, smooth.rest, smooth.posed), 0};
  out.pose_s = since(start);
  check_stop();
  const std::vector<Rotation> rotation = rotations_of_all(basis.edit, active);
  active = {};
  const std::vector<std::uint8_t> free = support_flags(basis.edit.role), watched = watched_faces(basis);
  const RotatedBase rotated{at, faces, free, rotation};
  const UnflipReport flips = unflip(rotated, details.position);
  out.flipped_by_rotations = flips.before;
  details.flipped = flips.left;
  if (details.flipped > 0)
    details = with_fewer_flips(rotated, moved_along(basis, smooth), std::move(details));
  check_stop();
  std::optional<SelfIntersections> crossing;
  if (about.at("volumes").get<bool>()) {
    std::vector<Double3> widening;
    if (about.value("keep_volume", false)) {
      require_volume_kept(pose);
      widening = volume_widening(basis.edit, smooth.rest, smooth.posed, faces);
    }
    VolumeDetails& report = out.details.emplace();
    Detailed swollen = with_volumes(basis, smooth, rotated, details.position, widening, check_stop, report);
    if (swollen.flipped > details.flipped)
      swollen.flipped = yield_to(rotated, details.position, swollen.flipped, swollen.position);
    SelfIntersections by_vectors = self_intersections(details.position, faces, watched),
                      by_volumes = self_intersections(swollen.position, faces, watched);
    report.crossing_of_vectors = by_vectors.faces.size();
    report.crossing_of_volumes = by_volumes.faces.size();
    if (report.kept()) details = std::move(swollen);
    crossing = std::move(report.kept() ? by_volumes : by_vectors);
    check_stop();
  }
  if (const auto& given = basis.base.given_faces; !given.empty()) {
    const UnflipReport own = lift_given(rotated, given, details.position);
    out.flipped_given = own.left;
    // What is counted is what is written. Of turned faces that is own.left: those of the base are as it was solved.
    if (own.before > 0) crossing.reset();
  }
  if (!crossing) crossing = self_intersections(details.position, faces, watched);
  check_stop();
  out.flipped = details.flipped;
  out.position = std::move(details.position);
  out.crossing_before = about.at("crossing_faces").get<std::uint64_t>();
  out.crossing = crossing->faces.size();
  out.crossing_local = crossing->local;
  out.volume = enclosed_volume(out.position, faces);
  out.volume_before = enclosed_volume(at, faces);
  return out;
}

Json pose_json(const PosedBase& pose) {
  Json json = {{"base_flipped_by_turns", pose.flipped_by_rotations},
               {"base_flipped_faces", pose.flipped},
               {"base_crossing_faces_before", pose.crossing_before},
               {"base_crossing_faces", pose.crossing},
               {"base_crossing_local", pose.crossing_local},
               {"base_volume", pose.volume},
               {"base_volume_before", pose.volume_before},
               {"pose_basis_s", pose.basis_s},
               {"pose_turns_s", pose.rotations_s},
               {"pose_base_s", pose.pose_s}};
  if (pose.flipped_given) json["own_flipped_faces"] = *pose.flipped_given;
  if (const auto& d = pose.details)
    json["details"] = {{"prisms", d->volumes.prisms},
                       {"levels", d->volumes.levels},
                       {"volumes_off_before", d->volumes.off_before},
                       {"volumes_off", d->volumes.off_after},
                       {"seconds", d->seconds},
                       {"crossing_faces_of_vectors", d->crossing_of_vectors},
                       {"crossing_faces_of_volumes", d->crossing_of_volumes},
                       {"kept", d->kept() ? "volumes" : "vectors"}};
  return json;
}

std::vector<std::string> pose_warnings(const PosedBase& pose, std::size_t faces) {
  std::vector<std::string> warnings;
  if (pose.flipped * kManyFlips > faces)
    warnings.push_back(std::to_string(pose.flipped) + " of the " + std::to_string(faces) +
                       " faces of the base turn over: prepare with --base even, give the support more "
                       "room, or move less");
  if (pose.details && !pose.details->kept())
    warnings.push_back(
        "details are turned, their volumes not kept: with them more faces would cross others (" +
        std::to_string(pose.details->crossing_of_volumes) + " instead of " +
        std::to_string(pose.details->crossing_of_vectors) + "): try --base even");
  if (pose.crossing > pose.crossing_local && pose.crossing > pose.crossing_before)
    warnings.push_back(std::to_string(pose.crossing - pose.crossing_local) + " of the " +
                       std::to_string(faces) +
                       " faces of the base pass through what is far from them along the surface (" +
                       std::to_string(pose.crossing_local) +
                       " more through what is near): what moves is pressed into what stays, which no "
                       "details prevent; give the support more room, or move less");
  return warnings;
}

std::uint64_t pose_base_bytes(std::uint64_t vertices, std::uint64_t faces, bool volumes) {
  // Crossings are looked for when what turned faces back is gone.
  return vertices * (volumes ? 600 : 400) +
         std::max(unflip_bytes(vertices, faces) + (volumes ? displacement_volume_bytes(faces) : 0),
                  self_intersections_bytes(faces) + 48 * faces);
}

}  // namespace tessera
