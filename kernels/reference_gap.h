/// \file reference_gap.h
/// The distance between the new star of a collapse and the reference below it, both ways.
///
/// Seen along the normal of the rim's polygon, the new star is a graph over the polygon. The reference is
/// walked from the removed vertex across every edge that meets the polygon; if all triangles on the way face
/// the same side and no border is met, the reference is a graph over the polygon too and covers it (its image
/// is open and closed in the polygon). The difference of two graphs that are linear on the overlay of their
/// triangulations is largest at an overlay vertex: a reference vertex, or where a reference edge crosses an
/// edge of the star. The vertices of the star lie on the reference.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/collapse_gap.h"
#include "kernels/collapse_mesh.h"

namespace tessera {

class ReferenceGap {
 public:
  /// \param reference  kept by reference; positions relative to the same origin as the block's
  explicit ReferenceGap(const CollapseMesh& reference);

  /// \param loop    closed rim of the star, relative to the vertex that takes over (at[0] = 0)
  /// \param origin  position of the vertex that takes over
  /// \param seed    a reference vertex inside the polygon
  /// \param limit   give up above it
  /// \param[out] gap  every point of the new star and of the reference below it lies within it of the other
  /// \return false where the gap exceeds the limit or the reference is no graph over the polygon
  bool measure(const RimLoop& loop, const synth::Vec3& origin, std::uint32_t seed, double limit, double& gap);

  std::uint64_t walked() const { return walked_; }  ///< triangles looked at so far

 private:
  struct Point {
    double x, y, z;
    std::uint64_t spokes, rims;  ///< bit j: left of spoke j, of rim edge j
    bool inside;
  };

  bool place(std::uint32_t vertex, std::uint32_t& slot);
  bool inside(const Point& p, double& height) const;
  bool meets_polygon(const Point& a, const Point& b) const;
  bool cross_edges(const Point& a, const Point& b);

  const CollapseMesh& reference_;
  std::vector<std::uint32_t> vertex_stamp_, vertex_slot_, face_stamp_;
  std::uint32_t stamp_ = 0;
  std::vector<Point> points_;
  std::vector<std::uint32_t> stack_;
  std::uint64_t walked_ = 0;

  // The polygon at hand.
  std::size_t size_ = 0;
  std::array<double, kMaxRing + 2> x_{}, y_{}, z_{};
  synth::Vec3 ex_{}, ey_{}, n_{}, origin_{};
  double gap_ = 0.0, limit_ = 0.0, rounding_ = 0.0;
};

}  // namespace tessera
