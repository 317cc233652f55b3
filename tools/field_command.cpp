#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/runtime/job_report.h"
#include "stream/runtime/memory_budget.h"
#include "stream/stages/solid/field_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

void run_field(const FieldJobOptions& given, JobState state) {
  cli::require_output(state.output);
  const std::string extension = given.tolerance > 0.0 ? ".octree" : ".vdb";
  if (state.output.extension() != extension)
    throw UsageError(state.output.string() + ": a field " + (given.tolerance > 0.0 ? "with" : "without") +
                     " --tolerance is written as " + extension);
  if (given.tolerance > 0.0 && given.full)
    throw UsageError("--full and --tolerance: an octree fills the whole box already; leave one of them out");
  FieldJobOptions options = given;
  options.meshes = state.inputs.size();
  state.settings = to_settings(options);
  const Json report = run_job(state, field_job(options), cli::stderr_sink());
  if (state.run.verbosity < 0) return;
  const Json field = report.value("field", Json::object());
  if (given.tolerance > 0.0) {
    fmt::print("{}: {} cells, {} of the {} of a full grid, off by at most {:.2g} at {} samples, h {}, {}\n",
               state.output.string(), field.value("cells", std::uint64_t{0}),
               format_bytes(field.value("bytes", std::uint64_t{0})),
               format_bytes(field.value("full_grid_bytes", std::uint64_t{0})),
               field.value("worst_error", 0.0), field.value("samples", std::uint64_t{0}),
               field.value("h", 0.0), cost_text(report));
    return;
  }
  fmt::print("{}: {} nodes in {} leaves, h {}, {}\n", state.output.string(),
             field.value("nodes", std::uint64_t{0}), field.value("leaves", std::uint64_t{0}),
             field.value("h", 0.0), cost_text(report));
}

}  // namespace

cli::Command field_command() {
  return cli::job_command<FieldJobOptions>(
      "field",
      "Meshes, dirty ones too, become a level set: signed distances near their "
      "surface on a lattice, as OpenVDB, or everywhere; or an adaptive octree of them. Resumable.",
      "the grid to write: .vdb; with --tolerance the octree: .octree", run_field);
}

}  // namespace tessera
