#include "kernels/extract/crease_faces.h"

#include <algorithm>
#include <cmath>

#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

/// What is nearer to a chain than this may lie on its other side once coordinates are rounded, in cells.
constexpr double kChainsApart = 1.0 / 2048;
constexpr std::size_t kMaxPoints = 16;
constexpr double kNoFlap = 1e30;

double square_from_link(const Double2& p, const Double2& a, const Double2& b) {
  const Double2 d = {b[0] - a[0], b[1] - a[1]}, from = {p[0] - a[0], p[1] - a[1]};
  const double length = d[0] * d[0] + d[1] * d[1];
  const double s = length > 0.0 ? std::clamp((from[0] * d[0] + from[1] * d[1]) / length, 0.0, 1.0) : 0.0;
  const double x = from[0] - s * d[0], y = from[1] - s * d[1];
  return x * x + y * y;
}

bool links_meet(const Double2& a, const Double2& b, const Double2& c, const Double2& d) {
  const int at_c = orient2d_sign(a, b, c), at_d = orient2d_sign(a, b, d);
  if (at_c == 0 && at_d == 0) return false;  // on one line: their ends are apart, or they are not
  return at_c * at_d <= 0 && orient2d_sign(c, d, a) * orient2d_sign(c, d, b) <= 0;
}

bool is_kink(const FaceChain& chain, std::size_t i) {
  return i > 0 && i + 1 < chain.size();
}

/// \param same  both are one chain
bool chains_apart(const FaceChain& one, const FaceChain& other, bool same) {
  for (std::size_t l = 0; l + 1 < other.size(); ++l) {
    const bool kinked = is_kink(other, l) || is_kink(other, l + 1);
    for (std::size_t i = 0; i < one.size(); ++i) {
      if (same && (i == l || i == l + 1)) continue;
      // Roots are where they are.
      if (!kinked && !is_kink(one, i)) continue;
      if (!(square_from_link(one[i], other[l], other[l + 1]) > kChainsApart * kChainsApart)) return false;
    }
    for (std::size_t i = 0; i + 1 < one.size(); ++i) {
      if (same && (i + 1 >= l && i <= l + 1)) continue;
      if (links_meet(one[i], one[i + 1], other[l], other[l + 1])) return false;
    }
  }
  return true;
}

}  // namespace

bool chains_are_sound(std::span<const FaceChain> chains) {
  for (std::size_t c = 0; c < chains.size(); ++c) {
    if (chains[c].size() > kMaxPoints || !chains_apart(chains[c], chains[c], true)) return false;
    for (std::size_t d = 0; d < chains.size(); ++d) {
      if (d == c) continue;
      const FaceChain straight = {chains[d].front(), chains[d].back()};
      if (!chains_apart(chains[c], chains[d], false) || !chains_apart(chains[c], straight, false))
        return false;
    }
  }
  return true;
}

bool triangulate_flap(const FaceChain& chain, std::vector<std::array<std::uint8_t, 3>>& triangles) {
  triangles.clear();
  const std::size_t size = chain.size();
  if (size < 3 || size > kMaxPoints) return false;
  double area = 0.0;
  for (std::size_t i = 1; i + 1 < size; ++i)
    area += (chain[i][0] - chain[0][0]) * (chain[i + 1][1] - chain[0][1]) -
            (chain[i][1] - chain[0][1]) * (chain[i + 1][0] - chain[0][0]);
  for (std::size_t i = 0; i + 1 < size; ++i) {
    if (is_kink(chain, i) &&
        !(square_from_link(chain[i], chain.front(), chain.back()) > kChainsApart * kChainsApart))
      return false;
    if (i > 0 && i + 2 < size && links_meet(chain[i], chain[i + 1], chain.front(), chain.back()))
      return false;
  }
  const int turn = area > 0.0 ? 1 : -1;
  // All triangles turn as the polygon does, so none lies over another; of those ways the one with the shortest chords.
  std::vector<double> cost(size * size, 0.0);
  std::vector<std::size_t> split(size * size, 0);
  const auto length = [&](std::size_t i, std::size_t j) {
    return std::sqrt(square_from_link(chain[i], chain[j], chain[j]));
  };
  const auto sound = [&](std::size_t i, std::size_t k, std::size_t j) {
    return orient2d_sign(chain[i], chain[k], chain[j]) == turn &&
           square_from_link(chain[i], chain[k], chain[j]) > kChainsApart * kChainsApart &&
           square_from_link(chain[k], chain[i], chain[j]) > kChainsApart * kChainsApart &&
           square_from_link(chain[j], chain[i], chain[k]) > kChainsApart * kChainsApart;
  };
  for (std::size_t span = 2; span < size; ++span)
    for (std::size_t i = 0; i + span < size; ++i) {
      const std::size_t j = i + span;
      double& best = cost[i * size + j];
      best = kNoFlap;
      for (std::size_t k = i + 1; k < j; ++k) {
        const double sum = cost[i * size + k] + cost[k * size + j] + length(i, j);
        if (!(sum < best) || !sound(i, k, j)) continue;
        best = sum;
        split[i * size + j] = k;
      }
    }
  if (!(cost[size - 1] < kNoFlap)) return false;
  std::vector<std::array<std::size_t, 2>> left = {{0, size - 1}};
  while (!left.empty()) {
    const auto [i, j] = left.back();
    left.pop_back();
    if (j - i < 2) continue;
    const std::size_t k = split[i * size + j];
    triangles.push_back(
        {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(k), static_cast<std::uint8_t>(j)});
    left.push_back({i, k});
    left.push_back({k, j});
  }
  return true;
}

}  // namespace tessera
