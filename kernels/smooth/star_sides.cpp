#include "kernels/smooth/star_sides.h"

#include <algorithm>

#include "octree/portable_math.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Normals that differ by more belong to different sides, degrees.
constexpr double kSideAngle = 30.0;
constexpr int kRounds = 3;

}  // namespace

void StarSides::find(const MeshBlock& block, std::span<const std::uint32_t> star,
                     std::span<const Float3> normals, std::span<const Double3> position) {
  static const double limit = cosine_of_degrees(kSideAngle);
  const std::size_t m = star.size();
  const auto at = [&](std::size_t i) { return wide(normals[star[i] >> 2]); };
  area_.resize(m);
  Double3 mean{};
  for (std::size_t i = 0; i < m; ++i) {
    const auto& face = block.faces[star[i] >> 2];
    area_[i] = norm(cross(position[face[1]] - position[face[0]], position[face[2]] - position[face[0]]));
    mean = mean + at(i) * area_[i];
  }
  count_ = 1;
  normal_[0] = unit_or_zero(mean);
  double minimum = limit;
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = i + 1; j < m; ++j)
      if (const double cosine = dot(at(i), at(j)); cosine < minimum) {
        minimum = cosine;
        count_ = 2;
        normal_[0] = at(i);
        normal_[1] = at(j);
      }
  if (count_ == 2) {
    double third = limit;
    for (std::size_t i = 0; i < m; ++i)
      if (const double cosine = std::max(dot(at(i), normal_[0]), dot(at(i), normal_[1])); cosine < third) {
        third = cosine;
        count_ = 3;
        normal_[2] = at(i);
      }
  }
  side_.assign(m, 0);
  for (int round = 0; round < kRounds && count_ > 1; ++round) {
    std::array<Double3, kMax> sum = {};
    for (std::size_t i = 0; i < m; ++i) {
      double best = -2.0;
      for (std::size_t k = 0; k < count_; ++k)
        if (const double cosine = dot(at(i), normal_[k]); cosine > best) {
          best = cosine;
          side_[i] = static_cast<std::uint8_t>(k);
        }
      sum[side_[i]] = sum[side_[i]] + at(i) * area_[i];
    }
    for (std::size_t k = 0; k < count_; ++k)
      if (norm(sum[k]) > 0.0) normal_[k] = unit_or_zero(sum[k]);
  }
  for (auto& faces : faces_) faces.clear();
  for (std::size_t i = 0; i < m; ++i) faces_[side_[i]].push_back(star[i] >> 2);
  // A side that lost all its faces to another is none.
  std::size_t kept = 0;
  for (std::size_t k = 0; k < count_; ++k) {
    if (faces_[k].empty()) continue;
    if (k != kept) {
      normal_[kept] = normal_[k];
      faces_[kept].swap(faces_[k]);
    }
    ++kept;
  }
  count_ = kept;
}

}  // namespace tessera
