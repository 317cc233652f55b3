/// \file site_after.h
/// A reconstruction whose mesh becomes a site of 3D Tiles, by a job of its own, as soon as it is there.
#pragma once
#include <filesystem>

#include "stream/points/plan.h"
#include "stream/runtime/job.h"
#include "stream/stages/reconstruct/forecast.h"
#include "stream/stages/tiles/tiles_needs.h"

namespace tessera {

/// What the job of tiles will take of the mesh that is planned. With a tolerance nobody knows how many faces will be left:
/// only what a mesh of any size takes is told, and disk not at all.
struct SiteForecast {
  std::vector<StageNeed> needs;
  TilesDisk disk;
};
SiteForecast forecast_site(const Plan& plan, const JobState& reconstruction, const TilesOptions& tiles);

/// \param tileset  of the site
/// \throws ResourceError when the cap cannot hold the job of tiles, or the disks not the mesh with what that job takes
void require_site(const SiteForecast& site, const Forecast& mesh, const JobState& reconstruction,
                  const std::filesystem::path& tileset);

/// Asks that before the points are dealt out, and lets the report say where tiles and their own report are.
/// \param report  of the job of tiles
void expect_site(JobDescription& reconstruction, const TilesOptions& tiles,
                 const std::filesystem::path& tileset, const std::filesystem::path& report);

}  // namespace tessera
