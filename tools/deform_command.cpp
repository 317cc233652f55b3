#include <fmt/format.h>

#include <memory>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/job_report.h"
#include "stream/runtime/memory_budget.h"
#include "stream/stages/deform/deform_job.h"
#include "stream/stages/deform/edit_script.h"
#include "stream/survey/measured_inputs.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

struct DeformArguments {
  std::vector<std::string> words, onto;
  std::filesystem::path pose, poses, fit;
  DeformOptions options;
  JobState state;
};

std::filesystem::path existing(const std::string& word) {
  if (!std::filesystem::exists(word)) throw InputError(word + ": there is no such file");
  return word;
}

Json run_one(const DeformArguments& a, JobState state) {
  state.settings = to_settings(a.options);
  return run_job(state, deform_job(a.options), cli::stderr_sink());
}

void print_solved(const Json& report, const std::string& islands) {
  const Json& edit = report.at("edit");
  fmt::print("base: {} vertices{}; {}, {} solutions in {:.2f} s, residual {:.1e}, energy {:.4g}\n",
             edit.at("base_vertices").get<std::uint64_t>(),
             report.at("base").value("own", false) ? ", the mesh itself" : "",
             edit.at("solver").get<std::string>(), edit.at("solutions").get<std::uint64_t>(),
             edit.at("prepare_s").get<double>(), edit.at("residual").get<double>(),
             edit.at("energy").get<double>());
  if (report.at("base").contains("split")) {
    const Json& split = report.at("base").at("split");
    fmt::print(
        "its edges were {:.4g} long around the support, too long in {:.0f} % of it: split, to {:.4g} at its "
        "narrowest, from {} vertices on\n",
        split.at("edge_before").get<double>(), 100.0 * report.at("base").at("coarse_area").get<double>(),
        split.at("edge").get<double>(), split.at("vertices_before").get<std::uint64_t>());
  }
  if (const auto pieces = edit.at("loose_pieces").get<std::uint64_t>(); pieces > 0)
    fmt::print("{} loose pieces of the support, {} vertices, touch nothing that holds them: --islands {}\n",
               pieces, edit.at("loose_vertices").get<std::uint64_t>(), islands);
}

void print_mesh(const JobState& state, const Json& report) {
  const Json& mesh = report.at("mesh");
  fmt::print("{}: {} vertices, {} faces, {}\n", state.output.string(),
             mesh.at("vertices").get<std::uint64_t>(), mesh.at("faces").get<std::uint64_t>(),
             cost_text(report));
  if (mesh.contains("targets")) {
    const Json& t = mesh.at("targets");
    fmt::print("{} control points: off by {:.4g} rms, {:.4g} at most; now {:.4g} rms, {:.4g} at most\n",
               t.at("count").get<std::uint64_t>(), t.at("rms_before").get<double>(),
               t.at("largest_before").get<double>(), t.at("rms_after").get<double>(),
               t.at("largest_after").get<double>());
  }
  if (!mesh.contains("largest_move")) return;
  const double before = mesh.at("base_volume_before").get<double>();
  fmt::print(
      "largest move {:.4g}; faces of the base that turn over {}, that cross others {} (before {}); its "
      "volume "
      "{:+.3g} %; {} vertices {}\n",
      mesh.at("largest_move").get<double>(), mesh.at("base_flipped_faces").get<std::uint64_t>(),
      mesh.at("base_crossing_faces").get<std::uint64_t>(),
      mesh.at("base_crossing_faces_before").get<std::uint64_t>(),
      before != 0.0 ? 100.0 * (mesh.at("base_volume").get<double>() / before - 1.0) : 0.0,
      mesh.at("tangent_vertices").get<std::uint64_t>(), "that no normal reaches");
}

