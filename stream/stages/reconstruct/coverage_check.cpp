#include "stream/stages/reconstruct/coverage_check.h"

#include <memory>

#include "stream/files/json.h"
#include "stream/files/scratch_folder.h"
#include "stream/formats/points/point_source.h"
#include "stream/import/import_mesh.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/stage_runner.h"
#include "stream/runtime/stop.h"
#include "stream/stages/coverage/coverage_stage.h"
#include "stream/stages/reconstruct/reconstruct_job.h"

namespace tessera {

Json measure_coverage(const std::filesystem::path& mesh, const std::vector<std::string>& scans,
                      const RunOptions& run) {
  const ScratchFolder scratch(run.temp, "coverage");
  JobState state;
  state.work = scratch.path();
  state.output = scratch.path() / "mesh.ply";  // of a picture that goes with the folder
  state.inputs = expand_inputs(scans);
  ReconstructOptions options;
  state.settings = to_settings(options);
  state.run = run;
  // The passes of a job up to what it keeps of the scan; nothing after them is to be forecast.
  std::vector<StageEntry> stages;
  for (StageEntry& entry : reconstruct_stages(options)) {
    const std::string name = entry.name;
    if (name != "forecast") stages.push_back(std::move(entry));
    if (name == "seen") break;
  }
  run_stages(state, stages, throw_if_stopped);
  const auto faces = [&](const JobState& s) {
    return stored_faces(import_mesh(mesh, scratch.path(), "mesh", run, throw_if_stopped),
                        Plan::of_work(s.work).lattice);
  };
  Json found =
      run_stages(state, {{"coverage", [&](const JobState& s) { return make_coverage_stage(s, faces); }}},
                 throw_if_stopped)
          .back();
  found.erase("picture");
  return found;
}

}  // namespace tessera
