/// \file site_frame.h
/// Where on Earth a site lies.
#pragma once
#include <array>
#include <string>

#include "octree/vector.h"

namespace tessera {

/// From the frame of a site (scan units, z up, relative to its origin) to the world of the tileset.
struct SiteFrame {
  std::array<double, 16> transform{};  ///< column by column
  std::string crs;                     ///< name of the coordinate system; empty = none is known
  bool geocentric = false;             ///< the world is WGS 84, earth-centred, metres; else that of the scan
  /// How far the corners of the box lie from where they are on Earth, which is not flat; metres.
  double misfit_m = 0.0;
  std::string warning;  ///< why the site is not on Earth, or how well; may be empty
};

/// The frame that fits the system best at the origin: its axes there, with their scale.
/// \param wkt     what lies beside the mesh; empty = nothing
/// \param origin  in the system's coordinates; heights are ellipsoidal where the system has none of its own, and then in
///                its horizontal unit
/// \param half    half the size of the site
SiteFrame site_frame(const std::string& wkt, const Double3& origin, const Double3& half);

}  // namespace tessera
