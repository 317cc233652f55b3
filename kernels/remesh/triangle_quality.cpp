#include "kernels/remesh/triangle_quality.h"

#include <algorithm>
#include <cmath>
#include <limits>
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

/// The parts of a triangle that are nearest to its corners; where it is obtuse half of it is the obtuse corner's, and
/// the others get a quarter each.
std::array<double, 3> mixed_cells(const Double3& a, const Double3& b, const Double3& c) {
  const Double3 sides[3] = {c - b, a - c, b - a};  // across from the corners
  const double twice = norm(cross(sides[2], sides[0]));
  if (!(twice > 0.0)) return {};
  double square[3], cotangent[3];
  for (std::size_t i = 0; i < 3; ++i) {
    square[i] = dot(sides[i], sides[i]);
    cotangent[i] = -dot(sides[(i + 1) % 3], sides[(i + 2) % 3]) / twice;
  }
  std::array<double, 3> cell{};
  const auto obtuse = std::find_if(cotangent, cotangent + 3, [](double k) { return k < 0.0; });
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    cell[i] = obtuse != cotangent + 3 ? twice * (cotangent[i] < 0.0 ? 0.25 : 0.125)
                                      : 0.125 * (square[j] * cotangent[j] + square[k] * cotangent[k]);
  }
  return cell;
}

}  // namespace

void TriangleQuality::add(const MeshBlock& block, double target) {
  const double full = std::sqrt(3.0) / 4.0 * target * target;
  std::vector<std::uint32_t> valence(block.position.size(), 0);
  std::vector<double> cell(block.position.size(), 0.0);
  std::vector<std::uint8_t> border(block.position.size(), 0);
  for (std::size_t i = 0; i < block.faces.size(); ++i) {
    const auto& f = block.faces[i];
    std::uint64_t min_here = 180000;
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 &a = block.position[f[k]], &b = block.position[f[(k + 1) % 3]],
                    &c = block.position[f[(k + 2) % 3]];
      const double degrees = degrees_between(b - a, c - a), length = norm(b - a) / target;
      ++angles[std::min(kAngleBins - 1, static_cast<std::size_t>(degrees))];
      angle_off += rounded((degrees - 60.0) * 1e3);
      min_here = std::min(min_here, rounded(degrees * 1e3));
      ++lengths[static_cast<std::size_t>(std::fmin(length * 50.0, kLengthBins - 1.0))];
      length_off += rounded((length - 1.0) * 1e6);
      ++valence[f[k]];
      if (block.face_flags[i] >> k & 1u) border[f[k]] = border[f[(k + 1) % 3]] = 1;
    }
    ++minimum[std::min<std::size_t>(kAngleBins - 1, min_here / 1000)];
    smallest = std::min(smallest, min_here);
    const std::array<double, 3> parts =
        mixed_cells(block.position[f[0]], block.position[f[1]], block.position[f[2]]);
    for (std::size_t k = 0; k < 3; ++k) cell[f[k]] += parts[k];
    const double area =
        0.5 * norm(triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]));
    area_off += rounded((area / full - 1.0) * 1e6);
  }
  faces += block.faces.size();
  const std::vector<std::uint8_t> complete = complete_stars(block);
  for (std::size_t v = 0; v < valence.size(); ++v) {
    if (!complete[v] || border[v]) continue;
    ++valences[std::min<std::size_t>(kValenceBins - 1, valence[v])];
    const double share = cell[v] / (2.0 * full);
    const auto bin = static_cast<std::size_t>(std::fmin(share * 100.0, kCellBins - 1.0));
    ++cells[bin];
    cell_sums[bin] += rounded(share * 1e6);
  }
  const std::vector<double> mean = mean_edges(block);
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const double ratio = length_ratio(mean[block.faces[f][k]], mean[block.faces[f][(k + 1) % 3]]);
      if (ratio == 0.0) continue;
      const auto bin = static_cast<std::size_t>(std::fmin((ratio - 1.0) * 20.0, kRatioBins - 1.0));
      ratios[bin] += block.face_flags[f] >> k & 1u ? 2 : 1;
      largest_ratio = std::max(largest_ratio, rounded(ratio * 1e6));
    }
}

