#include "tools/frame/site.h"

#include <algorithm>
#include <utility>

#include <unistd.h>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/runtime/job_report.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/work_dir.h"
#include "stream/stages/tiles/tiles_job.h"
#include "tools/frame/cli.h"

namespace tessera::cli {
namespace {

namespace fs = std::filesystem;

/// Whether `path` is the folder or lies in it.
bool is_in(const fs::path& path, const fs::path& folder) {
  const fs::path inside = fs::weakly_canonical(path).lexically_relative(fs::weakly_canonical(folder));
  return !inside.empty() && *inside.begin() != "..";
}

/// Files of a site that was written, without what else lies in its folder.
struct SiteFiles {
  std::uint64_t count = 0, bytes = 0;
};
SiteFiles files_of(const fs::path& folder) {
  SiteFiles files;
  const auto add = [&](const fs::path& path) {
    std::error_code gone;
    const std::uintmax_t bytes = fs::file_size(path, gone);
    if (!gone) ++files.count, files.bytes += bytes;
  };
  add(folder / "tileset.json");
  if (fs::is_directory(folder / "tiles"))
    for (const auto& entry : fs::recursive_directory_iterator(folder / "tiles"))
      if (entry.is_regular_file()) add(entry.path());
  return files;
}

}  // namespace

Site::Site(const fs::path& folder, std::string option)
    : folder_(fs::absolute(folder).lexically_normal()), option_(std::move(option)) {
  if (!folder_.has_filename()) folder_ = folder_.parent_path();
}

JobState Site::tiles_state(const JobState& state) const {
  JobState tiles = state;
  tiles.output = tileset();
  if (option_ != "-o" || tiles.run.report.empty()) tiles.run.report = report();
  return tiles;
}

void Site::check(const JobState& state) const {
  for (const fs::path& input : state.inputs)
    if (is_in(input, folder_ / "tiles"))
      throw UsageError(fmt::format(
          "{} {}: the input {} lies among the tiles that would be written there: name another folder",
          option_, folder_.string(), input.string()));
  check_folder(tiles_state(state));
}

void Site::check_folder(const JobState& tiles) const {
  if (!fs::exists(folder_)) {
    const fs::path parent = folder_.parent_path();
    if (!fs::is_directory(parent))
      throw UsageError(fmt::format("{} {}: this folder cannot be made: there is no folder for it", option_,
                                   folder_.string()));
    if (::access(parent.c_str(), W_OK) != 0)
      throw UsageError(fmt::format("{} {}: this folder cannot be made: {} cannot be written to", option_,
                                   folder_.string(), parent.string()));
    return;
  }
  if (!fs::is_directory(folder_))
    throw UsageError(
        fmt::format("{} {}: is a file: tiles want a folder of their own", option_, folder_.string()));
  const bool ours = fs::exists(tiles.output) || fs::exists(work_path(tiles.output, tiles.run.temp));
  if (!ours && !fs::is_empty(folder_) && !tiles.run.force)
    throw UsageError(
        fmt::format("{} {}: this folder is there and not empty: name a new one, or give --force to put tiles "
                    "among what it holds",
                    option_, folder_.string()));
}

void Site::check_before_mesh(const JobState& state) const {
  check(state);
  const JobState tiles = tiles_state(state);
  const fs::path mesh = fs::absolute(state.output).lexically_normal();
  const fs::path work = work_path(mesh, state.run.temp);
  for (const fs::path& other : {mesh, state.run.temp.empty() ? work : fs::absolute(state.run.temp)})
    if (is_in(other, folder_))
      throw UsageError(fmt::format("{} {}: {} lies in it: tiles want a folder of their own", option_,
                                   folder_.string(), other.string()));
  if (is_in(folder_, work) || is_in(folder_, mesh))
    throw UsageError(
        fmt::format("{} {}: lies where the mesh is made: name another folder", option_, folder_.string()));
  if (const bool older = fs::exists(tiles.output); fs::exists(tiles.run.report) && !older && !state.run.force)
    throw UsageError(
        fmt::format("{} {}: {} is there already, where the report of the site goes: move it away, "
                    "or give --force to overwrite it",
                    option_, folder_.string(), tiles.run.report.string()));
  const bool holds_site = fs::exists(tiles.output) || fs::exists(work_path(tiles.output, tiles.run.temp));
  if (holds_site && !fs::exists(mesh) && !state.run.force)
    throw UsageError(fmt::format(
        "{} {}: holds the site of another mesh, {} is still to be made: name a new folder, or give "
        "--force to overwrite it",
        option_, folder_.string(), mesh.string()));
}

Json Site::make(const TilesOptions& options, JobState state, bool checked) const {
  state = tiles_state(state);
  state.settings = to_settings(options);
  if (!checked) check(state);
  const bool made = !fs::exists(folder_);
  if (std::error_code error; made && !fs::create_directory(folder_, error))
    throw UsageError(fmt::format("{} {}: this folder cannot be made: {}", option_, folder_.string(),
                                 error ? error.message() : "there is no folder for it"));
  const bool was_there =
      fs::exists(state.output) && !state.run.force && !fs::exists(work_path(state.output, state.run.temp));
  Json report;
  try {
    report = run_job(state, tiles_job(options), stderr_sink());
  } catch (...) {
    std::error_code ignored;  // what is in it stays, and so does it
    if (made) fs::remove(folder_, ignored);
    throw;
  }
  report["resumed_done"] = was_there;
  if (!was_there) return report;
  const Json& tiles = report.at("tiles");
  const SiteFiles files = files_of(folder_);
  if (files.count != tiles.at("tiles").get<std::uint64_t>() + tiles.at("tilesets").get<std::uint64_t>() ||
      files.bytes != tiles.at("bytes").get<std::uint64_t>())
    throw UsageError(fmt::format(
        "{} {}: this site was done, but its files are not those that were written: give --force to "
        "write them anew",
        option_, folder_.string()));
  return report;
}

void add_tiles(OptionTable& table, fs::path& folder) {
  OptionTable more("What it writes beside the mesh");
  more.add("tiles", &folder,
           "also a site of 3D Tiles in this folder, made of the finished mesh as by `tessera tiles`")
      .shown_as("DIR");
  table.append(more);
}

void print_site(const Site& site, const Json& report) {
  const Json& tiles = report.at("tiles");
  const Json& levels = tiles.at("levels");
  fmt::print("{}: {} tiles in {} levels of {} faces, {}, {:.2f} bytes a face, {}\n", site.tileset().string(),
             tiles.value("tiles", std::uint64_t{0}), levels.size(), tiles.value("faces", std::uint64_t{0}),
             format_bytes(tiles.value("bytes", std::uint64_t{0})), tiles.value("bytes_per_face", 0.0),
             report.at("resumed_done").get<bool>() ? std::string("done before") : cost_text(report));
  fmt::print("distance and cracks, proven: at most {} with the finest tiles, {} with the root\n",
             bound_text(levels.front().value("geometric_error", 0.0), 3),
             bound_text(levels.back().value("geometric_error", 0.0), 3));
  std::uint64_t pages = 0, texels = 0, bytes = 0;
  std::string quality;
  for (const Json& level : levels) {
    if (!level.contains("texture")) continue;
    const Json& texture = level.at("texture");
    pages += texture.value("pages", std::uint64_t{0});
    texels += texture.value("page_texels", std::uint64_t{0});
    bytes += texture.value("bytes", std::uint64_t{0});
    if (texture.contains("psnr_db"))
      quality += fmt::format("{}{:.1f}", quality.empty() ? "; dB at the points, by level: " : ", ",
                             texture.at("psnr_db").get<double>());
  }
  if (pages > 0)
    fmt::print("textures: {} pages, {} texels, {}{}\n", pages, texels, format_bytes(bytes), quality);
}

}  // namespace tessera::cli
