/// \file point_colours.h
/// Colours of a surface from coloured points near it.
///
/// Of the points nearest to a place, those whose normals, where known, look another way than the surface are passed over;
/// what is far from the median of the others is speckle; the rest is weighted by the inverse squared square of its distance
/// along the surface (Shepard 1968), so that points on the surface keep their colours and what lies before or behind
/// counts by where it falls along the normal. Sums go in the order of distances, ties by index.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Normals of 32 bits: octahedral (Meyer et al. 2010), never 0, which stands for none.
[[nodiscard]] std::uint32_t pack_normal(const Double3& n);
[[nodiscard]] Double3 unpack_normal(std::uint32_t packed);  ///< zero for 0

struct PointColourOptions {
  double spacing = 0.0;       ///< of the points along the surface, > 0
  double max_distance = 0.0;  ///< >= spacing; points farther off are none of this surface
  std::size_t neighbours = 8;
};

/// Holds the spans, which must outlive it.
class PointColours {
 public:
  /// \param normal  packed, as many as points, or empty
  PointColours(std::span<const Float3> position, std::span<const std::uint32_t> rgba,
               std::span<const std::uint32_t> normal, const PointColourOptions& options);

  struct Near {
    double square;
    std::uint32_t point;
  };
  /// The colour at a place of the surface. \param normal  unit, or zero \param near  scratch
  /// \param without  a point that does not count \returns false where no point is near
  bool find(const Double3& at, const Double3& normal, std::uint32_t& rgba, std::vector<Near>& near,
            std::uint32_t without = kAllPoints) const;
  static constexpr std::uint32_t kAllPoints = 0xffffffffu;
  /// The normal of the surface that the points are of, weighted as their colours are. \returns false where no point with a normal is near
  bool find_normal(const Double3& at, const Double3& normal, Double3& found, std::vector<Near>& near) const;
  /// Bytes per point beside the spans.
  [[nodiscard]] static constexpr std::uint64_t bytes_per_point() { return 16 + 4 + 40; }

 private:
  /// The nearest points that count, in the order of their distances.
  void find_near(const Double3& at, const Double3& normal, std::uint32_t without,
                 std::vector<Near>& near) const;
  double weight_of(const Near& point, const Double3& at, const Double3& normal) const;
  std::uint64_t cell_key(const Int3& cell) const;
  Int3 cell_of(const Double3& p) const;
  void gather(const Double3& at, const Double3& normal, const Int3& cell, std::uint32_t without,
              std::vector<Near>& out) const;

  std::span<const Float3> position_;
  std::span<const std::uint32_t> rgba_, normal_;
  PointColourOptions options_;
  double edge_ = 1.0;
  Double3 low_{};
  std::vector<std::uint32_t> order_;  ///< points by cell, then by index
  struct Slot {
    std::uint64_t key = ~std::uint64_t{0};
    std::uint32_t first = 0, end = 0;
  };
  std::vector<Slot> slots_;  ///< hash table of cells
};

}  // namespace tessera
