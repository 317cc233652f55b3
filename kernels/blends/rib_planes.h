/// \file rib_planes.h
/// The planes of a fishbone's ribs: one at every sample of the spine, at right angles to it, or tilted where ribs would
/// overlap. Between two of them the planes turn from one into the other, so every point near the spine has a place: a
/// rib, with a fraction, and coordinates in its plane. A surface swept along the spine has one profile in these.
/// Source: thesis 4.3.3, fig. 4.21.
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Right-handed, unit: across x up = along.
struct RibPlane {
  Double3 origin{};  ///< sample of the spine
  Double3 along{};   ///< normal of the plane
  Double3 across{};  ///< the rib's x
  Double3 up{};      ///< its y: out of the surface
};

struct RibPosition {
  double rib = 0.0;  ///< below 0 and beyond the last where a spine that is open goes on straight
  double x = 0.0, y = 0.0;
};

class RibPlanes {
 public:
  RibPlanes() = default;
  /// \param planes  in even steps, three at least; those of a closed spine do not repeat the first
  RibPlanes(std::vector<RibPlane> planes, bool closed);

  [[nodiscard]] std::size_t size() const { return planes_.size(); }
  [[nodiscard]] bool closed() const { return closed_; }
  double spacing() const { return spacing_; }  ///< in the mean
  double length() const { return spacing_ * static_cast<double>(closed_ ? size() : size() - 1); }
  const RibPlane& operator[](std::size_t rib) const { return planes_[rib]; }
  [[nodiscard]] Double3 at(std::size_t rib, double x, double y) const;
  /// \param near  a rib near it
  /// \returns nothing where planes cross around the point
  [[nodiscard]] std::optional<RibPosition> locate(const Double3& p, std::size_t near) const;

 private:
  double height(std::size_t rib, const Double3& p) const {
    return dot(p - planes_[rib].origin, planes_[rib].along);
  }
  RibPosition between(std::size_t rib, const Double3& p) const;
  std::vector<RibPlane> planes_;
  bool closed_ = false;
  double spacing_ = 0.0;
};

/// Planes at right angles to a spine, resampled to even steps.
/// \param up       per point, not along the spine: out of the surface
/// \param ribs     so many, three at least; 0 = as many as there are points
/// \param smooths  times that points and their ups are low-passed first; ends of an open spine stay on their line
[[nodiscard]] RibPlanes planes_across(std::vector<Double3> spine, std::vector<Double3> up, bool closed,
                                      std::size_t ribs, int smooths);

/// Low-pass filter of a polyline: `times` averages with the neighbours, straight lines stay.
void smooth_line(std::vector<Double3>& line, bool closed, int times);
void smooth_line(std::vector<double>& line, bool closed, int times);
/// One that leaves curves of even curvature where they are: fourth differences are damped. Ends stay.
void smooth_curve(std::vector<Double3>& line, bool closed, int times);

inline constexpr std::size_t kMinRibs = 4;  ///< of a fishbone
/// Ribs in a row, from `first` on; past the last rib of a closed spine it goes on with the first.
struct RibRun {
  std::size_t first = 0, count = 0;
};
/// The longest one that is sound, the first of equal ones. \param sound  per rib
[[nodiscard]] RibRun longest_run(std::span<const std::uint8_t> sound, bool closed);

/// Ends of ribs, on the surface: one a rib on each side.
struct RibEnds {
  std::vector<Double3> left, right;
};
/// Whether an end lies on the wrong side of a neighbour's plane, or nearer to it than `minimum` (> 0, scan units).
[[nodiscard]] bool ribs_cross(const RibPlanes& planes, const RibEnds& ends, double minimum);
/// Low-pass filters the trajectories of the ends, as often as it takes, and tilts every plane to go through its ends and
/// its origin. \returns false if ribs still cross after as much as makes sense
bool straighten_ribs(RibPlanes& planes, const RibEnds& ends, double minimum);

}  // namespace tessera
