#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/work_dir.h"
#include "stream/stages/tiles/tiles_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

/// The folder, made if it is not there; refused where it holds something that no job of ours left.
/// \returns true when it was made
bool prepare_folder(const fs::path& site, const JobState& state) {
  const fs::path tiles = fs::weakly_canonical(site) / "tiles";
  for (const fs::path& input : state.inputs)
    if (const fs::path inside = fs::weakly_canonical(input).lexically_relative(tiles);
        !inside.empty() && *inside.begin() != "..")
      throw UsageError(fmt::format(
          "-o {}: the input {} lies among the tiles that would be written there: name another folder",
          site.string(), input.string()));
  if (!fs::exists(site)) {
    std::error_code error;
    if (!fs::create_directory(site, error))
      throw UsageError(fmt::format("-o {}: this folder cannot be made: {}", site.string(),
                                   error ? error.message() : "there is no folder for it"));
    return true;
  }
  if (!fs::is_directory(site))
    throw UsageError(fmt::format("-o {}: is a file: tiles want a folder of their own", site.string()));
  const bool ours = fs::exists(state.output) || fs::exists(work_path(state.output, state.run.temp));
  if (!ours && !fs::is_empty(site) && !state.run.force)
    throw UsageError(
        fmt::format("-o {}: this folder is there and not empty: name a new one, or give --force to put tiles "
                    "among what it holds",
                    site.string()));
  return false;
}

void run(const TilesOptions& options, JobState state) {
  const fs::path input = cli::one_input(state.inputs, "cut into tiles");
  cli::require_output(state.output);
  fs::path site = fs::absolute(state.output).lexically_normal();
  if (!site.has_filename()) site = site.parent_path();
  state.output = site / "tileset.json";
  if (state.run.report.empty()) state.run.report = fs::path(site) += ".report.json";
  const bool made = prepare_folder(site, state);
  nlohmann::json report;
  try {
    report = run_job(state, tiles_job(options), cli::stderr_sink());
  } catch (...) {
    std::error_code ignored;  // what is in it stays, and so does it
    if (made) fs::remove(site, ignored);
    throw;
  }
  if (state.run.verbosity < 0) return;
  cli::print_repairs(input.string(), report);
  const nlohmann::json& tiles = report.at("tiles");
  const nlohmann::json& levels = tiles.at("levels");
  fmt::print("{}: {} tiles in {} levels of {} faces, {}, {:.2f} bytes a face, {:.1f} s, peak {}\n",
             state.output.string(), tiles.value("tiles", std::uint64_t{0}), levels.size(),
             tiles.value("faces", std::uint64_t{0}), format_bytes(tiles.value("bytes", std::uint64_t{0})),
             tiles.value("bytes_per_face", 0.0), report.at("wall_s").get<double>(),
             format_bytes(report.at("peak_bytes").get<std::uint64_t>()));
  fmt::print("distance and cracks, proven: at most {:.3g} with the finest tiles, {:.3g} with the root\n",
             levels.front().value("geometric_error", 0.0), levels.back().value("geometric_error", 0.0));
}

}  // namespace

cli::Command tiles_command() {
  return cli::job_command<TilesOptions>(
      "tiles",
      "A mesh of any size becomes 3D Tiles: levels of detail that browsers stream, with proven errors.",
      "the folder to write: its tileset.json is what viewers open", run);
}

}  // namespace tessera
