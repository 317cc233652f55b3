
#include "stream/files/json.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/site.h"

namespace tessera {
namespace {

void run_tiles(const TilesOptions& options, JobState state) {
  const std::filesystem::path input = cli::one_input(state.inputs, "cut into tiles");
  cli::require_output(state.output);
  const cli::Site site(state.output, "-o");
  const Json report = site.make(options, state, false);
  if (state.run.verbosity < 0) return;
  cli::print_repairs(input.string(), report);
  cli::print_site(site, report);
}

}  // namespace

cli::Command tiles_command() {
  return cli::job_command<TilesOptions>(
      "tiles",
      "A mesh of any size becomes 3D Tiles: levels of detail that browsers stream, with proven errors.",
      "the folder to write: its tileset.json is what viewers open", run_tiles);
}

}  // namespace tessera
