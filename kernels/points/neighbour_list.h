/// \file neighbour_list.h
/// The points around a cube of cells that its points may have for neighbours, and sums over those within a radius.
/// The list, and so the lane in which a neighbour is summed, depends on the points and the cube alone.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "kernels/points/plane_fits.h"
#include "octree/vector.h"

namespace tessera {

/// Points that stand for all, structure of arrays; all as long, but those that may be empty.
struct NeighbourSource {
  std::span<const float> x, y, z;
  std::span<const float> nx, ny, nz;
  std::span<const std::uint8_t> ground;  ///< 1: known as ground; empty = none is
};

class NeighbourList {
 public:
  /// Whether fill() has to be called.
  [[nodiscard]] bool empty() const { return size_ == 0; }
  void clear() { size_ = 0; }
  /// Takes the points that lie strictly inside the cube grown by `radius`, positions relative to its corner.
  /// \param runs  of the source, [first, last), in canonical order
  /// \param only_ground  points known as ground alone
  /// \param normals  theirs too, for supported()
  void fill(const NeighbourSource& source, std::span<const std::pair<std::uint32_t, std::uint32_t>> runs,
            const Float3& corner, float radius, bool only_ground, bool normals);

  /// Packs of eight of which something may lie within `radius` of something in the box, by their first place, ascending.
  void select(const Float3& low, const Float3& high, float radius, std::vector<std::uint32_t>& packs) const;

  /// Neighbours strictly within `radius` of p, weight (1 - d^2/r^2)^2, into a lane of `sums`. \returns how many
  int sum(std::span<const std::uint32_t> packs, const Float3& p, float radius, NeighbourSums& sums,
          std::size_t lane) const;
  /// How many, and how many of these have a normal within 60 degrees of n.
  [[nodiscard]] std::pair<int, int> supported(std::span<const std::uint32_t> packs, const Float3& p,
                                              const Float3& n, float radius) const;

 private:
  void reserve_lanes(std::size_t maximum, bool normals);
  void make_boxes();

  std::size_t size_ = 0;  ///< padded to whole packs; in canonical order those of a pack lie together
  std::vector<float> x_, y_, z_, nx_, ny_, nz_;
  std::array<std::vector<float>, 3> low_, high_;  ///< per pack; padded to whole packs of these too
};

}  // namespace tessera
