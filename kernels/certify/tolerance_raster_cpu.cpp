// Lanes are triangles: eight take their k-th sample at once, so maxima need no horizontal step.
#include <immintrin.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>

#include "kernels/certify/tolerance_raster.h"
#include "octree/rounding.h"

namespace tessera {
namespace {

/// Two neighbours in x at eight places, in one gather where both fit 32 bits.
template <TexturePrecision precision>
inline void gather_pair(const std::uint8_t* texels, __m256i index, __m256& left, __m256& right) {
  if constexpr (precision == TexturePrecision::kFloat) {
    const auto* values = reinterpret_cast<const float*>(texels);
    left = _mm256_i32gather_ps(values, index, 4);
    right = _mm256_i32gather_ps(values + 1, index, 4);
  } else if constexpr (precision == TexturePrecision::kHalf) {
    const __m256i both = _mm256_i32gather_epi32(reinterpret_cast<const int*>(texels), index, 2);
    const __m256 scale = _mm256_set1_ps(0x1p112f);
    left = _mm256_mul_ps(_mm256_castsi256_ps(_mm256_srli_epi32(_mm256_slli_epi32(both, 16), 3)), scale);
    right = _mm256_mul_ps(_mm256_castsi256_ps(_mm256_slli_epi32(_mm256_srli_epi32(both, 16), 13)), scale);
  } else {
    const __m256i both = _mm256_i32gather_epi32(reinterpret_cast<const int*>(texels), index, 1);
    const __m256i mask = _mm256_set1_epi32(0xff);
    left = _mm256_cvtepi32_ps(_mm256_and_si256(both, mask));
    right = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(both, 8), mask));
  }
}

template <TexturePrecision precision>
class CpuRaster final : public ToleranceRaster {
 public:
  explicit CpuRaster(const ToleranceVolume& volume)
      : texels_(field_texels(volume, precision)), nodes_(volume.nodes()), description_("vectorised CPU") {}

  void largest(const GridTriangles& triangles, int per_side, std::span<float> out) override {
    assert(out.size() == triangles.size() && per_side >= 1);
    std::size_t i = 0;
    for (; i + 8 <= out.size(); i += 8) {
      const float* column[9];
      for (std::size_t c = 0; c < 9; ++c) column[c] = triangles.column[c].data() + i;
      _mm256_storeu_ps(out.data() + i, eight(column, per_side));
    }
    if (i == out.size()) return;
    float tail[9][8] = {};
    const float* column[9];
    for (std::size_t c = 0; c < 9; ++c) {
      std::copy(triangles.column[c].begin() + static_cast<std::ptrdiff_t>(i), triangles.column[c].end(),
                tail[c]);
      column[c] = tail[c];
    }
    float result[8];
    _mm256_storeu_ps(result, eight(column, per_side));
    std::copy_n(result, out.size() - i, out.begin() + static_cast<std::ptrdiff_t>(i));
  }
  const std::string& description() const override { return description_; }
  bool hardware_filter() const override { return false; }
  std::uint64_t bytes() const override { return texels_.bytes.size() - 4; }

 private:
  __m256 eight(const float* const* column, int per_side) const {
    __m256 a[3], u[3], v[3];
    for (std::size_t k = 0; k < 3; ++k) {
      a[k] = _mm256_loadu_ps(column[k]);
      u[k] = _mm256_sub_ps(_mm256_loadu_ps(column[3 + k]), a[k]);
      v[k] = _mm256_sub_ps(_mm256_loadu_ps(column[6 + k]), a[k]);
    }
    __m256 best = _mm256_setzero_ps();
    const float step = 1.0f / static_cast<float>(per_side);
    for (int j = 0; j < per_side; ++j) {
      const __m256 t = _mm256_set1_ps((static_cast<float>(j) + kSampleOffset) * step);
      __m256 row[3];
      for (std::size_t k = 0; k < 3; ++k) row[k] = _mm256_fmadd_ps(t, v[k], a[k]);
      for (int i = 0; i + j < per_side; ++i) {
        const __m256 s = _mm256_set1_ps((static_cast<float>(i) + kSampleOffset) * step);
        best = _mm256_max_ps(best, sample(_mm256_fmadd_ps(s, u[0], row[0]), _mm256_fmadd_ps(s, u[1], row[1]),
                                          _mm256_fmadd_ps(s, u[2], row[2])));
      }
    }
    return _mm256_mul_ps(best, _mm256_set1_ps(texels_.scale));
  }

