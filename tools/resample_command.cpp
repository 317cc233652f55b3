#include <fmt/format.h>

#include <memory>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/job_report.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/resample/blend_file.h"
#include "stream/stages/resample/resample_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

struct ResampleArguments {
  std::vector<std::string> words;
  std::string blends = "auto";
  std::filesystem::path profile;
  ResampleOptions options;
  JobState state;
};

void print(const ResampleArguments& a, const Json& report) {
  const Json& done = report.at("resampled");
  fmt::print("{}: {} of {} blends resampled, {} faces for {}, {}\n", a.state.output.string(),
             done.at("changed").get<std::uint64_t>(),
             done.at("changed").get<std::uint64_t>() + done.at("left").get<std::uint64_t>(),
             done.at("faces_added").get<std::uint64_t>(), done.at("faces_removed").get<std::uint64_t>(),
             cost_text(report));
  double before = 0.0, after = 0.0;
  std::uint64_t edges = 0;
  for (const Json& blend : done.at("blends")) {
    if (!blend.at("changed").get<bool>()) continue;
    const auto n = blend.at("jumps_before").at("along").at("edges").get<std::uint64_t>();
    edges += n;
    before += static_cast<double>(n) * blend.at("jumps_before").at("along").at("variance").get<double>();
    after += static_cast<double>(n) * blend.at("jumps_after").at("along").at("variance").get<double>();
  }
  // An edit that ends within the blend turns along it on purpose.
  if (edges > 0 && !a.options.edits())
    fmt::print("normal jumps along blends: variance {:.3g} before, {:.3g} now (radians squared)\n",
               before / static_cast<double>(edges), after / static_cast<double>(edges));
  const Json& certificate = report.at("certificate");
  if (certificate.at("certified_max").is_number())
    fmt::print("distance: at most {} both ways, proven\n",
               bound_text(certificate.at("certified_max").get<double>()));
}

void run_resample(ResampleArguments& a) {
  const std::filesystem::path input = [&] {
    cli::require_inputs(a.words);
    a.state.inputs.assign(a.words.begin(), a.words.end());
    return cli::one_input(a.state.inputs, "resampled");
  }();
  cli::require_output(a.state.output);
  require_mesh_extension(a.state.output);
  a.state.also_read = cli::also_read({});
  if (a.blends != "auto") {
    a.state.also_read.push_back(a.blends);
    a.options.blends = read_curves_text(a.blends);
  }
  if (!a.profile.empty()) {
    a.state.also_read.push_back(a.profile);
    a.options.profile = read_profile_text(a.profile);
  }
  a.options.validate();
  a.state.settings = to_settings(a.options);
  const Json report = run_job(a.state, resample_job(a.options), cli::stderr_sink());
  if (a.state.run.verbosity < 0) return;
  cli::print_repairs(input.string(), report);
  print(a, report);
}

}  // namespace

cli::Command resample_command() {
  auto arguments = std::make_shared<ResampleArguments>();
  ResampleArguments& a = *arguments;
  OptionTable table;
  cli::add_inputs(table, a.words);
  cli::add_output(table, a.state.output, "the mesh to write: .ply, .obj, .stl, .glb, .3mf, .vtu or .msh");
  table.add("blends", &a.blends, "auto: found by their curvature; or a JSON file with points along each")
      .shown_as("auto|FILE");
  table.add("profile", &a.profile,
            "JSON file with the knots of a curve that blends get between their flanks");
  table.append(option_table(a.options));
  table.append(option_table(a.state.run));
  return {
      "resample",
      "Fillets and sharp edges of a mesh of any size get triangles along them, in place of scattered ones: "
      "no normal noise, within a proven tolerance; or another radius. All other vertices keep their bytes. "
      "Resumable.",
      table, [arguments] { run_resample(*arguments); }};
}

}  // namespace tessera
