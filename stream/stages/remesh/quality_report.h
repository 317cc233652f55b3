/// \file quality_report.h
/// The shape of triangles (kernels/remesh/triangle_quality.h) in reports.
#pragma once

#include "kernels/remesh/triangle_quality.h"
#include "stream/files/json.h"

namespace tessera {

/// Means and shares for people, and histograms. \param target  length of edges, scan units
Json quality_report(const TriangleQuality& quality, double target);

}  // namespace tessera
