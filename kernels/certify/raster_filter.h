/// \file raster_filter.h
/// Which faces of one surface a raster of the other one settles: the quick filter in front of the certificate.
/// In the spirit of Botsch, Bommes, Vogel, Kobbelt, "GPU-based tolerance volumes for mesh processing", 2004 (thesis 3.3),
/// but scan-converted, layer by layer: no voxel is searched, and nothing is sampled, so nothing can slip through.
///
/// The reference is drawn along each axis into an image of square pixels. What it has over a pixel are layers: a plane
/// and, about that plane, the range of heights that all faces of one sheet have over the pixel, whole faces that only
/// touch it included. A sheet is what connected edges join of the faces that look along the axis, up or down.
///
/// Why a layer proves. All faces of a sheet have the same orientation, seen along the axis, so how often they
/// cover a point is a degree: it only changes at the sheet's boundary. Where no boundary edge touches a pixel
/// and some face covers a part of it, the sheet covers all of it. So every point of the pixel has a point of the
/// reference over it, within the layer's range of heights.
///
/// A face is drawn along the axis that it looks along most. Over each pixel that it touches its plane and that of the layer
/// are apart by a linear function, largest at a corner of a rectangle around what it has there; with the range that
/// bounds the distance along the axis, and so the distance. Where the reference is steep a layer is also looked at across: the foot of the
/// perpendicular on the layer's plane lies over the pixel or one around it, and if the same sheet covers all nine, the distance
/// is at most that to the plane and the range of the nine about it. What no layer proves stays in doubt.
///
/// Rounding. u = 2^-53, R the largest extent; pixels grow by 2^-20 of their size, which is more than any crossing
/// of an edge and a row is off (u R and less). A face's plane is used where its angles are not below 2^-20, so
/// heights on it are right within 2^-26 R; that, and 2^-10 of the tolerance for single precision, are taken off the tolerance.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/certify/certificate.h"

namespace tessera {

struct RasterFilterReport {
  std::uint64_t faces = 0;    ///< of the surface that meet the core
  std::uint64_t decided = 0;  ///< of these
  std::uint64_t layers = 0;   ///< drawn, over all pixels
};

/// Side of the pixels for two surfaces, scan units: about two thirds of an edge of the finer one, and a quarter of the tolerance at
/// least. \pre  some face
double raster_pixel(const SurfaceFaces& a, const SurfaceFaces& b, double tolerance);

/// The faces whose part in the core is not seen to stay within the tolerance of the reference, ascending. All others
/// do, by 2^-11 of it.
/// \param core       has a volume; the reference is complete within the tolerance of it
/// \param origin     subtracted from all heights: near the core
/// \param tolerance  > 0
/// \param pixel      > 0; any is right
/// \post  a pure function of the arguments
/// \cost  about 0.5 us per face of either surface; raster_filter_bytes() of the reference
std::vector<std::uint32_t> raster_doubts(const SurfaceFaces& surface, const Box3& core,
                                         const SurfaceFaces& reference, const Double3& origin,
                                         double tolerance, double pixel,
                                         RasterFilterReport* report = nullptr);

/// Bytes that raster_doubts() takes at most, for `faces` of both surfaces together.
[[nodiscard]] std::uint64_t raster_filter_bytes(std::uint64_t faces);

}  // namespace tessera
