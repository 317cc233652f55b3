/// \file quality_report.h
/// The shape of triangles (kernels/remesh/triangle_quality.h) on its way through journal and report.
#pragma once
#include <nlohmann/json_fwd.hpp>

#include "kernels/remesh/triangle_quality.h"

namespace tessera {

/// Every count, for the journal, and back.
nlohmann::json quality_sums(const TriangleQuality& quality);
TriangleQuality quality_of(const nlohmann::json& sums);

/// Means and shares for people, and histograms. \param target  length of edges, scan units
nlohmann::json quality_report(const TriangleQuality& quality, double target);

}  // namespace tessera
