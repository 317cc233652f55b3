#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/job_report.h"
#include "stream/stages/merge/merge_job.h"
#include "stream/stages/merge/merge_stages.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

void run_merge(const MergeOptions& given, JobState state) {
  cli::require_output(state.output);
  require_mesh_extension(state.output);
  if (state.inputs.size() < 2) throw UsageError("merge takes two meshes or more, and got one");
  if (state.inputs.size() > kMaxMerged)
    throw UsageError("merge takes " + std::to_string(kMaxMerged) +
                     " meshes at most: merge some of them first");
  read_priority(given.priority, state.inputs);
  MergeOptions options = given;
  options.meshes = state.inputs.size();
  state.settings = to_settings(options);
  const Json report = run_job(state, merge_job(options), cli::stderr_sink());
  if (state.run.verbosity < 0) return;
  const Json mesh = report.value("mesh", Json::object());
  const Json merge = report.value("merge", Json::object());
  const auto count = [&](const char* stage, const char* key) {
    return merge.value(stage, Json::object()).value(key, std::uint64_t{0});
  };
  fmt::print("{}: {} vertices, {} faces, {} of them new along joints of {} edges, {}\n",
             state.output.string(), mesh.value("vertices", std::uint64_t{0}),
             mesh.value("faces", std::uint64_t{0}), count("strip", "faces") + count("zip", "stitches"),
             count("joints", "joint_edges"), cost_text(report));
}

}  // namespace

cli::Command merge_command() {
  return cli::job_command<MergeOptions>("merge",
                                        "Overlapping meshes, not quite matching, of any resolution become "
                                        "one: the better one stays, a band along the "
                                        "joints is made anew. Resumable.",
                                        "the mesh to write: .ply, .obj, .stl, .glb, .3mf, .vtu or .msh",
                                        run_merge);
}

}  // namespace tessera
