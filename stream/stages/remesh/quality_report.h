/// \file quality_report.h
/// The shape of triangles (kernels/remesh/triangle_quality.h) on its way through journal and report.
#pragma once

#include "kernels/remesh/triangle_quality.h"
#include "stream/files/json.h"

namespace tessera {

/// Every count, for the journal, and back.
Json quality_sums(const TriangleQuality& quality);
TriangleQuality quality_of(const Json& sums);

/// Means and shares for people, and histograms. \param target  length of edges, scan units
Json quality_report(const TriangleQuality& quality, double target);

}  // namespace tessera
