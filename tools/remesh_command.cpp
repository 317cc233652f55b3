#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <memory>
#include <utility>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/job_report.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/remesh/remesh_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

/// Ends a line with how many of what is left each cause keeps.
void print_causes(std::initializer_list<std::pair<std::uint64_t, const char*>> causes) {
  const char* separator = ": ";
  for (const auto& [left, why] : causes)
    if (left > 0) fmt::print("{}{} {}", separator, left, why), separator = ", ";
  fmt::print("\n");
}

/// What --min-angle left, and why.
void print_small_angles(const Json& report) {
  if (!report.contains("small_angles")) return;
  const Json& angles = report.at("small_angles");
  const auto count = [&](const char* key) { return angles.value(key, std::uint64_t{0}); };
  const std::uint64_t left = count("below"), lines = count("between_lines"), held = count("held"),
                      at = count("at_tolerance");
  fmt::print("angles below {:.4g} degrees: in {} faces before, {} left", angles.value("asked_deg", 0.0),
             count("below_before"), left);
  print_causes({{lines, "between creases or borders that meet at a smaller angle"},
                {at, "where the tolerance locks them"},
                {held, "of the input, kept for the proof"},
                {left - std::min(left, lines + at + held),
                 "that could be raised in no way without a fold or a sharper one"}});
}

/// What --adaptive left uneven, and why.
void print_length_ratios(const Json& report) {
  if (!report.contains("length_ratios")) return;
  const Json& ratios = report.at("length_ratios");
  const auto count = [&](const char* key) { return ratios.value(key, std::uint64_t{0}); };
  const std::uint64_t left = count("beyond"), lines = count("at_lines"), held = count("held"),
                      at = count("at_tolerance");
  fmt::print("neighbours whose edges differ by more than 1 : {:.4g}: at {} edges before, {} of {} left",
             ratios.value("asked", 0.0), count("beyond_before"), left, count("edges"));
  print_causes({{lines, "between vertices on creases or borders"},
                {at, "where the tolerance locks them"},
                {held, "beside faces of the input, kept for the proof"},
                {left - std::min(left, lines + at + held),
                 "that no step evens without a fold, a crossing or a sharper angle"}});
}

void run_remesh(const RemeshJobOptions& options, JobState state) {
  const std::filesystem::path input = cli::one_input(state.inputs, "remeshed");
  cli::require_output(state.output);
  require_mesh_extension(state.output);
  const Json report = run_job(state, remesh_job(options), cli::stderr_sink());
  if (state.run.verbosity < 0) return;
  cli::print_repairs(input.string(), report);
  const Json quality = report.value("quality", Json::object());
  fmt::print("{}: {} faces of {}, edges of {:.4g}, {}\n", state.output.string(),
             report.at("mesh").value("faces", std::uint64_t{0}),
             report.at("input").value("faces", std::uint64_t{0}), quality.value("edge", 0.0),
             cost_text(report));
  fmt::print(
      "angles: {:.2f} degrees from 60 in the mean, smallest {:.2f}, below 25 in {:.3g} % of the faces; edges "
      "{:.1f} "
      "% off; valence 6 at {:.1f} % of the vertices\n",
      quality.value("mean_angle_deviation_deg", 0.0), quality.value("smallest_angle_deg", 0.0),
      100.0 * quality.value("share_below_25_deg", 0.0), 100.0 * quality.value("mean_edge_deviation", 0.0),
      100.0 * quality.value("valence_six_share", 0.0));
  print_length_ratios(report);
  print_small_angles(report);
  const Json& certificate = report.at("certificate");
  if (certificate.at("certified_max").is_number())
    fmt::print("distance: at most {} both ways, proven; rms {:.3g} to the input, {:.3g} back\n",
               bound_text(certificate.at("certified_max").get<double>()),
               certificate.at("mesh_to_reference").at("rms").get<double>(),
               certificate.at("reference_to_mesh").at("rms").get<double>());
  else
    fmt::print("distance: more than {:.4g} somewhere\n", certificate.value("reach", 0.0));
  if (const int again = certificate.value("rounds_again", 0); again > 0)
    fmt::print("the certificate sent parts back {} time{}: the input's faces are kept there\n", again,
               again == 1 ? "" : "s");
}

}  // namespace

cli::Command remesh_command() {
  return cli::job_command<RemeshJobOptions>(
      "remesh",
      "A mesh of any size gets triangles near equilateral with edges of one length, on the same surface.",
      "the mesh to write: .ply, .obj, .stl, .glb, .3mf, .vtu or .msh", run_remesh);
}

}  // namespace tessera
