/// \file area_sketch.h
/// Polygons of a survey seen from above, numbered as its tables name them.
#pragma once
#include <filesystem>

#include "stream/page/survey_page.h"

namespace tessera {

/// \param areas  GeoJSON as ClipPolygon reads it \throws InputError
PageDrawing area_sketch(const std::filesystem::path& areas);

}  // namespace tessera
