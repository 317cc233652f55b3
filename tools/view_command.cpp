#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/scratch_folder.h"
#include "stream/files/system_reason.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/page/view_page.h"
#include "stream/runtime/memory_budget.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

struct ViewArguments {
  std::vector<std::string> inputs;
  fs::path output;
  fs::path viewer;
  std::uint32_t port = 0;
  bool force = false;
  ViewOptions options;
};

constexpr std::uintmax_t kMaxTileset = std::uintmax_t{1} << 30;  // the server hands it out whole

/// The folder with viewer.html and serve.py: as installed, else as built beside this program.
fs::path viewer_folder(const fs::path& given) {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error).parent_path();
  std::vector<fs::path> candidates = {program / "../share/tessera/viewer", program / "../viewer"};
  if (!given.empty()) candidates = {given};
  for (const fs::path& candidate : candidates)
    if (fs::is_regular_file(candidate / "viewer.html", error) &&
        fs::is_regular_file(candidate / "serve.py", error))
      return candidate.lexically_normal();
  throw UsageError(
      fmt::format("the viewer's bundle is missing{}: run tools/viewer/build once (it needs node 18 or later, "
                  "npm and network: apt "
                  "install nodejs npm)",
                  given.empty() ? "" : " in " + given.string()));
}

/// A tileset's JSON, as far as it tells that it is one.
void require_tileset(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error))
    throw InputError(path.string() + ": is not there: name the folder of a tileset, or its tileset.json");
  if (fs::file_size(path, error) > kMaxTileset)
    throw InputError(path.string() + ": too large for a tileset: cut it into several");
  bool has_root = false, has_asset = false;
  const auto note = [&](int depth, nlohmann::json::parse_event_t event, nlohmann::json& value) {
    if (event == nlohmann::json::parse_event_t::key && depth == 1) {
      has_root = has_root || value == "root";
      has_asset = has_asset || value == "asset";
    }
    return depth <= 1;  // what lies deeper is the browser's
  };
  const nlohmann::json top = nlohmann::json::parse(read_text(path), note, false);
  if (top.is_discarded() || !has_root || !has_asset)
    throw InputError(path.string() + ": is no tileset of 3D Tiles (JSON with asset and root)");
}

std::string percent_encoded(const std::string& name) {
  std::string out;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '.' || c == '_';
    out += plain ? std::string(1, c) : fmt::format("%{:02X}", byte);
  }
  return out;
}

/// Becomes the server, which has the page open; what is in memory goes, and signals reach it alone.
[[noreturn]] void serve(const fs::path& viewer, const fs::path& page, const fs::path& site,
                        std::uint32_t port, std::optional<ScratchFolder>& scratch) {
  const int file = ::open(page.c_str(), O_RDONLY);
  if (file < 0) throw InputError(page.string() + ": " + os_reason(errno));
  scratch.reset();  // the descriptor keeps the page
  const std::string script = (viewer / "serve.py").string(), descriptor = std::to_string(file),
                    at = std::to_string(port);
  const std::string folder = site.string();
  std::vector<const char*> words = {"python3", "-I", "-S", script.c_str(), descriptor.c_str(), at.c_str()};
  if (!folder.empty()) words.push_back(folder.c_str());
  words.push_back(nullptr);
  std::fflush(nullptr);
  ::execvp(words[0], const_cast<char* const*>(words.data()));
  throw UsageError(fmt::format("python3 does not start ({}), and serves the page: apt install python3{}",
                               os_reason(errno), site.empty() ? ", or write it to a file with -o" : ""));
}

void view_tiles(const ViewArguments& a, const fs::path& input, const fs::path& viewer) {
  if (!a.output.empty()) throw UsageError("-o: a page holds a mesh, tiles are served: leave -o out");
  if (!a.options.deviation.empty() || !a.options.uncertain.empty())
    throw UsageError("--deviation and --uncertain are for meshes; tiles show what they carry");
  const fs::path tileset =
      fs::absolute(fs::is_directory(input) ? input / "tileset.json" : input).lexically_normal();
  require_tileset(tileset);
  const fs::path site = tileset.parent_path();
  std::optional<ScratchFolder> scratch(std::in_place, a.options.temp, "view");
  const fs::path page = scratch->path() / "page.html";
  write_tiles_view(page, viewer / "viewer.html", site.filename().string(),
                   "site/" + percent_encoded(tileset.filename().string()), a.options.up);
  serve(viewer, page, site, a.port, scratch);
}

