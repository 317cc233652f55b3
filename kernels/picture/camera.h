/// \file camera.h
/// Where a picture is taken from: an orthonormal frame, an orthographic or perspective frustum, and its fit
/// to what is seen. All coordinates are relative to one scene origin near the data, so floats on the GPU keep
/// their precision.
#pragma once
#include <array>
#include <optional>
#include <span>
#include <string>

#include "octree/lattice.h"

namespace tessera {

/// What the user asks for: a direction, or an eye.
struct ViewSpec {
  std::string name;           ///< "front", "turn 30": goes into the caption
  Double3 back = {0, -1, 0};  ///< unit, from the scene towards the viewer
  Double3 up = {0, 0, 1};     ///< unit, not parallel to back
  bool orthographic = true;   ///< along an axis; a scale bar is then true everywhere
  bool has_eye = false;       ///< stand at `eye`, do not move back until all is seen
  Double3 eye = {0, 0, 0};
};

struct Camera {
  Double3 right = {1, 0, 0}, up = {0, 0, 1}, back = {0, -1, 0};
  Double3 eye = {0, 0, 0};
  bool orthographic = true;
  double half_width = 1.0;  ///< orthographic: scene units; perspective: tangent of the half angle
  double half_height = 1.0;
  double near_plane = 0.1, far_plane = 10.0;  ///< distances along the view, near > 0 in perspective

  [[nodiscard]] std::array<float, 16> view_matrix()
      const;  ///< column-major, scene to eye coordinates (looking along -z)
  [[nodiscard]] std::array<float, 16> projection_matrix() const;  ///< column-major, to clip coordinates
};

/// front back left right top bottom iso iso2 turn:DEGREES. With up = z the viewer of `front` stands at -y;
/// with up = y at +z. iso looks from the front, right and above, iso2 from the opposite side; turn goes
/// around from the front, 20 degrees above.
/// \throws UsageError for an unknown name
[[nodiscard]] ViewSpec parse_view(const std::string& text, const Double3& up);

/// The view from `eye` to `target`, in perspective. \throws UsageError when they coincide
[[nodiscard]] ViewSpec eye_view(const Double3& eye, const Double3& target, const Double3& up);

/// Places a camera so that `points` (a sample of what is seen) fill the frame but for a margin, then enlarges
/// by `zoom`.
/// \pre points not empty, aspect = width / height > 0
[[nodiscard]] Camera fit_camera(const ViewSpec& view, std::span<const Float3> points, double aspect,
                                double zoom);

/// Places a camera on the ball of `radius` around `centre`.
[[nodiscard]] Camera focus_camera(const ViewSpec& view, const Double3& centre, double radius, double aspect,
                                  double zoom);

/// Where a place is seen: -1 at the left and lower edge of the frame, 1 at the right and upper; none behind the viewer.
[[nodiscard]] std::optional<Double2> position_in_view(const Camera& camera, const Double3& place);

/// Sets the near and far planes so that the box is between them.
void set_depth_range(Camera& camera, const Double3& low, const Double3& high);

}  // namespace tessera
