/// \file distance_samples.h
/// The mean of a distance, measured: points spread evenly over the area of a surface, each with its distance to the
/// closest face of the other one. Bounds (certificate.h) tell the largest distance and nothing of the mean: what proves
/// a piece is often a face far from the closest.
///
/// Every point stands for the same area, so the mean of the squares estimates their integral without bias. The area is
/// taken face after face and divided into strata of one point each; within a face points follow the R2 sequence
/// (Roberts 2018), so that many points on one face leave no gaps.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/certify/certificate.h"

namespace tessera {

struct SurfaceSamples {
  std::vector<Double3> at;          ///< world
  std::vector<std::uint32_t> face;  ///< on which each lies, ascending
};

/// \param core  only what lies in this box, or nullptr
/// \return `count` points; none where nothing of the surface in the core has an area (of segments, a length)
[[nodiscard]] SurfaceSamples spread_samples(const SurfaceFaces& surface, const Box3* core, std::size_t count);

/// How many points the report of these two surfaces is made of, at most options.samples.
[[nodiscard]] std::size_t samples_of(const CertificateOptions& options, std::size_t faces,
                                     std::size_t other_faces);

/// Fills what the report tells of means: samples, square integral and histogram; and the largest distance found, where a
/// point is farther. \pre  report.area is known
void measure_samples(const SurfaceSamples& samples, bool segments, const ClosestFaces& reference,
                     const CertificateOptions& options, DeviationReport& report);

/// The same against that part of the other surface that the bounds say is enough.
/// \param bound  per face of the surface, as certify_deviation()'s face_bound
void measure_samples(const SurfaceFaces& surface, const SurfaceFaces& other, const Box3* core,
                     const Double3& origin, std::span<const float> bound, const CertificateOptions& options,
                     DeviationReport& report);

}  // namespace tessera
