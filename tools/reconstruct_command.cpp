#include <fmt/format.h>

#include <memory>
#include <optional>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/textured_mesh_writer.h"
#include "stream/page/report_value.h"
#include "stream/runtime/job_report.h"
#include "stream/runtime/report.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "stream/stages/reconstruct/site_after.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/site.h"

namespace tessera {
namespace {

/// The report of the mesh says what became of its site.
void note_site(const JobState& mesh, const cli::Site& site, const Json& of_site) {
  const std::filesystem::path path = report_path(mesh);
  Json report = parse_json(read_text(path));
  Json tiles = of_site.at("tiles");
  tiles["report"] = json_text(site.report());
  if (report.value("tiles", Json()) == tiles) return;
  report["tiles"] = std::move(tiles);
  write_durably(path, dump_json(report, 1) + "\n");
}

void run_reconstruct(const ReconstructOptions& options, JobState state, const std::filesystem::path& tiles) {
  cli::require_output(state.output);
  options.has_texture() ? require_textured_extension(state.output, options.normal_map)
                        : require_mesh_extension(state.output);
  JobDescription job = reconstruct_job(options);
  std::optional<cli::Site> site;
  if (!tiles.empty()) {
    site.emplace(tiles, "--tiles");
    site->check_before_mesh(state);
    expect_site(job, {}, site->tileset(), site->report());
  }
  const Json report = run_job(state, job, cli::stderr_sink());
  const auto say_mesh = [&] {
    for (const Json& w : report.value("warnings", Json::array()))
      fmt::print(stderr, "tessera: warning: {}\n", w.get<std::string>());
    const Json mesh = report.value("mesh", Json::object());
    fmt::print("{}: {} vertices, {} faces, {}\n", state.output.string(),
               mesh.value("vertices", std::uint64_t{0}), mesh.value("faces", std::uint64_t{0}),
               cost_text(report));
    cli::print_tolerance(report);
    cli::print_smoothing(report);
    cli::print_texture(report);
    if (const std::string ground = ground_text(report); !ground.empty()) fmt::print("{}\n", ground);
    if (const std::string coverage = coverage_text(report); !coverage.empty())
      fmt::print("{}{}\n", coverage,
                 report.at("coverage").at("picture") == true
                     ? "; " + state.output.string() + ".missing.png shows in magenta what is not"
                     : "");
  };
  if (state.run.verbosity >= 0) say_mesh();
  if (!site) return;
  JobState of_site = state;
  of_site.inputs = {std::filesystem::absolute(state.output).lexically_normal()};
  of_site.run.until.clear();
  const Json made = site->make({}, of_site, true);
  note_site(state, *site, made);
  if (state.run.verbosity >= 0) cli::print_site(*site, made);
}

}  // namespace

cli::Command reconstruct_command() {
  const auto tiles = std::make_shared<std::filesystem::path>();
  cli::Command command = cli::job_command<ReconstructOptions>(
      "reconstruct", "A scan becomes a mesh. Run it again to go on after a stop.",
      "the mesh to write: .ply, .obj, .stl, .glb, .3mf, .vtu or .msh",
      [tiles](const ReconstructOptions& options, const JobState& state) {
        run_reconstruct(options, state, *tiles);
      });
  cli::add_tiles(command.options, *tiles);
  return command;
}

}  // namespace tessera
