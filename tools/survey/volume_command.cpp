#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include "octree/error.h"
#include "stream/check/mesh_volume.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/planned_writes.h"
#include "stream/runtime/memory_budget.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/survey/scan_outputs.h"

namespace tessera {
namespace {

struct VolumeCommand {
  std::filesystem::path mesh;
  std::string base;
  VolumeOptions options;
  double tolerance = -1.0, base_tolerance = -1.0;
  std::filesystem::path csv, json;
  bool force = false;
};

constexpr const char* kPlane = "plane:";
constexpr double kMaxLevel = 1e12;  ///< beyond any survey; what lies so far off has no volume in doubles

/// Reads --base: a level or a mesh.
void read_base(const std::string& base, VolumeOptions& options) {
  const std::string word = kPlane;
  if (base.rfind(word, 0) != 0) {
    options.base = base;
    return;
  }
  std::size_t used = 0;
  try {
    options.level = std::stod(base.substr(word.size()), &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used == 0 || used != base.size() - word.size() || !(std::abs(options.level) <= kMaxLevel))
    throw UsageError("--base " + base + ": give plane:Z with a number, as plane:251.5, or a mesh");
}

void run_volume(const VolumeCommand& command) {
  if (command.mesh.empty())
    throw UsageError("no mesh given; name one: tessera volume new.ply --base old.ply");
  if (command.base.empty()) throw UsageError("--base is missing: an earlier mesh, or plane:Z for a level");
  VolumeOptions options = command.options;
  read_base(command.base, options);
  cli::check_line_writes({command.mesh, options.base, options.areas},
                         {{command.csv, "--csv", existing_by(command.force)},
                          {command.json, "--json", existing_by(command.force)}});
  options.tolerance =
      command.tolerance >= 0.0 ? command.tolerance : proven_tolerance(command.mesh).value_or(-1.0);
  if (!options.base.empty())
    options.base_tolerance = command.base_tolerance >= 0.0 ? command.base_tolerance
                                                           : proven_tolerance(options.base).value_or(-1.0);
  if (options.temp.empty()) options.temp = std::filesystem::temp_directory_path();
  if (options.memory_bytes == 0) options.memory_bytes = detect_memory_cap().bytes;
  const MeshVolumes volumes = measure_volumes(command.mesh, options);
  std::cout << describe(volumes) << std::flush;
  if (!volumes.areas.front().bound)
    std::cout
        << "how far the volumes may be off is unknown: no report beside the meshes proves a distance; give "
           "--tolerance (and --base-tolerance)\n"
        << std::flush;
  write_text_output(command.csv, to_csv(volumes));
  if (command.json.empty()) return;
  Json report = to_json(volumes);
  report["mesh"] = json_text(command.mesh);
  report["base"] = options.base.empty() ? Json(options.level) : Json(json_text(options.base));
  if (options.tolerance >= 0.0) report["tolerance"] = options.tolerance;
  if (!options.base.empty() && options.base_tolerance >= 0.0)
    report["base_tolerance"] = options.base_tolerance;
  write_text_output(command.json, dump_json(report, 2) + "\n");
}

}  // namespace

cli::Command volume_command() {
  auto shared = std::make_shared<VolumeCommand>();
  VolumeCommand& c = *shared;
  OptionTable t;
  t.add("mesh", &c.mesh, "PLY, OBJ, STL, OFF or GLB").positional();
  t.add("base", &c.base,
        "what volumes are counted from: plane:Z, a level; or an earlier mesh, open and seen from above")
      .shown_as("plane:Z|FILE");
  t.add("within", &c.options.areas,
        "polygons (GeoJSON, in the coordinates of the mesh), a row of figures each; default: wherever both "
        "are");
  t.add("tolerance", &c.tolerance,
        "distance that the mesh keeps from its surface, which bounds what the volumes may be off; default: "
        "what its report "
        "proves; -1 = unknown")
      .at_least(-1);
  t.add("base-tolerance", &c.base_tolerance, "the same of the base").at_least(-1);
  t.add("csv", &c.csv, "also write the rows to this file");
  t.add("json,report", &c.json, "also write the result to this file");
  cli::add_force(t, c.force);
  cli::add_threads(t, c.options.threads, "threads; never changes the result");
  t.add("memory", &c.options.memory_bytes, "cap on memory; larger meshes go through --temp").bytes();
  t.add("temp", &c.options.temp, "folder for scratch files; default: the system's");
  return {"volume", "Cut, fill and net volume against a level or an earlier mesh.", t,
          [shared] { run_volume(*shared); }};
}

}  // namespace tessera
