/// \file plan_faces.h
/// Faces seen from above, relative to an origin near them, and those of a window by where they lie.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "kernels/mesh/prism_volume.h"
#include "octree/vector.h"

namespace tessera {

struct PlanBox {
  static constexpr double kInfinite = std::numeric_limits<double>::infinity();
  Double2 low = {kInfinite, kInfinite}, high = {-kInfinite, -kInfinite};
  void add(const Double2& p) {
    for (std::size_t a = 0; a < 2; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
  }
  bool meets(const PlanBox& o) const {
    return low[0] <= o.high[0] && o.low[0] <= high[0] && low[1] <= o.high[1] && o.low[1] <= high[1];
  }
};
PlanBox box_of(std::span<const Double2> points);

/// Corners relative to the origin.
using SpaceTriangle = std::array<Double3, 3>;
std::vector<SpaceTriangle> triangles_of(const MeshBlock& block, const Double3& origin);

struct PlanFace {
  PlanTriangle triangle;
  PlanBox box;
  double area = 0.0;  ///< of the face, not of its shadow
};
std::vector<PlanFace> plan_faces(std::span<const SpaceTriangle> triangles);

/// Faces by the cells of a grid that their boxes meet.
class PlanGrid {
 public:
  /// \param faces  stay where they are while the grid is used
  PlanGrid(const std::vector<PlanFace>& faces, const PlanBox& box);
  /// Faces whose boxes meet this one, each once.
  template <class Use>
  void for_each(const PlanBox& box, Use&& use) const {
    for_cells(box, [&](std::size_t cell) {
      for (std::uint32_t k = first_[cell]; k < first_[cell + 1]; ++k) {
        const std::uint32_t f = listed_[k];
        const PlanBox& other = faces_[f].box;
        // In the first cell that both meet.
        const Double2 first = {std::max(box.low[0], other.low[0]), std::max(box.low[1], other.low[1])};
        if (other.meets(box) && row(first[1], 1) * side_ + row(first[0], 0) == cell) use(faces_[f]);
      }
    });
  }

 private:
  std::size_t row(double at, std::size_t axis) const {
    const double width = box_.high[axis] - box_.low[axis];
    const double t = width > 0.0 ? (at - box_.low[axis]) / width * static_cast<double>(side_) : 0.0;
    return std::min(static_cast<std::size_t>(std::max(t, 0.0)), side_ - 1);
  }
  template <class Use>
  void for_cells(const PlanBox& box, Use&& use) const {
    for (std::size_t y = row(box.low[1], 1); y <= row(box.high[1], 1); ++y)
      for (std::size_t x = row(box.low[0], 0); x <= row(box.high[0], 0); ++x) use(y * side_ + x);
  }

  const std::vector<PlanFace>& faces_;
  PlanBox box_;
  std::size_t side_ = 1;
  std::vector<std::uint32_t> first_;  ///< per cell, in listed_; one more at the end
  std::vector<std::uint32_t> listed_;
};

/// Faces by the cells of a grid that they themselves meet, however long and thin they are: those of a polygon's triangulation.
class SliverGrid {
 public:
  SliverGrid() = default;
  explicit SliverGrid(std::vector<PlanFace> faces);
  /// Upper bound of its bytes, for n faces that are no more than a polygon's triangulation.
  static std::uint64_t bytes(std::uint64_t faces);
  const std::vector<PlanFace>& faces() const { return faces_; }
  const PlanBox& box() const { return box_; }
  /// Faces that may meet the box, ascending, each once. \param found  scratch
  template <class Use>
  void for_each(const PlanBox& box, std::vector<std::uint32_t>& found, Use&& use) const {
    if (!box_.meets(box)) return;
    collect(box, found);
    for (const std::uint32_t f : found)
      if (faces_[f].box.meets(box)) use(faces_[f]);
  }

 private:
  std::size_t cell(double at, std::size_t axis) const;
  template <class Use>
  void for_cells(const PlanFace& face, Use&& use) const;
  void collect(const PlanBox& box, std::vector<std::uint32_t>& found) const;

  std::vector<PlanFace> faces_;
  PlanBox box_;
  std::size_t side_ = 1;
  std::vector<std::uint32_t> first_;  ///< per cell, in listed_; one more at the end
  std::vector<std::uint32_t> listed_;
};

}  // namespace tessera
