#include "stream/stages/deform/pose_base.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>

#include "kernels/edit/base_volume.h"
#include "kernels/edit/coarse_layer.h"
#include "kernels/edit/crossing_faces.h"
#include "kernels/edit/displacement_volumes.h"
#include "octree/error.h"

namespace tessera {
namespace {

using json = nlohmann::json;
using Clock = std::chrono::steady_clock;
using Face = std::array<std::uint32_t, 3>;

constexpr double kSameVolume = 1e-9;  ///< of a handle's motion: determinants nearer to 1 keep volumes

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

bool closed(std::span<const Face> faces) {
  std::vector<std::uint64_t> sides, opposite;
  for (const Face& f : faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t a = f[k], b = f[(k + 1) % 3];
      sides.push_back(a << 32 | b);
      opposite.push_back(b << 32 | a);
    }
  std::sort(sides.begin(), sides.end());
  std::sort(opposite.begin(), opposite.end());
  return sides == opposite;
}

void require_volume_kept(const DeformBasis& basis, std::span<const Placement> pose) {
  if (!closed(basis.base.faces))
    throw InputError(
        "\"keep_volume\" wants a closed surface, but the base has borders: leave it out, or close the mesh");
  for (const Placement& p : pose)
    if (std::fabs(p.determinant() - 1.0) > kSameVolume)
      throw InputError(
          "\"keep_volume\" goes with handles that move and turn, but one of them changes volumes by a factor "
          "of " +
          json(p.determinant()).dump() + ": leave it out");
}

std::size_t turned_over(std::span<const Double3> before, std::span<const Double3> after,
                        std::span<const std::array<double, 9>> turn, std::span<const Face> faces) {
  std::size_t count = 0;
  for (const Face& f : faces) {
    const Double3 was = triangle_normal(before[f[0]], before[f[1]], before[f[2]]);
    const Double3 is = triangle_normal(after[f[0]], after[f[1]], after[f[2]]);
    std::array<double, 9> r{};
    for (const std::uint32_t v : f)
      for (std::size_t k = 0; k < 9; ++k) r[k] += turn[v][k];
    const Double3 wish = {r[0] * was[0] + r[1] * was[1] + r[2] * was[2],
                          r[3] * was[0] + r[4] * was[1] + r[5] * was[2],
                          r[6] * was[0] + r[7] * was[1] + r[8] * was[2]};
    count += dot(wish, is) < 0.0;
  }
  return count;
}

}  // namespace

PosedBase pose_base(const DeformBasis& basis, std::span<const Placement> pose,
                    const std::function<void()>& check_stop) {
  const json about = json::parse(basis.about);
  json told;
  const std::vector<Double3>& at = basis.base.position;
  const std::vector<Face>& faces = basis.base.faces;
  const auto start = Clock::now();
  const std::vector<Double3> rest = rest_base(basis.edit, at), posed = smooth_base(basis.edit, at, pose);
  const double basis_s = since(start);
  const auto turn = turns(rest, posed, faces);
  PosedBase out;
  out.position = posed_base(basis.edit, at, turn, rest, posed);
  const double pose_s = since(start);
  check_stop();
  std::vector<std::uint8_t> free;
  for (const std::int32_t role : basis.edit.role) free.push_back(role == kSupportVertex);
  std::vector<std::uint8_t> watched;
  for (const Face& f : faces) watched.push_back(free[f[0]] || free[f[1]] || free[f[2]]);
  if (about.at("volumes").get<bool>()) {
    const auto begun = Clock::now();
    std::vector<Double3> widening;
    if (about.value("keep_volume", false)) {
      require_volume_kept(basis, pose);
      widening = volume_widening(basis.edit, rest, posed, faces);
    }
    DisplacementVolumeReport report;
    const std::vector<Double3> vectors = std::move(out.position);
    out.position = displacement_volumes({rest, at}, {posed, vectors}, faces, free, widening, {}, report);
    told["details"] = {{"prisms", report.prisms},
                       {"levels", report.levels},
                       {"volumes_off_before", report.off_before},
                       {"volumes_off", report.off_after},
                       {"seconds", since(begun)}};
    check_stop();
    // Thin layers over jagged bases may come out worse than vectors leave them.
    const std::size_t by_vectors = crossing_faces(vectors, faces, watched).faces.size(),
                      by_volumes = crossing_faces(out.position, faces, watched).faces.size();
    told["details"]["crossing_faces_of_vectors"] = by_vectors;
    told["details"]["crossing_faces_of_volumes"] = by_volumes;
    told["details"]["kept"] = by_volumes > by_vectors ? "vectors" : "volumes";
    if (by_volumes > by_vectors) out.position = vectors;
    check_stop();
  }
  out.flipped = turned_over(at, out.position, turn, faces);
  const CrossingFaces before = crossing_faces(at, faces, watched);
  check_stop();
  const CrossingFaces after = crossing_faces(out.position, faces, watched);
  check_stop();
  told.update(json{{"base_flipped_faces", out.flipped},
                   {"base_crossing_faces_before", before.faces.size()},
                   {"base_crossing_faces", after.faces.size()},
                   {"base_volume", enclosed_volume(out.position, faces)},
                   {"base_volume_before", enclosed_volume(at, faces)},
                   {"pose_basis_s", basis_s},
                   {"pose_base_s", pose_s}});
  out.told = told.dump();
  return out;
}

std::uint64_t pose_base_bytes(std::uint64_t vertices, std::uint64_t faces, bool volumes) {
  return vertices * 600 +
         std::max(crossing_faces_bytes(faces) + 48 * faces, volumes ? displacement_volume_bytes(faces) : 0);
}

}  // namespace tessera
