/// \file implicit_scene.h
/// Scenes built from blended primitives over an optional rolling ground: organic shapes, rooms, mechanical
/// parts. The field is 1-Lipschitz up to lipschitz(), zero on the surface, positive where a sensor may stand.
/// A grid holds, per cell, the primitives that can matter there.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "kernels/scene/fractal_noise.h"
#include "kernels/scene/scene.h"

namespace tessera::synth {

enum class Shape : std::uint8_t {
  kBox,        ///< half extents `size`, edges rounded with `round`
  kCylinder,   ///< radius size.x, half height size.z along the local z, edges rounded with `round`
  kTorus,      ///< radii size.x and size.y about the local z
  kRoundCone,  ///< hull of spheres of radius size.x at the centre and size.y at size.z up the local z
};
enum class Join : std::uint8_t {
  kUnite,     ///< smooth union
  kSubtract,  ///< smooth difference
  kHollow,    ///< unite with the outside of the primitive: a room
};

struct Primitive {
  Shape shape = Shape::kBox;
  Join join = Join::kUnite;
  Double3 centre{};
  Double3 x = {1, 0, 0}, y = {0, 1, 0}, z = {0, 0, 1};  ///< local axes, orthonormal
  Double3 size{};
  double round = 0.0;
  double blend = 0.0;  ///< width of the transition to what was there before; 0 = crease
  std::uint32_t colour = 0xffb4b4b4u;

  Primitive& rotated(double angle);            ///< about the world's z
  Primitive& along(const Double3& direction);  ///< local z along a direction
  Primitive& painted(int r, int g, int b);
};
[[nodiscard]] Primitive box(const Double3& centre, const Double3& half, double round = 0.0,
                            double blend = 0.0);
[[nodiscard]] Primitive cylinder(const Double3& centre, double radius, double half_height, double round = 0.0,
                                 double blend = 0.0);
[[nodiscard]] Primitive torus(const Double3& centre, double major, double minor, double blend = 0.0);
[[nodiscard]] Primitive round_cone(const Double3& a, const Double3& b, double ra, double rb,
                                   double blend = 0.0);
[[nodiscard]] Primitive ball(const Double3& centre, double radius, double blend = 0.0);

/// What a scene is made of.
struct ImplicitModel {
  std::string name;
  Box3 bounds;                                  ///< everything of the surface that is meant to be seen
  std::vector<Primitive> primitives;            ///< joined in this order; at most 65535
  bool ground = false;                          ///< z = height(x, y) below everything
  FractalOptions relief;                        ///< of the ground
  FractalOptions skin = {3, 1.0, 0.0, 0.5, 1};  ///< displacement of all primitives; amplitude 0 = none
  std::vector<Double3> stations;  ///< where a terrestrial scanner stands; empty = around the scene
};

class ImplicitScene final : public Scene {
 public:
  explicit ImplicitScene(ImplicitModel model);

  /// Field and gradient at p. \param paint  receives the colour of the nearest primitive if not null
  double field(const Double3& p, Double3& gradient, std::uint32_t* paint = nullptr) const;

  [[nodiscard]] std::string_view name() const override { return model_.name; }
  [[nodiscard]] Box3 bounds() const override { return model_.bounds; }
  [[nodiscard]] SurfacePoint closest(const Double3& p) const override;
  bool intersect(const Ray& ray, double limit, RayHit& hit) const override;
  void crossings(const Ray& ray, double limit, std::vector<SurfacePoint>& out) const override;
  [[nodiscard]] bool open() const override { return model_.ground; }
  [[nodiscard]] std::vector<Double3> stations() const override { return model_.stations; }
  [[nodiscard]] std::uint32_t colour(const SurfacePoint& p) const override;

 private:
  void build_grid();
  template <class Ids>
  double join(const Ids& ids, const Double3& p, Double3& gradient, std::uint32_t* paint) const;
  double ground(const Double3& p, Double3& gradient) const;
  /// Part of [0, limit] inside the grid. \returns false if there is none
  bool clip(const Ray& ray, double limit, double& t0, double& t1) const;
  /// Share of the field's value that may be stepped.
  double stride() const;
  /// Moves q onto the surface along the gradient. \returns false if it does not arrive
  bool project(Double3& q, Double3& normal) const;

  ImplicitModel model_;
  double skin_slope_ = 0.0;     ///< certified bound
  double ground_factor_ = 1.0;  ///< turns a height difference into a bound of the distance
  double size_ = 0.0;
  int cells_[3] = {1, 1, 1};
  Double3 grid_lo_{}, grid_hi_{}, per_cell_{};
  std::vector<std::uint32_t> first_;  ///< per cell, into ids_
  std::vector<std::uint16_t> ids_;
};

}  // namespace tessera::synth