  /// Cell and place in it along one axis, clamped to the grid.
  static void locate(__m256 p, int nodes, __m256i& cell, __m256& t) {
    const __m256i last = _mm256_set1_epi32(nodes - 2);
    cell = _mm256_min_epi32(_mm256_max_epi32(_mm256_cvttps_epi32(p), _mm256_setzero_si256()), last);
    t = _mm256_sub_ps(p, _mm256_cvtepi32_ps(cell));
    t = _mm256_min_ps(_mm256_max_ps(t, _mm256_setzero_ps()), _mm256_set1_ps(1.0f));
  }

  __m256 sample(__m256 x, __m256 y, __m256 z) const {
    __m256i i, j, k;
    __m256 tx, ty, tz;
    locate(x, nodes_[0], i, tx);
    locate(y, nodes_[1], j, ty);
    locate(z, nodes_[2], k, tz);
    const __m256i row = _mm256_set1_epi32(nodes_[0]), slice = _mm256_set1_epi32(nodes_[0] * nodes_[1]);
    const __m256i base =
        _mm256_add_epi32(i, _mm256_add_epi32(_mm256_mullo_epi32(j, row), _mm256_mullo_epi32(k, slice)));
    const auto along = [](__m256 a, __m256 b, __m256 t) {
      return _mm256_fmadd_ps(t, _mm256_sub_ps(b, a), a);
    };
    const auto pair = [&](__m256i index) {
      __m256 left, right;
      gather_pair<precision>(texels_.bytes.data(), index, left, right);
      return along(left, right, tx);
    };
    const __m256i above = _mm256_add_epi32(base, slice);
    const __m256 lower = along(pair(base), pair(_mm256_add_epi32(base, row)), ty);
    const __m256 upper = along(pair(above), pair(_mm256_add_epi32(above, row)), ty);
    return along(lower, upper, tz);
  }

  FieldTexels texels_;
  Int3 nodes_;
  std::string description_;
};

}  // namespace

void GridTriangles::add(const Float3& a, const Float3& b, const Float3& c) {
  for (std::size_t k = 0; k < 3; ++k) {
    column[k].push_back(a[k]);
    column[3 + k].push_back(b[k]);
    column[6 + k].push_back(c[k]);
  }
}

void GridTriangles::clear() {
  for (auto& c : column) c.clear();
}

FieldTexels field_texels(const ToleranceVolume& volume, TexturePrecision precision) {
  FieldTexels out;
  const auto values = volume.values();
  constexpr std::size_t kSpare = 4;
  if (precision == TexturePrecision::kFloat) {
    out.bytes.resize(values.size() * sizeof(float) + kSpare);
    std::memcpy(out.bytes.data(), values.data(), values.size() * sizeof(float));
  } else if (precision == TexturePrecision::kHalf) {
    out.bytes.resize(values.size() * sizeof(std::uint16_t) + kSpare);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::uint16_t bits = half_rounded_up(values[i]);
      std::memcpy(out.bytes.data() + 2 * i, &bits, sizeof bits);
    }
  } else {
    out.bytes.resize(values.size() + kSpare);
    out.scale = static_cast<float>(volume.cap() / volume.spacing() / 255.0 * (1.0 + 0x1p-20));
    for (std::size_t i = 0; i < values.size(); ++i)
      out.bytes[i] = static_cast<std::uint8_t>(std::min(255.0f, std::ceil(values[i] / out.scale)));
  }
  return out;
}

std::unique_ptr<ToleranceRaster> make_cpu_raster(const ToleranceVolume& volume, TexturePrecision precision) {
  switch (precision) {
    case TexturePrecision::k8Bit:
      return std::make_unique<CpuRaster<TexturePrecision::k8Bit>>(volume);
    case TexturePrecision::kHalf:
      return std::make_unique<CpuRaster<TexturePrecision::kHalf>>(volume);
    default:
      return std::make_unique<CpuRaster<TexturePrecision::kFloat>>(volume);
  }
}

}  // namespace tessera
