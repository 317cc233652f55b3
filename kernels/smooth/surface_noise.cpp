#include "kernels/smooth/surface_noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/smooth/normal_filter.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Window of what a quadric leaves: the noise from one vertex to the next.
constexpr double kResidualWindow = 1.2 * kSmallestWindow;
constexpr double kMedianOfChiSquare = 0.4549;
constexpr double kNoiseClasses = 8.0;  ///< to a factor of two
constexpr int kZero = std::numeric_limits<int>::min();
/// Normals only tell which faces belong to a window, so half of the rounds of a denoising do.
constexpr int kNormalRounds = 4;

int class_of(double square) {
  int exponent = 0;
  const double mantissa = std::frexp(square, &exponent);
  if (!(mantissa > 0.0)) return kZero;
  return exponent * static_cast<int>(kNoiseClasses) +
         static_cast<int>((mantissa - 0.5) * (2.0 * kNoiseClasses));
}

double middle_of(int number) {
  if (number == kZero) return 0.0;
  const int exponent = static_cast<int>(std::floor(number / kNoiseClasses));
  const double step = number - exponent * kNoiseClasses;
  return std::ldexp(0.5 + (step + 0.5) / (2.0 * kNoiseClasses), exponent);
}

/// The square that more than so many quarters do not exceed, of a median the upper one of two; -1 of none.
double class_at(const std::map<int, std::uint64_t>& counts, std::uint64_t quarters) {
  std::uint64_t all = 0, below = 0;
  for (const auto& [number, count] : counts) all += count;
  for (const auto& [number, count] : counts) {
    below += count;
    if (4 * below > quarters * all) return middle_of(number);
  }
  return -1.0;
}

/// Mean length of the edges at a vertex whose star is closed; 0 at a border and without faces.
double edge_at(const MeshBlock& block, std::span<const std::uint32_t> star, std::uint32_t v) {
  double sum = 0.0;
  for (const std::uint32_t corner : star) {
    const auto& face = block.faces[corner >> 2];
    const std::uint32_t k = corner & 3;
    const unsigned flags = block.face_flags[corner >> 2];
    constexpr unsigned kAt[3] = {kFaceBorder01 | kFaceBorder20, kFaceBorder01 | kFaceBorder12,
                                 kFaceBorder12 | kFaceBorder20};
    if ((flags & kAt[k]) != 0) return 0.0;
    sum += norm(block.position[face[(k + 1) % 3]] - block.position[v]);
  }
  return star.empty() ? 0.0 : sum / static_cast<double>(star.size());
}

/// Flags of the faces whose normals the windows of wanted vertices may read: their vertices are in one box.
std::vector<std::uint8_t> faces_read(const MeshBlock& block, const FaceCorners& corners,
                                     std::span<const std::uint8_t> wanted) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Double3 low = {kFar, kFar, kFar}, high = {-kFar, -kFar, -kFar};
  for (std::uint32_t v = 0; v < block.position.size(); ++v) {
    if (wanted[v] == 0) continue;
    const double radius = kNoiseWindow * edge_at(block, corners.at(v), v);
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], block.position[v][k] - radius);
      high[k] = std::max(high[k], block.position[v][k] + radius);
    }
  }
  std::vector<std::uint8_t> read(block.faces.size(), 0);
  for (std::size_t f = 0; f < read.size(); ++f)
    for (const std::uint32_t v : block.faces[f]) {
      const Double3& p = block.position[v];
      bool inside = true;
      for (std::size_t k = 0; k < 3; ++k) inside = inside && p[k] >= low[k] && p[k] <= high[k];
      read[f] |= static_cast<std::uint8_t>(inside);
    }
  return read;
}

}  // namespace

NoiseSquares noise_squares(SurfaceWindow& window, std::uint32_t vertex, const StarSides& sides, double edge) {
  NoiseSquares out;
  window.begin(vertex, sides.normal(0), sides.faces(0));
  window.grow(kNoiseWindow * edge);
  if (const auto fit = fit_window(window.samples(), kResidualWindow * edge, 6))
    out.residual = fit->residual_square;
  out.between = noise_square_between(window.samples(), kSmallestWindow * edge, kNoiseWindow * edge);
  return out;
}

double noise_variance(double median_residual, double median_between) {
  return std::max({0.0, median_residual, median_between / kMedianOfChiSquare});
}

void NoiseCounts::add(const NoiseSquares& squares) {
  if (squares.residual >= 0.0) ++residual[class_of(squares.residual)];
  if (squares.between >= 0.0) ++between[class_of(squares.between)];
  vertices += squares.residual >= 0.0 || squares.between >= 0.0;
}

void NoiseCounts::add(const NoiseCounts& more) {
  for (const auto& [number, count] : more.residual) residual[number] += count;
  for (const auto& [number, count] : more.between) between[number] += count;
  vertices += more.vertices;
}

double NoiseCounts::noise() const {
  return std::sqrt(noise_variance(class_at(residual, 2), class_at(between, 2)));
}

bool NoiseCounts::surely_below(double noise) const {
  return vertices > 0 && noise_variance(class_at(residual, 3), class_at(between, 3)) < noise * noise;
}

NoiseCounts count_noise(const MeshBlock& block, const FaceCorners& corners,
                        std::span<const std::uint8_t> wanted) {
  NormalFilterOptions filter;
  filter.normal_rounds = kNormalRounds;
  const std::vector<Float3> normals =
      filter_normals(block, corners, filter, faces_read(block, corners, wanted));
  SurfaceWindow window(block, corners, normals, block.position, block.position);
  StarSides sides;
  NoiseCounts counts;
  for (std::uint32_t v = 0; v < block.position.size(); ++v) {
    if (wanted[v] == 0) continue;
    const double edge = edge_at(block, corners.at(v), v);
    if (!(edge > 0.0)) continue;
    sides.find(block, corners.at(v), normals, block.position);
    if (sides.count() == 1) counts.add(noise_squares(window, v, sides, edge));
  }
  return counts;
}

}  // namespace tessera
