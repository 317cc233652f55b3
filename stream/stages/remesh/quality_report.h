/// \file quality_report.h
/// The shape of triangles (kernels/remesh/triangle_quality.h) in reports, and what remeshing did.
#pragma once

#include "kernels/remesh/remesh.h"
#include "kernels/remesh/triangle_quality.h"
#include "stream/files/json.h"

namespace tessera {

/// Means and shares for people, and histograms. \param target  length of edges, scan units
Json quality_report(const TriangleQuality& quality, double target);

/// What remeshing a block did and refused, as the journal and the report count it.
[[nodiscard]] Json remesh_counts(const RemeshReport& r);
// In addition, of passes that raise angles and of those that even lengths.
Json raised_counts(const RemeshReport& report);
Json evened_counts(const RemeshReport& report);

}  // namespace tessera
