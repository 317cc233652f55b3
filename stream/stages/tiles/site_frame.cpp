// PROJ's C interface (proj.org): coordinate systems from WKT, transformation to EPSG:4978. No network.
#include "stream/stages/tiles/site_frame.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "stream/formats/proj_library.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

using Handle = ProjHandle;
using Context = ProjContext;

constexpr double kReportedMisfit_m = 0.1;  ///< a misfit from here on is worth a warning

/// What of a system is in the plane.
Handle horizontal_of(PJ_CONTEXT* context, const PJ* crs) {
  if (proj().get_type(crs) == PJ_TYPE_COMPOUND_CRS) return Handle(proj().crs_get_sub_crs(context, crs, 0));
  if (proj().get_type(crs) == PJ_TYPE_BOUND_CRS) return Handle(proj().get_source_crs(context, crs));
  return Handle(proj().clone(context, crs));
}

/// Metres of the horizontal unit; nothing where the system is not projected.
std::optional<double> projected_unit(PJ_CONTEXT* context, const PJ* crs) {
  const Handle horizontal = horizontal_of(context, crs);
  if (!horizontal || proj().get_type(horizontal.get()) != PJ_TYPE_PROJECTED_CRS) return std::nullopt;
  const Handle axes(proj().crs_get_coordinate_system(context, horizontal.get()));
  double metres = 0.0;
  if (!axes || proj().cs_get_axis_info(context, axes.get(), 0, nullptr, nullptr, nullptr, &metres, nullptr,
                                       nullptr, nullptr) == 0)
    return std::nullopt;
  return metres > 0.0 ? std::optional(metres) : std::nullopt;
}

class ToEarth {
 public:
  explicit ToEarth(const std::string& wkt) : context_(proj().context_create()) {
    proj().context_set_enable_network(context_.get(), 0);
    proj().log_level(context_.get(), PJ_LOG_NONE);
    const Handle crs(proj().create(context_.get(), wkt.c_str())),
        earth(proj().create(context_.get(), "EPSG:4978"));
    if (!crs || !earth) return;
    if (const char* name = proj().get_name(crs.get()); name != nullptr) name_ = name;
    const std::optional<double> unit = projected_unit(context_.get(), crs.get());
    if (!unit) return;
    // Where a system has no heights of its own, PROJ takes what comes for metres above the ellipsoid.
    const bool compound = proj().get_type(crs.get()) == PJ_TYPE_COMPOUND_CRS;
    height_unit_ = compound ? 1.0 : *unit;
    const Handle raw(
        proj().create_crs_to_crs_from_pj(context_.get(), crs.get(), earth.get(), nullptr, nullptr));
    // Easting before northing, whatever order the system's axes have.
    if (raw) transformation_.reset(proj().normalize_for_visualization(context_.get(), raw.get()));
  }
  const std::string& name() const { return name_; }
  bool works() const { return transformation_ != nullptr; }

  /// Earth-centred, metres; not finite where the place has none.
  Double3 operator()(const Double3& p) const {
    const PJ_COORD at =
        proj().trans(transformation_.get(), PJ_FWD, proj().coord(p[0], p[1], height_unit_ * p[2], 0.0));
    return {at.xyz.x, at.xyz.y, at.xyz.z};
  }

 private:
  Context context_;
  Handle transformation_;
  std::string name_;
  double height_unit_ = 1.0;
};

bool is_finite(const Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

void set_column(SiteFrame& frame, std::size_t column, const Double3& v) {
  for (std::size_t k = 0; k < 3; ++k) frame.transform[4 * column + k] = v[k];
}

}  // namespace

SiteFrame site_frame(const std::string& wkt, const Double3& origin, const Double3& half) {
  SiteFrame frame;
  for (std::size_t k = 0; k < 3; ++k) frame.transform[5 * k] = 1.0;
  frame.transform[15] = 1.0;
  set_column(frame, 3, origin);
  if (wkt.empty()) {
    frame.warning =
        "no coordinate system is known, so the site is placed nowhere on Earth and has the coordinates of "
        "the "
        "mesh: put its WKT into a .prj file beside the mesh to place it";
    return frame;
  }
  if (proj().library == nullptr) {
    frame.warning =
        "there is no libproj.so.25 to place the site on Earth with, install libproj25: the tileset has the "
        "coordinates of the mesh";
    return frame;
  }
  const ToEarth earth(wkt);
  frame.crs = earth.name();
  const Double3 middle = earth.works() ? earth(origin) : Double3{HUGE_VAL, 0, 0};
  if (!is_finite(middle)) {
    frame.warning = "the coordinate system beside the mesh is none that a site can be placed on Earth by (" +
                    (frame.crs.empty() ? std::string("unreadable") : frame.crs) +
                    "): the tileset has the coordinates of the mesh";
    return frame;
  }
  std::array<Double3, 3> axis;
  for (std::size_t k = 0; k < 3; ++k) {
    constexpr double kStep = 16.0;  // long against rounding, short against the curvature of the Earth
    Double3 before = origin, after = origin;
    before[k] -= kStep;
    after[k] += kStep;
    const Double3 along = earth(after) - earth(before);
    for (std::size_t c = 0; c < 3; ++c) axis[k][c] = along[c] / (2.0 * kStep);
  }
  for (int corner = 0; corner < 8; ++corner) {
    Double3 there = origin, flat = middle;
    for (std::size_t k = 0; k < 3; ++k) {
      const double off = (corner >> k & 1) != 0 ? half[k] : -half[k];
      there[k] += off;
      for (std::size_t c = 0; c < 3; ++c) flat[c] += off * axis[k][c];
    }
    frame.misfit_m = std::max(frame.misfit_m, norm(earth(there) - flat));
  }
  if (!is_finite(axis[0]) || !is_finite(axis[1]) || !is_finite(axis[2]) || !std::isfinite(frame.misfit_m)) {
    frame.misfit_m = 0.0;
    frame.warning = "the mesh reaches beyond where its coordinate system (" + frame.crs +
                    ") is defined: the tileset has the coordinates of the mesh";
    return frame;
  }
  frame.geocentric = true;
  for (std::size_t k = 0; k < 3; ++k) set_column(frame, k, axis[k]);
  set_column(frame, 3, middle);
  if (frame.misfit_m > kReportedMisfit_m)
    frame.warning = "tiles are flat and the Earth is not: corners of the site lie up to " +
                    number_text(frame.misfit_m) + " m from their places, its middle is exact";
  return frame;
}

}  // namespace tessera