std::vector<double> mean_edges(const MeshBlock& block) {
  std::vector<double> sum(block.position.size(), 0.0);
  std::vector<std::uint32_t> sides(block.position.size(), 0);
  // Inner edges come twice, so those of borders count twice.
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = block.faces[f][k], b = block.faces[f][(k + 1) % 3];
      const std::uint32_t times = block.face_flags[f] >> k & 1u ? 2 : 1;
      const double length = times * norm(block.position[b] - block.position[a]);
      sum[a] += length, sum[b] += length;
      sides[a] += times, sides[b] += times;
    }
  const std::vector<std::uint8_t> complete = complete_stars(block);
  for (std::size_t v = 0; v < sum.size(); ++v) sum[v] = complete[v] && sides[v] > 0 ? sum[v] / sides[v] : 0.0;
  return sum;
}

UnevenEdges find_uneven(const MeshBlock& block, double max_ratio) {
  UnevenEdges found;
  found.at_face.assign(block.faces.size(), 0);
  const std::vector<double> mean = mean_edges(block);
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const double ratio = length_ratio(mean[block.faces[f][k]], mean[block.faces[f][(k + 1) % 3]]);
      if (ratio == 0.0) continue;
      const std::uint64_t sides = block.face_flags[f] >> k & 1u ? 2 : 1;
      found.edges += sides;
      if (!(ratio > max_ratio)) continue;
      found.uneven += sides;
      found.at_face[f] = 1;
    }
  found.edges /= 2, found.uneven /= 2;
  return found;
}

SharpFaces count_sharp(const MeshBlock& block, double min_angle_deg) {
  const double cosine = cosine_of_degrees(min_angle_deg);
  // Across from the corners.
  constexpr unsigned kLine[3] = {kFaceBorder12 * 33u, kFaceBorder20 * 33u, kFaceBorder01 * 33u};
  SharpFaces found;
  for (std::size_t f = 0; f < block.faces.size(); ++f) {
    const Double3* at[3];
    for (std::size_t i = 0; i < 3; ++i) at[i] = &block.position[block.faces[f][i]];
    if (sharpness(*at[0], *at[1], *at[2]) <= cosine * cosine) continue;
    ++found.faces;
    std::size_t smallest = 0;
    double minimum = std::numeric_limits<double>::max();
    for (std::size_t i = 0; i < 3; ++i) {
      const double square = squared_distance(*at[(i + 1) % 3], *at[(i + 2) % 3]);
      if (square < minimum) minimum = square, smallest = i;
    }
    const auto is_line = [&](std::size_t i) { return (block.face_flags[f] & kLine[i % 3]) != 0; };
    found.between_lines += is_line(smallest + 1) && is_line(smallest + 2);
  }
  return found;
}

void TriangleQuality::merge(const TriangleQuality& o) {
  const auto sum = [](auto& to, const auto& from) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += from[i];
  };
  sum(angles, o.angles), sum(minimum, o.minimum), sum(lengths, o.lengths), sum(valences, o.valences);
  sum(cells, o.cells), sum(cell_sums, o.cell_sums), sum(ratios, o.ratios);
  faces += o.faces, angle_off += o.angle_off, length_off += o.length_off, area_off += o.area_off;
  smallest = std::min(smallest, o.smallest);
  largest_ratio = std::max(largest_ratio, o.largest_ratio);
}

/// Bins lie on one side of the mean, but for the one that holds it: that one counts as if all of it lay at its own mean.
double TriangleQuality::mean_cell_deviation() const {
  std::uint64_t vertices = 0, sum = 0;
  for (std::size_t i = 0; i < kCellBins; ++i) vertices += cells[i], sum += cell_sums[i];
  if (sum == 0) return 0.0;
  const double mean = static_cast<double>(sum) / static_cast<double>(vertices);
  double off = 0.0;
  for (std::size_t i = 0; i < kCellBins; ++i)
    off += std::fabs(static_cast<double>(cell_sums[i]) - mean * static_cast<double>(cells[i]));
  return off / static_cast<double>(sum);
}

}  // namespace tessera
