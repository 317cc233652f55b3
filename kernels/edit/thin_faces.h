/// \file thin_faces.h
/// How much of a surface lies in long thin faces: they make a bad base, whose cotangents are nearly singular, and slivers turn
/// over at the least bend (thesis 7.1).
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "octree/vector.h"

namespace tessera {

/// Faces are thin whose height is less than this share of their longest side.
inline constexpr double kThinFace = 0.1;

class ThinArea {
 public:
  void add(std::span<const Double3> position, std::span<const std::array<std::uint32_t, 3>> faces) {
    for (const auto& f : faces) {
      const Double3 &a = position[f[0]], &b = position[f[1]], &c = position[f[2]];
      const double twice = norm(triangle_normal(a, b, c));
      const double longest =
          std::max({squared_distance(a, b), squared_distance(b, c), squared_distance(c, a)});
      all_ += twice;
      if (twice < kThinFace * longest) thin_ += twice;
    }
  }
  /// Of the area of all faces added.
  double share() const { return all_ > 0.0 ? thin_ / all_ : 0.0; }

 private:
  double thin_ = 0.0, all_ = 0.0;
};

}  // namespace tessera