void apply_basis(DeformArguments& a) {
  if (a.words.size() < 2 || a.words.size() > 3)
    throw UsageError(
        "apply takes the basis and, if it has moved, its mesh: deform apply basis.tsb --pose pose.json -o "
        "out.ply");
  if (a.pose.empty() == a.poses.empty())
    throw UsageError("give --pose FILE with one pose, or --poses FILE with a series");
  require_mesh_extension(a.state.output);
  const std::filesystem::path basis = existing(a.words[1]);
  a.state.inputs = {basis, mesh_of_basis(basis, a.words.size() == 3 ? existing(a.words[2]) : "")};
  const std::filesystem::path file = existing((a.pose.empty() ? a.poses : a.pose).string());
  a.state.also_read.push_back(file);
  const std::vector<EditPose> poses = read_poses(file);
  if (!a.pose.empty() && poses.size() != 1)
    throw UsageError(file.string() + ": it holds " + std::to_string(poses.size()) +
                     " poses: give it with --poses");
  for (const EditPose& pose : poses) {
    a.options.edit = pose.text;
    JobState state = a.state;
    if (!a.poses.empty() && !pose.name.empty())
      state.output.replace_extension("." + pose.name + a.state.output.extension().string());
    const Json report = run_one(a, state);
    if (state.run.verbosity >= 0) print_mesh(state, report);
  }
}

void print_onto(const JobState& state, const Json& report) {
  const Json& onto = report.at("onto");
  const Json &fit = onto.at("fit"), &cells = fit.at("cells");
  const auto figures = [&](const char* when) -> const Json& { return onto.at(when).at("areas").at(0); };
  const Json &before = figures("before"), &after = figures("after");
  fmt::print("{}: {} vertices, {} faces, {}\n", state.output.string(),
             report.at("mesh").at("vertices").get<std::uint64_t>(),
             report.at("mesh").at("faces").get<std::uint64_t>(), cost_text(report));
  fmt::print(
      "{} planar cells of the scan matched, {} too far, {} with other normals, {} beside a border; waves "
      "down to {:.4g}; largest move {:.4g}\n",
      cells.at("matched").get<std::uint64_t>(), cells.at("far").get<std::uint64_t>(),
      cells.at("normals_disagree").get<std::uint64_t>(), cells.at("border").get<std::uint64_t>(),
      fit.at("wavelength").get<double>(), report.at("mesh").at("largest_move").get<double>());
  const auto percentile = [](const Json& row, const char* p) {
    return row.at("percentiles").at(p).get<double>();
  };
  fmt::print(
      "deviation of the scan: rms {:.4g} -> {:.4g}, from {:.4g} to {:.4g} -> from {:.4g} to {:.4g} (90 % of "
      "the points)\n",
      before.at("rms").get<double>(), after.at("rms").get<double>(), percentile(before, "5"),
      percentile(before, "95"), percentile(after, "5"), percentile(after, "95"));
}

/// \throws UsageError
void run_onto(DeformArguments& a) {
  a.options.mode = "onto";
  a.options.validate();
  if (a.words.size() != 1 || !a.fit.empty() || !a.pose.empty() || !a.poses.empty())
    throw UsageError(
        "--onto takes one mesh, and neither an edit nor a pose: deform mesh.ply --onto scan.laz -o out.ply");
  for (const char* unread : {".vtu", ".msh"})
    if (a.state.output.extension() == unread)
      throw UsageError(
          a.state.output.string() +
          ": the scan is measured against what was written; name a .ply, .obj, .stl, .glb or .3mf");
  require_mesh_extension(a.state.output);
  a.state.inputs = {existing(a.words.front())};
  const std::vector<std::filesystem::path> scans = cli::expand_and_tell(a.onto);
  if (measures_vertices(scans.front()))
    throw UsageError("--onto takes scans: " + scans.front().string() + " is a mesh");
  a.state.inputs.insert(a.state.inputs.end(), scans.begin(), scans.end());
  const Json report = run_one(a, a.state);
  if (a.state.run.verbosity < 0) return;
  cli::print_repairs(a.words.front(), report);
  print_onto(a.state, report);
}

