#include "stream/meshes/failed_regions.h"

#include <algorithm>
#include <type_traits>

#include "kernels/mesh/closest_face.h"
#include "stream/files/packed_file.h"

namespace tessera {
namespace {

static_assert(std::is_trivially_copyable_v<FailedFace> && sizeof(FailedFace) == 72,
              "kept as it lies in memory");

constexpr std::size_t kVerticesPerCheck = 256;
constexpr PackedKind kFailedKind = {"TSFAILD2", "a list of faces"};

MeshBox box_around(const FailedFace& face, double radius) {
  MeshBox box{face[0], face[0]};
  for (const Double3& p : face)
    for (std::size_t a = 0; a < 3; ++a) {
      box.low[a] = std::min(box.low[a], p[a]);
      box.high[a] = std::max(box.high[a], p[a]);
    }
  return grown(box, radius);
}

}  // namespace

std::uint64_t write_failed_faces(const std::filesystem::path& path, const std::vector<FailedFace>& faces) {
  return PackedWriter(path, kFailedKind, std::size_t{1} << 16).finish(faces);
}

std::vector<FailedFace> read_failed_faces(const std::filesystem::path& path) {
  return PackedFile(path, kFailedKind, sizeof(FailedFace)).table<FailedFace>();
}

void FailedRegions::add(std::vector<FailedFace> faces, double radius) {
  if (!faces.empty()) rounds_.push_back({std::move(faces), radius});
}

bool FailedRegions::meet(const MeshBox& box) const {
  for (const Round& round : rounds_)
    for (const FailedFace& face : round.faces)
      if (overlap(box_around(face, round.radius), box)) return true;
  return false;
}

std::vector<std::uint64_t> FailedRegions::keys_near(const MeshBlock& block,
                                                    const std::function<void()>& check_stop) const {
  std::vector<std::uint64_t> keys;
  if (block.position.empty()) return keys;
  MeshBox box{block.position[0], block.position[0]};
  for (const Double3& p : block.position)
    for (std::size_t a = 0; a < 3; ++a) {
      box.low[a] = std::min(box.low[a], p[a]);
      box.high[a] = std::max(box.high[a], p[a]);
    }
  for (const Round& round : rounds_) {
    std::vector<Double3> corners;
    std::vector<std::array<std::uint32_t, 3>> faces;
    for (const FailedFace& face : round.faces) {
      if (!overlap(box_around(face, round.radius), box)) continue;
      const auto first = static_cast<std::uint32_t>(corners.size());
      corners.insert(corners.end(), face.begin(), face.end());
      faces.push_back({first, first + 1, first + 2});
    }
    if (faces.empty()) continue;
    const ClosestFaces near(corners, faces, box.low);
    // Corners of the failed faces themselves must not be lost to rounding.
    const double radius = round.radius + 2.0 * closest_face_error(near.largest_coordinate());
    for (std::size_t v = 0; v < block.position.size(); ++v) {
      if (v % kVerticesPerCheck == 0) check_stop();
      Double3 p = block.position[v];
      for (std::size_t a = 0; a < 3; ++a) p[a] -= box.low[a];
      if (near.closest(p, radius * radius, ClosestFaces::kNone).slot != ClosestFaces::kNone)
        keys.push_back(block.key[v]);
    }
  }
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

std::uint64_t FailedRegions::bytes() const {
  std::uint64_t faces = 0;
  for (const Round& round : rounds_) faces += round.faces.size();
  return faces * (sizeof(FailedFace) + 3 * sizeof(Double3) + 12 + ClosestFaces::bytes_per_face());
}

}  // namespace tessera
