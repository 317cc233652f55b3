/// \file face_boxes.h
/// A tree of boxes around the faces of a mesh that is edited in place: faces keep their numbers, their boxes change and go.
/// Eight boxes of 16-bit integers are compared with one in a few instructions; a box that shrinks leaves those above it wide.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <immintrin.h>

#include "octree/vector.h"

namespace tessera {

class FaceBoxes {
 public:
  /// In steps, 65,534 to the range. Boxes that meet in space meet in steps.
  struct Box {
    std::array<std::int16_t, 3> low, high;
    [[nodiscard]] bool meets(const Box& o) const {
      bool apart = false;
      for (std::size_t k = 0; k < 3; ++k) apart = apart || low[k] > o.high[k] || o.low[k] > high[k];
      return !apart;
    }
    void add(const Box& o) {
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = low[k] < o.low[k] ? low[k] : o.low[k];
        high[k] = high[k] > o.high[k] ? high[k] : o.high[k];
      }
    }
    bool operator==(const Box&) const = default;
  };
  static constexpr Box kNothing = {{32767, 32767, 32767}, {-32768, -32768, -32768}};  ///< meets no other

  FaceBoxes() = default;
  /// \param low, high  of where corners will lie: what is beyond counts with the nearest step
  FaceBoxes(const Double3& low, const Double3& high);

  /// Around them. \pre at least one
  [[nodiscard]] Box box(std::span<const Double3> corners) const {
    const __m256i three = _mm256_setr_epi64x(-1, -1, -1, 0);
    __m256d low = _mm256_maskload_pd(corners[0].data(), three), high = low;
    for (const Double3& c : corners.subspan(1)) {
      const __m256d at = _mm256_maskload_pd(c.data(), three);
      low = _mm256_min_pd(low, at), high = _mm256_max_pd(high, at);
    }
    // Monotone, so that boxes that meet still do.
    const __m256d from = _mm256_maskload_pd(low_.data(), three),
                  scale = _mm256_maskload_pd(per_step_.data(), three);
    const auto steps = [&](__m256d x) {
      const __m256d t = _mm256_mul_pd(_mm256_sub_pd(x, from), scale);
      return _mm_sub_epi32(
          _mm256_cvttpd_epi32(_mm256_min_pd(_mm256_max_pd(t, _mm256_setzero_pd()), _mm256_set1_pd(kSteps))),
          _mm_set1_epi32(32767));
    };
    alignas(16) std::array<std::int16_t, 8> both;
    _mm_store_si128(reinterpret_cast<__m128i*>(both.data()), _mm_packs_epi32(steps(low), steps(high)));
    return {{both[0], both[1], both[2]}, {both[4], both[5], both[6]}};
  }
  /// Where a corner lies; the last is 0.
  using Steps = std::array<std::int16_t, 4>;
  Steps steps(const Double3& corner) const {
    const Box b = box({&corner, 1});
    return {b.low[0], b.low[1], b.low[2], 0};
  }
  /// box() of three corners, where many share them.
  static Box around(const Steps& a, const Steps& b, const Steps& c) {
    const auto load = [](const Steps& s) {
      return _mm_loadl_epi64(reinterpret_cast<const __m128i*>(s.data()));
    };
    const __m128i x = load(a), y = load(b), z = load(c);
    alignas(16) std::array<std::int16_t, 8> low, high;
    _mm_store_si128(reinterpret_cast<__m128i*>(low.data()), _mm_min_epi16(_mm_min_epi16(x, y), z));
    _mm_store_si128(reinterpret_cast<__m128i*>(high.data()), _mm_max_epi16(_mm_max_epi16(x, y), z));
    return {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
  }
  /// Of a face, as it was set.
  [[nodiscard]] Box at(std::uint32_t face) const {
    const std::size_t slot = slot_of(face);
    return levels_[0][slot / kLanes].lane(slot % kLanes);
  }

  /// How faces come to share boxes.
  enum class Order {
    kGiven,   ///< by their numbers: 14 bytes a face, quick where neighbours have numbers near each other
    kMorton,  ///< by where they are: 22 bytes a face
  };
  /// Takes over the boxes of faces 0, 1, ...
  void build(std::span<const Box> boxes, Order order = Order::kGiven);
  /// \param face  of those that were there at build(); kNothing takes it out
  void set(std::uint32_t face, const Box& box);

  /// Calls use(face) for each face whose box meets this one, in no order that means anything, until one call returns false.
  template <class Use>
  void for_meeting(const Box& box, const Use& use) const {
    if (!levels_.empty()) descend(levels_.size() - 1, 0, box, use);
  }

  [[nodiscard]] static constexpr std::size_t bytes(std::size_t faces, Order order = Order::kGiven) {
    return faces * (order == Order::kMorton ? 22 : 14) + 1024;
  }

 private:
  static constexpr std::size_t kLanes = 8;
  static constexpr double kSteps = 65533.0;  ///< from -32767 on: those of kNothing lie beyond
  struct Bundle {
    alignas(16) std::array<std::array<std::int16_t, kLanes>, 3> low, high;
    Bundle();
    [[nodiscard]] Box lane(std::size_t l) const;
    void put(std::size_t l, const Box& box);
    [[nodiscard]] Box around() const;
    /// A bit for each box that meets this one.
    [[nodiscard]] unsigned meeting(const Box& box) const {
      __m128i apart = _mm_setzero_si128();
#pragma GCC unroll 3
      for (std::size_t k = 0; k < 3; ++k) {
        const __m128i from = _mm_load_si128(reinterpret_cast<const __m128i*>(low[k].data()));
        const __m128i to = _mm_load_si128(reinterpret_cast<const __m128i*>(high[k].data()));
        apart = _mm_or_si128(apart, _mm_cmpgt_epi16(from, _mm_set1_epi16(box.high[k])));
        apart = _mm_or_si128(apart, _mm_cmpgt_epi16(_mm_set1_epi16(box.low[k]), to));
      }
      return ~static_cast<unsigned>(_mm_movemask_epi8(_mm_packs_epi16(apart, apart))) & 0xffu;
    }
  };

  template <class Use>
  bool descend(std::size_t level, std::size_t bundle, const Box& box, const Use& use) const {
    const unsigned meeting = levels_[level][bundle].meeting(box);
    if (level > 0)
      for (unsigned bits = meeting & (meeting - 1); bits != 0; bits &= bits - 1)
        __builtin_prefetch(
            &levels_[level - 1][bundle * kLanes + static_cast<std::size_t>(__builtin_ctz(bits))]);
    for (unsigned bits = meeting; bits != 0; bits &= bits - 1) {
      const std::size_t below = bundle * kLanes + static_cast<std::size_t>(__builtin_ctz(bits));
      if (!(level > 0 ? descend(level - 1, below, box, use) : use(face_at(below)))) return false;
    }
    return true;
  }

  std::size_t slot_of(std::uint32_t face) const {
    return slot_of_.empty() ? face : slot_of_[face];
  }
  std::uint32_t face_at(std::size_t slot) const {
    return face_at_.empty() ? static_cast<std::uint32_t>(slot) : face_at_[slot];
  }

  Double3 low_{}, per_step_{};
  std::vector<std::vector<Bundle>> levels_;       ///< of the faces first
  std::vector<std::uint32_t> slot_of_, face_at_;  ///< empty where faces stand by their numbers
};

}  // namespace tessera
