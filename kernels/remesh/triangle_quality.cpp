#include "kernels/remesh/triangle_quality.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

double degrees_between(const Double3& a, const Double3& b) {
  return std::atan2(norm(cross(a, b)), dot(a, b)) * (180.0 / kPi);
}

std::uint64_t rounded(double value) {
  return static_cast<std::uint64_t>(std::fmin(std::fabs(value), 1e12) + 0.5);
}

}  // namespace

void TriangleQuality::add(const MeshBlock& block, double target) {
  const double full = std::sqrt(3.0) / 4.0 * target * target;
  std::vector<std::uint32_t> valence(block.position.size(), 0);
  std::vector<std::uint8_t> border(block.position.size(), 0);
  for (std::size_t i = 0; i < block.faces.size(); ++i) {
    const auto& f = block.faces[i];
    std::uint64_t least_here = 180000;
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 &a = block.position[f[k]], &b = block.position[f[(k + 1) % 3]],
                    &c = block.position[f[(k + 2) % 3]];
      const double degrees = degrees_between(b - a, c - a), length = norm(b - a) / target;
      ++angles[std::min(kAngleBins - 1, static_cast<std::size_t>(degrees))];
      angle_off += rounded((degrees - 60.0) * 1e3);
      least_here = std::min(least_here, rounded(degrees * 1e3));
      ++lengths[static_cast<std::size_t>(std::fmin(length * 50.0, kLengthBins - 1.0))];
      length_off += rounded((length - 1.0) * 1e6);
      ++valence[f[k]];
      if (block.face_flags[i] >> k & 1u) border[f[k]] = border[f[(k + 1) % 3]] = 1;
    }
    ++least[std::min<std::size_t>(kAngleBins - 1, least_here / 1000)];
    smallest = std::min(smallest, least_here);
    const double area =
        0.5 * norm(triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]));
    area_off += rounded((area / full - 1.0) * 1e6);
  }
  faces += block.faces.size();
  const std::vector<std::uint8_t> complete = complete_stars(block);
  for (std::size_t v = 0; v < valence.size(); ++v)
    if (complete[v] && !border[v]) ++valences[std::min<std::size_t>(kValenceBins - 1, valence[v])];
}

void TriangleQuality::merge(const TriangleQuality& o) {
  const auto sum = [](auto& to, const auto& from) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += from[i];
  };
  sum(angles, o.angles), sum(least, o.least), sum(lengths, o.lengths), sum(valences, o.valences);
  faces += o.faces, angle_off += o.angle_off, length_off += o.length_off, area_off += o.area_off;
  smallest = std::min(smallest, o.smallest);
}

}  // namespace tessera
