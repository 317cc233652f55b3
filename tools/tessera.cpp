#include "tools/commands.h"

#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "tools/cli.h"

int main(int argc, char** argv) {
  tessera::configure_allocator(tessera::core_count());
  CLI::App app("Tessera turns huge 3D scans into meshes, out of core.", "tessera");
  app.set_version_flag("--version", "tessera " TESSERA_VERSION);
  app.require_subcommand(1);
  // one line per command, in the order of the help
  tessera::add_plan(app);
  tessera::add_reconstruct(app);
  tessera::add_smooth(app);
  tessera::add_decimate(app);
  tessera::add_task(app);
  tessera::add_check(app);
  tessera::add_render(app);
  tessera::add_info(app);
  tessera::add_convert(app);
  tessera::add_parameterize(app);
  tessera::add_synth(app);

  return tessera::cli::run(app, argc, argv);
}
