/// \file solid_shape.h
/// Implicit solids as operands of a combination: spheres, boxes, cylinders, cones, tori, half-spaces, placed anywhere.
/// Faces that meet in an edge are joined by maximum, so every root lies on one of them and has its normal (thesis 2.3.1).
#pragma once
#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/solid/line_windings.h"
#include "kernels/solid/solid_field.h"
#include "octree/placement.h"

namespace tessera {
/// Kinds, with how many numbers each takes:
///   sphere     centre, radius                     4
///   box        lowest, highest corner             6
///   cylinder   both ends of the axis, radius      7
///   cone       both ends, radius at each          8   (one may be 0)
///   torus      centre, axis, two radii            8
///   halfspace  point, outward normal              6
inline constexpr std::array<std::string_view, 6> kShapeKinds = {"sphere", "box",   "cylinder",
                                                                "cone",   "torus", "halfspace"};

/// A shape in world coordinates.
class SolidShape {
 public:
  virtual ~SolidShape() = default;
  /// < 0 inside, zero on the surface, never farther from zero than the distance to it.
  [[nodiscard]] virtual double value(const Double3& p) const = 0;
  /// Whether the value is below 0.
  [[nodiscard]] virtual bool holds(const Double3& p) const { return value(p) < 0.0; }
  /// Outward direction of the face that the value is of, not unit.
  [[nodiscard]] virtual Double3 direction(const Double3& p) const = 0;
  /// Signed distance, where a shape is convex or has no edges exact everywhere, and the direction in which it grows: also
  /// beyond edges, where value() goes on with one of the faces. \pre nothing was stretched
  [[nodiscard]] virtual double distance(const Double3& p) const { return value(p); }
  [[nodiscard]] virtual Double3 away(const Double3& p) const { return direction(p); }
  /// A box that holds all of it. \returns false where there is none
  virtual bool bounds(Double3& low, Double3& high) const = 0;
  /// Where the surface passes between two points on its two sides, as a share of the way.
  [[nodiscard]] virtual double surface_between(const Double3& from, const Double3& to,
                                               bool starts_inside) const;
  /// The shape for one thread, within `radius` of a point: values up to `margin` are the same there, larger ones may be
  /// larger still. Null where there is nothing to gain.
  [[nodiscard]] virtual std::unique_ptr<SolidShape> near(const Double3&, double, double) const {
    return nullptr;
  }
};

/// How many numbers a kind takes; 0 for a kind that is none.
[[nodiscard]] std::size_t shape_numbers(std::string_view kind);
/// What is wrong with these numbers ("radius must be above 0"); empty if nothing is. \pre as many as the kind takes
[[nodiscard]] std::string shape_fault(std::string_view kind, const std::vector<double>& numbers);
/// \pre shape_fault() is empty, the placement's determinant is not zero
[[nodiscard]] std::unique_ptr<SolidShape> make_shape(std::string_view kind,
                                                     const std::vector<double>& numbers,
                                                     const Placement& placement);

/// Leaves that the surface of a shape may touch, of these bricks [low, high], with no turns and a bound of crossings: the
/// table by which blocks are planned.
[[nodiscard]] std::vector<LeafWindings> shape_leaves(const SolidShape& shape, const Lattice& lattice,
                                                     const Int3& low, const Int3& high);

/// A shape on the lattice.
class ShapeSolid : public SolidOperand {
 public:
  ShapeSolid(const SolidShape& shape, const Lattice& lattice) : shape_(&shape), lattice_(lattice) {}
  void windings(const Int3& leaf, std::span<const SolidCrossing> crossings, std::span<float> out,
                BorderRegions& regions) const override;
  [[nodiscard]] Double3 membrane_normal(const Double3& cells) const override;
  /// Crossings on edges from the nodes of a global leaf, one at most on each. \pre the leaf lies in the block
  void find_crossings(const SolidBlock& block, const Int3& leaf, std::uint8_t operand,
                      std::vector<SolidCrossing>& out) const;

 private:
  Double3 world(const Double3& cells) const;
  const SolidShape* shape_;
  Lattice lattice_;
};

}  // namespace tessera
