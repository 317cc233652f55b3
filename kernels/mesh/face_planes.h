/// \file face_planes.h
/// A filter before face_contact.h: which of up to eight faces surely do not meet another one, because all of its corners lie on
/// one side of their planes. Most pairs whose boxes meet are told apart so.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <immintrin.h>

#include "kernels/mesh/face_contact.h"

namespace tessera {

/// Planes of faces side by side. Signs are certain: a bound on the rounding of each is kept below.
class FacePlanes {
 public:
  static constexpr std::size_t kLanes = 8;

  [[nodiscard]] std::size_t size() const { return size_; }
  void clear() { size_ = 0; }
  /// \pre size() < kLanes
  void add(const ContactFace& f) {
    const std::size_t l = size_++;
    const Double3 u = f.corner[1] - f.corner[0], v = f.corner[2] - f.corner[0];
    double terms = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t m = (k + 1) % 3, n = (k + 2) % 3;
      const double left = u[m] * v[n], right = u[n] * v[m];
      corner_[k][l] = f.corner[0][k];
      normal_[k][l] = left - right;
      terms += std::fabs(left) + std::fabs(right);
      vertex_[k][l] = static_cast<std::int64_t>(f.vertex[k]);
    }
    doubt_[l] = terms * kRounding;
  }

  /// A bit for each face that surely meets this one in shared edges and corners alone: those of its corners that they do not
  /// share, at least one, lie on one side of the face's plane.
  [[nodiscard]] unsigned apart(const ContactFace& f) const {
    unsigned above = 0xff, below = 0xff, all_shared = 0xff;
    for (std::size_t k = 0; k < 3; ++k) {
      unsigned up = 0, down = 0, shared = 0;
      for (std::size_t half = 0; half < 2; ++half) {
        const Sides s = sides(4 * half, f.corner[k], f.vertex[k]);
        up |= s.up << 4 * half, down |= s.down << 4 * half, shared |= s.shared << 4 * half;
      }
      above &= up | shared, below &= down | shared, all_shared &= shared;
    }
    return (above | below) & ~all_shared & ((1u << size_) - 1u);
  }

 private:
  struct Sides {
    unsigned up, down, shared;  ///< a bit for each of four planes
  };
  Sides sides(std::size_t first, const Double3& p, std::uint64_t vertex) const {
    const __m256d sign_bit = _mm256_set1_pd(-0.0);
    __m256d height = _mm256_setzero_pd(), far = height;
    __m256i shared = _mm256_setzero_si256();
    const __m256i name = _mm256_set1_epi64x(static_cast<std::int64_t>(vertex));
    for (std::size_t k = 0; k < 3; ++k) {
      const __m256d d = _mm256_sub_pd(_mm256_set1_pd(p[k]), _mm256_load_pd(&corner_[k][first]));
      height = _mm256_add_pd(height, _mm256_mul_pd(_mm256_load_pd(&normal_[k][first]), d));
      far = _mm256_add_pd(far, _mm256_andnot_pd(sign_bit, d));
      const __m256i own = _mm256_load_si256(reinterpret_cast<const __m256i*>(&vertex_[k][first]));
      shared = _mm256_or_si256(shared, _mm256_cmpeq_epi64(own, name));
    }
    const __m256d doubt = _mm256_mul_pd(_mm256_load_pd(&doubt_[first]), far);
    const auto bits = [](__m256d mask) { return static_cast<unsigned>(_mm256_movemask_pd(mask)); };
    return {bits(_mm256_cmp_pd(height, doubt, _CMP_GT_OQ)),
            bits(_mm256_cmp_pd(_mm256_xor_pd(height, sign_bit), doubt, _CMP_GT_OQ)),
            bits(_mm256_castsi256_pd(shared))};
  }

  /// Of the terms of the normal times the distance along the axes: each of both is off by a few units in the last place.
  static constexpr double kRounding = 0x1p-49;

  std::size_t size_ = 0;
  alignas(32) std::array<std::array<double, kLanes>, 3> corner_{}, normal_{};
  alignas(32) std::array<double, kLanes> doubt_{};
  alignas(32) std::array<std::array<std::int64_t, kLanes>, 3> vertex_{};
};

}  // namespace tessera
