/// \file volume_page.h
/// The page of `volume`: figures by polygon with what they may be off, and the polygons from above.
#pragma once
#include <filesystem>
#include <string>

#include "stream/page/survey_page.h"
#include "stream/volume/mesh_volume.h"

namespace tessera {

/// \param base  as it was given: "plane:251.5", or a mesh
/// \throws InputError for polygons that are no longer what they were
SurveyPage volume_page(const MeshVolumes& volumes, const std::filesystem::path& mesh, const std::string& base,
                       const VolumeOptions& options);

}  // namespace tessera
