#include "kernels/points/volumetric_points.h"

#include <algorithm>

#include "octree/points.h"

namespace tessera {
namespace {

constexpr float kVoxelCells = 4.0f;
/// Of roofs, roads and rock, their edges too, next to all have less; of leaves next to none.
constexpr float kRough = 0.085f;
constexpr float kRoughEcho = 0.03f;  ///< of points beyond which their pulse went on
constexpr int kBrickVoxels = kBrickCells / static_cast<int>(kVoxelCells);
constexpr std::size_t kAround = 2;  ///< voxels on each side that tell what a point lies among
constexpr float kOwn = 4.0f;        ///< weight of the own voxel against one beside it

std::size_t voxel_of(const Float3& p) {
  std::size_t at = 0;
  for (std::size_t a = 3; a-- > 0;)
    at = at * kBrickVoxels +
         static_cast<std::size_t>(std::clamp(static_cast<int>(p[a] / kVoxelCells), 0, kBrickVoxels - 1));
  return at;
}

}  // namespace

std::vector<std::uint8_t> find_volumetric(const VolumetricInput& in) {
  struct Sum {
    float rough = 0.0f, points = 0.0f;
  };
  std::vector<Sum> sums(static_cast<std::size_t>(kBrickVoxels) * kBrickVoxels * kBrickVoxels);
  for (std::size_t i = 0; i < in.position.size(); ++i) {
    Sum& s = sums[voxel_of(in.position[i])];
    s.rough += in.roughness[i], s.points += 1.0f;
  }
  std::vector<std::uint8_t> out(in.position.size(), 0);
  constexpr std::ptrdiff_t kStep[3] = {1, kBrickVoxels, std::ptrdiff_t{kBrickVoxels} * kBrickVoxels};
  for (std::size_t i = 0; i < in.position.size(); ++i) {
    const float own = in.roughness[i];
    const std::uint16_t flags = in.flags.empty() ? std::uint16_t{0} : in.flags[i];
    if ((flags & kPointGround) != 0) continue;
    const bool echo = (flags & kPointNotLast) != 0;  // something solid lies beyond it
    if (own < (echo ? kRoughEcho : kRough)) continue;
    const std::size_t v = voxel_of(in.position[i]);
    float rough = kOwn * sums[v].rough, points = kOwn * sums[v].points;
    const std::size_t place[3] = {v % kBrickVoxels, v / kBrickVoxels % kBrickVoxels,
                                  v / (std::size_t{kBrickVoxels} * kBrickVoxels)};
    for (std::size_t a = 0; a < 3; ++a)
      for (const int side : {-1, 1}) {
        if (place[a] == (side < 0 ? 0u : kBrickVoxels - 1u)) continue;
        const Sum& s = sums[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(v) + side * kStep[a])];
        rough += s.rough, points += s.points;
      }
    out[i] = rough >= kRough * points || (echo && rough >= kRoughEcho * points) ? 1 : 0;
  }
  return out;
}

std::vector<std::uint8_t> find_among_volumetric(const VolumetricInput& in,
                                                std::span<const std::uint8_t> volumetric) {
  struct Sum {
    std::uint32_t strewn = 0, points = 0;
  };
  constexpr auto kEdge = static_cast<std::size_t>(kBrickVoxels);
  std::vector<Sum> sums(kEdge * kEdge * kEdge), wide(sums.size());
  for (std::size_t i = 0; i < in.position.size(); ++i) {
    Sum& s = sums[voxel_of(in.position[i])];
    ++s.points, s.strewn += volumetric[i];
  }
  for (std::size_t stride = 1; stride < sums.size(); stride *= kEdge) {
    for (std::size_t v = 0; v < sums.size(); ++v) {
      const std::size_t at = v / stride % kEdge;
      Sum& s = wide[v] = {};
      for (std::size_t k = at - std::min(at, kAround); k <= std::min(at + kAround, kEdge - 1); ++k) {
        const Sum& o = sums[v - at * stride + k * stride];
        s.strewn += o.strewn, s.points += o.points;
      }
    }
    sums.swap(wide);
  }
  std::vector<std::uint8_t> out(in.position.size(), 0);
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (volumetric[i] != 0 || (!in.flags.empty() && (in.flags[i] & kPointGround) != 0)) continue;
    const Sum& s = sums[voxel_of(in.position[i])];
    out[i] = 3 * std::uint64_t{s.strewn} > s.points ? 1 : 0;
  }
  return out;
}

}  // namespace tessera
