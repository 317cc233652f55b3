/// \file solid.h
/// The pieces of a solid: trimmed faces, curves where faces meet, corners where curves meet.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "kernels/scene/scene.h"

namespace tessera::synth {

/// Whether a point of a face's carrier surface belongs to the face.
using Trim = std::function<bool(const Double3&)>;

/// A face on a carrier surface that is larger than it.
class SolidFace : public SurfacePatch {
 public:
  /// Nearest point of the carrier. \returns false where it is not on the face
  virtual bool foot(const Double3& p, SurfacePoint& out) const = 0;
  /// Shortens `hit` to the first hit in (0, hit.range) if there is one.
  virtual void intersect(const Ray& ray, RayHit& hit) const = 0;
};

/// Parallelogram origin + u U + v V, normal along cross(U, V), cut by `trim` (empty: whole).
[[nodiscard]] std::unique_ptr<SolidFace> plane_face(const Double3& origin, const Double3& u, const Double3& v,
                                                    Trim trim = {});

/// Cylinder about the line through `centre` along the unit vector `axis`: angle from `from` to `to` measured
/// from the unit vector `x` towards cross(axis, x), height along the axis from `low` to top(point), where
/// `top` is linear: top_height + dot(top_slope, point - centre).
struct CylinderShape {
  Double3 centre{}, axis{}, x{};
  double radius = 1.0;
  double from = 0.0, to = 2.0 * kPi;
  double low = 0.0;
  double top_height = 1.0;
  Double3 top_slope{};  ///< at right angles to axis
  bool inward = false;  ///< normal towards the axis: a bore
  Trim trim;
};
[[nodiscard]] std::unique_ptr<SolidFace> cylinder_face(const CylinderShape& shape);

/// centre + cos(t) a + sin(t) b for t in [from, to], or a segment.
struct Crease {
  Double3 centre{}, a{}, b{};
  double from = 0.0, to = 0.0;
  bool straight = false;  ///< centre + t a, t in [0, 1]
  [[nodiscard]] static Crease line(const Double3& from, const Double3& to);
  [[nodiscard]] static Crease arc(const Double3& centre, const Double3& a, const Double3& b, double from,
                                  double to);
  [[nodiscard]] Double3 at(double t) const;
  [[nodiscard]] Double3 closest(const Double3& p) const;
  /// Positions at equal steps of t, for closest(), and a ball around them; made by Solid::add.
  std::vector<Double3> scan;
  Double3 middle{};
  double radius = 0.0;
};

class Solid : public Scene {
 public:
  Solid(std::string name, const Box3& bounds) : name_(std::move(name)), bounds_(bounds) {}
  void add(std::unique_ptr<SolidFace> face) { faces_.push_back(std::move(face)); }
  void add(Crease crease);
  void add_corner(const Double3& corner) { corners_.push_back(corner); }

  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] Box3 bounds() const override { return bounds_; }
  [[nodiscard]] SurfacePoint closest(const Double3& p) const override;
  bool intersect(const Ray& ray, double limit, RayHit& hit) const override;
  [[nodiscard]] std::vector<const SurfacePatch*> patches() const override;
  [[nodiscard]] std::vector<Double3> corners() const override { return corners_; }
  [[nodiscard]] std::vector<Double3> crease_points(double step) const override;
  bool nearest_crease(const Double3& p, SharpFeature& out) const override;
  bool nearest_corner(const Double3& p, SharpFeature& out) const override;

 private:
  std::string name_;
  Box3 bounds_;
  std::vector<std::unique_ptr<SolidFace>> faces_;
  std::vector<Crease> creases_;
  std::vector<Double3> corners_;
};

}  // namespace tessera::synth
