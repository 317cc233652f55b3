#include "stream/formats/meshes/rounding_check.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/mesh/flat_faces.h"
#include "stream/files/durable_file.h"

namespace tessera {
namespace {

constexpr std::uint64_t kCheckStoreBytes = std::uint64_t{32} << 20, kSortBytes = std::uint64_t{16} << 20;

/// Of a position; zeros of both signs are one place.
std::uint64_t hash_of(Double3 p) {
  for (double& value : p) value += 0.0;
  return hash_bytes(p.data(), sizeof p);
}

}  // namespace

RoundingCheck::RoundingCheck(const std::filesystem::path& temp, std::function<Double3(const Double3&)> round)
    : round_(std::move(round)), positions_(temp, true, kCheckStoreBytes), hashes_(temp, kSortBytes) {}

void RoundingCheck::vertices(std::span<const Double3> positions) {
  positions_.append(positions);
  for (const Double3& p : positions)
    if (std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]))
      hashes_.add({hash_of(round_(p)), hash_of(p)});
}

void RoundingCheck::faces(std::span<const MeshFace> faces) {
  for (const MeshFace& f : faces) {
    const Double3 a = positions_.at(f[0]), b = positions_.at(f[1]), c = positions_.at(f[2]);
    if (face_extent(round_(a), round_(b), round_(c)).is_flat() && !face_extent(a, b, c).is_flat())
      ++flattened_;
  }
}

MeshRounding RoundingCheck::finish() {
  MeshRounding found;
  found.flattened_faces = flattened_;
  HashPair last;
  bool first = true;
  hashes_.drain([&](std::span<const HashPair> batch) {
    for (const HashPair& p : batch) {
      if (!first && p.rounded == last.rounded)
        ++(p.exact == last.exact ? found.joined_vertices : found.merged_vertices);
      last = p;
      first = false;
    }
  });
  return found;
}

std::uint64_t RoundingCheck::bytes(std::uint64_t vertices) {
  constexpr std::uint64_t kMin = std::uint64_t{2} << 20;  // a few chunks of the store, runs of the sort
  return kMin + std::min(kCheckStoreBytes, vertices * sizeof(Double3)) +
         std::min(kSortBytes, 2 * vertices * sizeof(HashPair));
}

}  // namespace tessera
