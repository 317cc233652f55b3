#include <vector>

#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "tools/commands.h"

int main(int argc, char** argv) {
  using namespace tessera;
  configure_allocator(core_count());
  const std::vector<cli::Command> jobs = {
      reconstruct_command(), resurface_command(), csg_command(),    merge_command(),
      smooth_command(),      decimate_command(),  remesh_command(), resample_command(),
      deform_command(),      tiles_command(),     field_command(),  bake_command(),
  };
  // clang-format off
  const std::vector<cli::Command> commands = {
      // one line per command, in the order of the help
      plan_command(),
      reconstruct_command(),
      resurface_command(),
      csg_command(),
      field_command(),
      merge_command(),
      smooth_command(),
      decimate_command(),
      remesh_command(),
      resample_command(),
      deform_command(),
      bake_command(),
      tiles_command(),
      view_command(),
      submit_command(jobs),
      status_command(),
      cancel_command(),
      task_command(),
      watch_command(),
      check_command(),
      render_command(),
      report_command(),
      volume_command(),
      raster_command(),
      contours_command(),
      section_command(),
      classify_command(),
      deviate_command(),
      change_command(),
      info_command(),
      convert_command(),
      parameterize_command(),
      synth_command(),
      doctor_command(),
  };
  // clang-format on
  return cli::run("tessera", "Tessera turns huge 3D scans into meshes, out of core.", commands, argc, argv);
}