void view_mesh(const ViewArguments& a, const fs::path& input, const fs::path& viewer) {
  const bool cloud = a.options.deviation.empty() && a.options.uncertain.empty() && is_deviation_cloud(input);
  if (!cloud) require_viewable(input);
  const auto write = cloud ? write_points_view : write_mesh_view;
  if (!a.options.deviation.empty()) open_mesh_file(a.options.deviation);
  if (!a.output.empty()) {
    write(fs::absolute(a.output), viewer / "viewer.html", input, a.options);
    fmt::print("{}\n", a.output.string());
    return;
  }
  std::optional<ScratchFolder> scratch(std::in_place, a.options.temp, "view");
  const fs::path page = scratch->path() / "page.html";
  write(page, viewer / "viewer.html", input, a.options);
  serve(viewer, page, {}, a.port, scratch);
}

void run_view(ViewArguments a) {
  if (a.inputs.empty())
    throw UsageError("nothing to view: name a mesh, or the folder of a tileset: tessera view site/");
  if (a.inputs.size() > 1) throw UsageError("one thing is viewed at a time");
  const fs::path input = a.inputs.front();
  std::error_code error;
  if (!fs::exists(input, error)) throw InputError(input.string() + ": is not there");
  if (a.options.tolerance < 0.0) throw UsageError("--tolerance must not be negative");
  if (a.options.deviation.empty() && a.options.with_sign)
    throw UsageError("--signed is for the colours of --deviation");
  if (a.options.deviation.empty() && a.options.tolerance != 0.0 && !has_deviations(input))
    throw UsageError("--tolerance is for the colours of --deviation, and of files that deviate wrote");
  if (!a.options.deviation.empty() && !a.options.uncertain.empty())
    throw UsageError("--uncertain: leave it out with --deviation, or that with it");
  if (!a.output.empty() && a.output.extension() != ".html" && a.output.extension() != ".htm")
    throw UsageError("-o " + a.output.string() + ": a page is written: end its name in .html");
  if (!a.output.empty())
    cli::check_line_writes({input, a.options.deviation, a.options.uncertain},
                           {{a.output, "-o", existing_by(a.force || is_view(a.output))}});
  const fs::path viewer = viewer_folder(a.viewer);
  if (a.options.memory_bytes == 0) a.options.memory_bytes = detect_memory_cap().bytes;
  if (a.options.temp.empty())
    a.options.temp = a.output.empty() ? fs::temp_directory_path() : fs::absolute(a.output).parent_path();
  const bool is_tileset = fs::is_directory(input, error) || input.extension() == ".json";
  (is_tileset ? view_tiles : view_mesh)(a, input, viewer);
}

}  // namespace

cli::Command view_command() {
  auto arguments = std::make_shared<ViewArguments>();
  ViewArguments& a = *arguments;
  OptionTable t;
  t.add("inputs", &a.inputs,
        "a mesh of up to 2 M faces, points with deviations (PLY that deviate wrote), or the folder of a "
        "tileset (3D Tiles) or its tileset.json")
      .positional();
  cli::add_output(t, a.output, "write one self-contained page of a mesh, .html; default: serve it");
  t.add("port", &a.port, "of the local server; 0 = a free one").within(0, 65535);
  t.add("up", &a.options.up, "which axis is up").one_of({"x", "y", "z"});
  t.add("deviation", &a.options.deviation,
        "colour by the distance to this mesh, instead of by what the mesh carries");
  t.add("uncertain", &a.options.uncertain,
        "OUT.uncertain.ply of a reconstruction: where the sides of its points were in doubt");
  t.add("tolerance", &a.options.tolerance,
        "of deviations: end of the scale of colours, scan units; 0 = 99th percentile");
  t.add("signed", &a.options.with_sign, "with --deviation: red in front of the reference, blue behind it");
  t.add("memory", &a.options.memory_bytes,
        "cap on the peak resident memory; default: the smallest limit of this machine x 0.8")
      .bytes();
  t.add("temp", &a.options.temp, "folder for temporary files; default: beside the output, or the system's");
  t.add("viewer", &a.viewer, "folder of the viewer's bundle; default: where it was built or installed");
  cli::add_force(t, a.force);
  return {"view", "Turn, walk through, cut and measure a mesh or a site of 3D Tiles in the browser.", t,
          [arguments] { run_view(*arguments); }};
}

}  // namespace tessera
