#include "stream/stages/reconstruct/site_after.h"

#include <algorithm>
#include <utility>

#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/work_dir.h"

namespace tessera {

SiteForecast forecast_site(const Plan& plan, const JobState& reconstruction, const TilesOptions& tiles) {
  MeshSize mesh{plan.faces_estimate / 2, plan.faces_estimate};
  if (reconstruct_options(reconstruction).decimates()) mesh = {};
  return {tiles_needs(reconstruction.run, tiles, mesh), tiles_disk(tiles, mesh)};
}

void require_site(const SiteForecast& site, const Forecast& mesh, const JobState& reconstruction,
                  const std::filesystem::path& tileset) {
  const std::uint64_t base = MemoryBudget::expected_base();
  const MemoryBudget budget(reconstruction.run.memory_bytes, base);
  for (const StageNeed& need : site.needs) budget.require(need.sure, "stage " + need.stage + " of the site");

  const std::filesystem::path folder = tileset.parent_path();
  const std::filesystem::path work = work_path(tileset, reconstruction.run.temp);
  // What lies in the work directory now is gone by then.
  const std::uint64_t goes = reconstruction.run.keep ? 0 : bytes_below(reconstruction.work);
  const DiskNeed needs[] = {
      {reconstruction.output.parent_path(), mesh.output_bytes - std::min(goes, mesh.output_bytes),
       "the mesh " + reconstruction.output.string()},
      {folder.parent_path(), site.disk.site, "the site " + folder.string()},
      {reconstruction.run.temp.empty() ? folder.parent_path() : work.parent_path(), site.disk.work,
       "its work directory " + work.string()}};
  if (site.disk.site > 0) require_disk(needs, kLargerDisk);
}

void expect_site(JobDescription& reconstruction, const TilesOptions& tiles,
                 const std::filesystem::path& tileset, const std::filesystem::path& report) {
  for (StageEntry& entry : reconstruction.stages) {
    if (entry.name != "distribute") continue;
    entry.make = [=, make = entry.make](const JobState& state) {
      require_site(forecast_site(Plan::of_work(state.work), state, tiles), Forecast::of_work(state.work),
                   state, tileset);
      return make(state);
    };
  }
  reconstruction.summarise = [=, summarise = reconstruction.summarise](Json& all) {
    summarise(all);
    all["tiles"] = {{"path", json_text(tileset)}, {"report", json_text(report)}};
  };
}

}  // namespace tessera
