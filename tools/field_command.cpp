#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/runtime/memory_budget.h"
#include "stream/stages/solid/field_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

void run(const FieldJobOptions& given, JobState state) {
  cli::require_output(state.output);
  if (state.output.extension() != ".vdb")
    throw UsageError(state.output.string() + ": a field is written as .vdb");
  FieldJobOptions options = given;
  options.meshes = state.inputs.size();
  state.settings = to_settings(options);
  const nlohmann::json report = run_job(state, field_job(options), cli::stderr_sink());
  if (state.run.verbosity < 0) return;
  const nlohmann::json field = report.value("field", nlohmann::json::object());
  fmt::print("{}: {} nodes in {} leaves, h {}, {:.1f} s, peak {}\n", state.output.string(),
             field.value("nodes", std::uint64_t{0}), field.value("leaves", std::uint64_t{0}),
             field.value("h", 0.0), report.at("wall_s").get<double>(),
             format_bytes(report.at("peak_bytes").get<std::uint64_t>()));
}

}  // namespace

cli::Command field_command() {
  return cli::job_command<FieldJobOptions>(
      "field",
      "Meshes, dirty ones too, become a level set: signed distances near their "
      "surface on a lattice, as OpenVDB. Resumable.",
      "the grid to write: .vdb", run);
}

}  // namespace tessera
