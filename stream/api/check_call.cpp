#include "stream/api/check_call.h"

#include <string>

#include "octree/error.h"
#include "stream/files/path_text.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"

namespace tessera {

Json CheckCall::run() const {
  const auto check_stop = [this] {
    if (go_on && !go_on()) throw StoppedError("stopped by the caller");
  };
  MeshCheckOptions of_check = options;
  if (how.memory_bytes > 0) of_check.memory_bytes = how.memory_bytes;
  if (of_check.temp.empty()) of_check.temp = how.temp;
  of_check.threads = how.threads > 0 ? how.threads : core_count();
  of_check.check_stop = check_stop;
  if (!reference.empty()) compare.validate();
  const auto opened = open_mesh_file(mesh, {.keep_bad_faces = true, .temp = of_check.temp});
  Json report = to_json(check_mesh(*opened, of_check));
  if (!reference.empty()) {
    CompareOptions of_comparison = compare;
    of_comparison.check_stop = check_stop;
    RunOptions of_run = how;
    if (of_run.memory_bytes == 0) of_run.memory_bytes = detect_memory_cap().bytes;
    of_run.threads = of_check.threads;
    const MeshComparison comparison = compare_mesh_files(mesh, reference, of_comparison, of_run);
    report["deviation"] = to_json(comparison);
    report["deviation"]["reference"] = json_text(reference);
    report["deviation"]["complaint"] = comparison.complaint(false);
  }
  report["mesh"] = json_text(mesh);
  if (const auto warnings = opened->warnings(); !warnings.empty()) report["warnings"] = warnings;
  return report;
}

}  // namespace tessera
