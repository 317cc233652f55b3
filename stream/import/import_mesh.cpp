#include "stream/import/import_mesh.h"

#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/stage_runner.h"

namespace tessera {

MeshStore import_mesh(const std::filesystem::path& mesh, const std::filesystem::path& work,
                      const std::string& folder, const RunOptions& run,
                      const std::function<void()>& check_stop, Json* report) {
  JobState state;
  state.work = work;
  state.inputs = {mesh};
  state.run = run;
  const std::vector<StageEntry> stages = import_stages({0, folder});
  const std::vector<Json> reports = run_stages(state, stages, check_stop);
  if (report) {
    *report = Json::object();
    for (std::size_t s = 0; s < stages.size(); ++s) (*report)[stages[s].name] = reports[s];
  }
  return open_imported_mesh(work, folder);
}

}  // namespace tessera
