/// \file failed_regions.h
/// Where a certificate was missed. The next round of decimation leaves the reference as it is around these places,
/// so that a local failure costs a local repair and not the job.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "stream/meshes/mesh_store.h"

namespace tessera {

/// A face, of either mesh, some of which is not proven to be within the tolerance of the other.
using FailedFace = std::array<Double3, 3>;

/// More are not kept per round: what is left over fails again and is met in the next one.
inline constexpr std::size_t kMaxFailedFaces = std::size_t{1} << 14;

/// Returns bytes written.
std::uint64_t write_failed_faces(const std::filesystem::path& path, const std::vector<FailedFace>& faces);
/// \throws InputError when the file is damaged
std::vector<FailedFace> read_failed_faces(const std::filesystem::path& path);

/// Failed faces of several rounds, each with how far around them the reference stays.
class FailedRegions {
 public:
  /// \param radius  >= 0, scan units
  void add(std::vector<FailedFace> faces, double radius);
  bool empty() const { return rounds_.empty(); }
  /// Whether anything in the box is to stay.
  bool meet(const MeshBox& box) const;
  /// Keys of the vertices that are to stay, ascending. \param block  canonical
  std::vector<std::uint64_t> keys_near(const MeshBlock& block, const std::function<void()>& check_stop) const;
  /// What it holds and allocates for one block.
  std::uint64_t bytes() const;

 private:
  struct Round {
    std::vector<FailedFace> faces;
    double radius = 0.0;
  };
  std::vector<Round> rounds_;
};

}  // namespace tessera
