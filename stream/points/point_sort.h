/// \file point_sort.h
/// Canonical order inside a brick, and what becomes of points at the same position. Pure, single-threaded.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "octree/points.h"

namespace tessera {

/// Morton code of a point inside its brick: 16 bits per axis.
inline std::uint64_t key_in_brick(const Int3& q) {
  constexpr std::int32_t kMask = (1 << (kBrickBits + kQuantumBits)) - 1;
  return morton_encode(static_cast<std::uint32_t>(q[0] & kMask), static_cast<std::uint32_t>(q[1] & kMask),
                       static_cast<std::uint32_t>(q[2] & kMask));
}

/// Sum of points at one position. Integer sums: the order of adding changes nothing.
class MergedPoint {
 public:
  MergedPoint() = default;
  explicit MergedPoint(const PointRecord& p) : first_(p) { add_attributes(p); }
  /// \pre same position
  void add(const MergedPoint& other);
  /// Normal: direction of the sum of the unit normals, none if they cancel. Colour: the average of those
  /// known. Sensor: the smallest known. Flags: not the last return and synthetic if all say so, ground if one does. A single point
  /// comes back unchanged.
  PointRecord result() const;
  const Int3& q() const { return first_.q; }

 private:
  void add_attributes(const PointRecord& p);

  PointRecord first_;
  std::uint64_t count_ = 0;
  std::uint64_t coloured_ = 0;
  std::int64_t normal_[3] = {0, 0, 0};  ///< in 2^-20
  std::uint64_t colour_[3] = {0, 0, 0};
};

/// Sorts bricks; keeps its scratch between calls.
class BrickSorter {
 public:
  /// The points of one brick in canonical order, equal positions merged; valid until the next call.
  std::span<const PointRecord> sort(std::span<const PointRecord> points);
  /// Scratch for a brick of n points, the result included.
  static std::uint64_t bytes(std::uint64_t n) { return n <= kSmall ? n * (2 * 8 + 24) : n * (2 * 16 + 24); }

 private:
  static constexpr std::size_t kSmall = std::size_t{1} << 16;  ///< key and index share 64 bits

  struct Keyed {
    std::uint64_t key;
    std::uint64_t index;
  };
  std::vector<std::uint64_t> small_, small_other_;
  std::vector<Keyed> large_, large_other_;
  std::vector<PointRecord> sorted_;
};

}  // namespace tessera
