#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "octree/error.h"
#include "stream/check/mesh_check.h"
#include "stream/check/mesh_compare.h"
#include "stream/check/mesh_textures.h"
#include "stream/check/truth.h"
#include "stream/files/json.h"
#include "stream/files/output_file.h"
#include "stream/files/path_text.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/page/report_value.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/stages/reconstruct/coverage_check.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/pipes.h"

namespace tessera {
namespace {

struct CheckCommand {
  std::filesystem::path mesh;
  std::string input_format;  ///< of a mesh that comes through a pipe
  std::filesystem::path json;
  MeshCheckOptions options;
  std::filesystem::path truth;
  TruthOptions truth_options;
  std::filesystem::path scan;
  std::filesystem::path reference;
  CompareOptions compare;
  std::string method = "exact";
  bool with_borders = false;
  bool textures = false;
  int threads = 0;
  bool strict = false;
  bool closed = false;
  bool force = false;
};

/// Beside the mesh where that is possible: the system's temporary folder is often small, or memory.
std::filesystem::path scratch_folder(const std::filesystem::path& mesh) {
  const std::filesystem::path folder = mesh.has_parent_path() ? mesh.parent_path() : ".";
  return ::access(folder.c_str(), W_OK) == 0 ? folder : std::filesystem::temp_directory_path();
}

RunOptions run_of(const MeshCheckOptions& options) {
  RunOptions run;
  run.memory_bytes = options.memory_bytes;
  run.temp = options.temp;
  run.threads = options.threads;
  return run;
}

Json check_coverage(const CheckCommand& command, const MeshCheckOptions& options) {
  const Json coverage = measure_coverage(command.mesh, {command.scan.string()}, run_of(options));
  const std::string said = coverage_text({{"coverage", coverage}});
  std::cout << (said.empty() ? "coverage: not measured, the points of the scan tell no spacing" : said)
            << std::endl;
  return coverage;
}

MeshComparison compare_with_reference(const CheckCommand& command, const MeshCheckOptions& options) {
  CompareOptions compare = command.compare;
  compare.check_stop = throw_if_stopped;
  compare.method = command.method == "raster" ? CompareMethod::kRaster
                   : command.method == "auto" ? CompareMethod::kAuto
                                              : CompareMethod::kExact;
  return compare_mesh_files(command.mesh, command.reference, compare, run_of(options));
}

void run_check(CheckCommand& command) {
  if (command.mesh.empty()) throw UsageError("no mesh given; name one: tessera check mesh.ply");
  if (!command.reference.empty() && command.compare.tolerance == 0.0)
    throw UsageError(
        "--reference needs --tolerance D, the largest distance allowed, in the unit of the mesh");
  if (!command.reference.empty()) command.compare.validate();
  if (command.reference.empty() &&
      (command.compare.tolerance != 0.0 || command.with_borders || command.method != CheckCommand().method))
    throw UsageError("--tolerance, --borders and --method need --reference FILE to compare with");
  const cli::PipedInput piped(command.mesh, command.input_format);
  cli::check_line_writes({command.mesh, command.reference, command.truth, command.scan},
                         {{command.json, "--json", existing_by(command.force)}});
  MeshCheckOptions options = command.options;
  options.check_stop = throw_if_stopped;
  options.threads = command.threads > 0 ? command.threads : core_count();
  if (options.temp.empty()) options.temp = scratch_folder(command.mesh);
  const auto mesh = open_mesh_file(command.mesh, {.keep_bad_faces = true, .temp = options.temp});
  const MeshCheck check = check_mesh(*mesh, options);
  std::cout << describe(check) << std::flush;
  for (const std::string& warning : mesh->warnings()) std::cout << "warning: " << warning << std::endl;
  std::optional<MeshTextures> textures;
  if (command.textures) {
    textures = check_textures(command.mesh, {options.memory_bytes, options.temp, options.check_stop});
    std::cout << (textures ? describe(*textures) : "textures: the file has no texture coordinates\n")
              << std::flush;
  }
  Json truth_report, comparison_report, coverage;
  std::string complaint;
  if (!command.reference.empty()) {
    const MeshComparison comparison = compare_with_reference(command, options);
    std::cout << describe(comparison) << std::flush;
    comparison_report = to_json(comparison);
    complaint = comparison.complaint(command.with_borders);
  }
  if (!command.scan.empty()) coverage = check_coverage(command, options);
  if (!command.truth.empty()) {
    TruthOptions truth_options = command.truth_options;
    truth_options.memory_bytes = options.memory_bytes;
    truth_options.temp = options.temp;
    const TruthReport compared = compare_with_truth(*mesh, read_truth(command.truth), truth_options);
    std::cout << describe(compared) << std::flush;
    truth_report = to_json(compared);
  }
  if (!command.json.empty()) {
    Json report = to_json(check);
    if (!truth_report.is_null()) report["truth"] = truth_report;
    if (!coverage.is_null()) report["coverage"] = coverage;
    if (textures) report["textures"] = to_json(*textures);
    if (!comparison_report.is_null()) {
      report["deviation"] = comparison_report;
      report["deviation"]["reference"] = json_text(command.reference);
    }
    report["mesh"] = json_text(command.mesh);
    if (const auto warnings = mesh->warnings(); !warnings.empty()) report["warnings"] = warnings;
    OutputFile file(command.json);
    file.append(dump_json(report, 2) + "\n");
    file.finish();
  }
  if (!complaint.empty()) throw ValidationError(command.mesh.string() + ": " + complaint);
  std::vector<std::string> faults = check.defects();
  if (textures)
    for (std::string& defect : textures->defects()) faults.push_back(std::move(defect));
  if (command.closed && check.boundary_edges > 0)
    faults.push_back(std::to_string(check.boundary_edges) + " boundary edges");
  if (command.closed && check.faces == 0) faults.push_back("no faces");
  if (!(command.strict || command.closed) || faults.empty()) return;
  std::string list;
  for (const std::string& fault : faults) list += (list.empty() ? "" : ", ") + fault;
  throw ValidationError(command.mesh.string() + ": " + list);
}

}  // namespace

cli::Command check_command() {
  auto shared = std::make_shared<CheckCommand>();
  CheckCommand& c = *shared;
  OptionTable t;
  t.add("mesh", &c.mesh, "PLY, OBJ, STL, OFF or GLB").positional();
  cli::add_input_format(t, c.input_format);
  t.add("crossings", &c.options.crossings,
        "search for pairs of faces that cross, overlap or touch beyond the corner or edge that they share, "
        "exactly, and "
        "list the first");
  t.add("cleanliness", &c.options.cleanliness,
        "count edges that fold by 70 degrees or more, and tell how ragged borders run");
  t.add("quality", &c.options.quality,
        "measure what meshers of volumes and solvers stumble over: angles between faces, and the thinnest "
        "wall, "
        "by sampling; e.g. tessera check part.stl --quality --crossings");
  t.add("textures", &c.textures,
        "check texture coordinates and pages of OBJ, binary PLY and GLB: none beyond 0 and 1, no face "
        "flipped or over "
        "another, pages there; with --strict they are defects, e.g. tessera check small.glb --textures "
        "--strict");
  t.add("strict", &c.strict,
        "fail with exit code 6 if there are defects; with --crossings faces that cross are");
  t.add("closed", &c.closed, "like --strict, and boundary edges are defects too");
  t.add("weld", &c.options.weld,
        "merge vertices of equal position first (STL and glTF with normals or textures always)");
  t.add("truth", &c.truth, "compare with the surface that `tessera synth` scanned")
      .shown_as("FILE.truth.json");
  t.add("h", &c.truth_options.h, "lattice spacing of the mesh, for --truth; 0 = sample spacing").at_least(0);
  t.add("scan", &c.scan,
        "points in the coordinates of the mesh, a file or a quoted glob: say how much of what they show is "
        "in it, "
        "as the report of a reconstruction does")
      .shown_as("SCAN");
  t.add("reference", &c.reference,
        "prove that this mesh and the one given stay within --tolerance of each other, both ways; exit code "
        "6 if not");
  t.add("tolerance", &c.compare.tolerance,
        "largest distance allowed, in the unit of the mesh; with --reference");
  t.add("method", &c.method,
        "with --reference; exact: the certificate, with all distances; raster: yes or no alone, a raster "
        "settles "
        "what it can and the rest is searched; auto: yes or no, on the way that takes less time on the "
        "fullest "
        "cell; where the answer is no, each tells the same place and distance")
      .one_of({"exact", "raster", "auto"});
  t.add("borders", &c.with_borders,
        "with --reference: border curves must stay within the tolerance of each other too");
  cli::add_threads(t, c.threads, "threads for --crossings, --quality, --reference and --scan");
  t.add("json,report", &c.json, "also write the result to this file");
  cli::add_force(t, c.force);
  t.add("memory", &c.options.memory_bytes, "cap on memory; larger meshes go through --temp").bytes();
  t.add("temp", &c.options.temp, "folder for scratch files; default: beside the mesh");
  return {"check", "Say what is true of a mesh: topology, orientation, shape, defects, crossings.", t,
          [shared] { run_check(*shared); }};
}

}  // namespace tessera
