/// \file commands.h
/// Every command of `tessera`, one function per file tools/<command>_command.cpp.
#pragma once
#include <vector>

#include "tools/frame/cli.h"

namespace tessera {

// one line per command, alphabetical
cli::Command cancel_command();
cli::Command bake_command();
cli::Command change_command();
cli::Command check_command();
cli::Command classify_command();
cli::Command contours_command();
cli::Command convert_command();
cli::Command csg_command();
cli::Command decimate_command();
cli::Command deform_command();
cli::Command deviate_command();
cli::Command doctor_command();
cli::Command field_command();
cli::Command info_command();
cli::Command merge_command();
cli::Command parameterize_command();
cli::Command plan_command();
cli::Command raster_command();
cli::Command reconstruct_command();
cli::Command remesh_command();
cli::Command render_command();
cli::Command report_command();
cli::Command resample_command();
cli::Command resurface_command();
cli::Command section_command();
cli::Command smooth_command();
cli::Command status_command();
/// \param jobs  commands whose lines it may be given
cli::Command submit_command(const std::vector<cli::Command>& jobs);
cli::Command synth_command();
cli::Command task_command();
cli::Command tiles_command();
cli::Command view_command();
cli::Command volume_command();
cli::Command watch_command();

}  // namespace tessera