void run_deform(DeformArguments& a) {
  cli::require_inputs(a.words);
  cli::require_output(a.state.output);
  a.state.also_read = cli::also_read({});
  if (!a.onto.empty()) return run_onto(a);
  const std::string& first = a.words.front();
  a.options.mode = first == "prepare" || first == "apply" ? first : "deform";
  a.options.validate();
  if (a.options.mode == "apply") return apply_basis(a);
  if (!a.pose.empty() || !a.poses.empty())
    throw UsageError("--pose and --poses go with apply; the motions of deform stand in the edit");
  const std::size_t skip = a.options.mode == "prepare" ? 1 : 0;
  if (!a.fit.empty() && a.options.mode != "deform")
    throw UsageError("--fit goes with a mesh, and an edit that says what may follow; not with " +
                     a.options.mode);
  if (a.words.size() != skip + 2 && (a.fit.empty() || a.words.size() != skip + 1))
    throw UsageError("deform takes a mesh and an edit: deform mesh.ply edit.json -o out.ply");
  if (a.options.mode == "deform") {
    require_mesh_extension(a.state.output);
  } else if (a.state.output.extension() != ".tsb") {
    throw UsageError(a.state.output.string() + ": prepare leaves a basis: name it with .tsb");
  }
  a.state.inputs = {existing(a.words[skip])};
  if (a.words.size() > skip + 1) {
    a.state.also_read.push_back(existing(a.words[skip + 1]));
    a.options.edit = read_edit_text(a.words[skip + 1]);
  }
  if (!a.fit.empty()) {
    a.state.also_read.push_back(existing(a.fit.string()));
    a.options.edit = with_controls(a.options.edit, a.fit);
  }
  const Json report = run_one(a, a.state);
  if (a.state.run.verbosity < 0) return;
  cli::print_repairs(a.words[skip], report);
  print_solved(report, a.options.islands);
  if (a.options.mode == "deform") return print_mesh(a.state, report);
  const Json& mesh = report.at("mesh");
  fmt::print(
      "{}: {} vertices, {} of them that no normal reaches; the mesh comes back within {:.2g} of its "
      "diagonal; {}, {}\n",
      a.state.output.string(), mesh.at("vertices").get<std::uint64_t>(),
      mesh.at("tangent_vertices").get<std::uint64_t>(),
      mesh.at("reconstruction_error").get<double>() / mesh.at("diagonal").get<double>(),
      format_bytes(mesh.at("bytes").get<std::uint64_t>()), cost_text(report));
}

}  // namespace

cli::Command deform_command() {
  auto arguments = std::make_shared<DeformArguments>();
  DeformArguments& a = *arguments;
  OptionTable table;
  cli::add_inputs(table, a.words);
  cli::add_output(
      table, a.state.output,
      "the mesh to write: .ply, .obj, .stl, .glb, .3mf, .vtu or .msh; with prepare the basis: .tsb");
  table.add("pose", &a.pose, "apply: JSON file with the motions of the handles");
  table.add("poses", &a.poses, "apply: JSON file with many poses; OUT.NAME.ply for each");
  table.add("fit", &a.fit,
            "control points, a line of x,y,z,X,Y,Z each: where they are and where they belong");
  table
      .add("onto", &a.onto,
           "scans (files, folders, globs) of what was built after the mesh: the smoothest displacement that "
           "brings the mesh onto them, e.g. deform design.stl --onto asbuilt.laz -o asbuilt.ply")
      .shown_as("FILE");
  table.append(option_table(a.options));
  table.append(option_table(a.state.run));
  return {
      "deform",
      "Bends a mesh of any size: MESH EDIT.json; or onto a scan of it: MESH --onto SCAN; or prepare MESH "
      "EDIT.json, then apply BASIS.tsb for every "
      "pose. What is fixed stays, what is a handle moves as told, what lies between follows smoothly with "
      "all its details. Resumable.",
      table, [arguments] { run_deform(*arguments); }};
}

}  // namespace tessera
