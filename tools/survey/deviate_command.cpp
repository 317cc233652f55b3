#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/planned_writes.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/memory_budget.h"
#include "stream/survey/measured_inputs.h"
#include "stream/survey/pages/deviation_page.h"
#include "stream/survey/scan_deviation.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/pipes.h"
#include "tools/survey/scan_outputs.h"

namespace tessera {
namespace {

constexpr double kNoTolerance = -1.0;

struct DeviateCommand {
  std::vector<std::string> inputs;
  std::string input_format;  ///< of a pipe
  std::filesystem::path reference, output, report, csv, histogram, page;
  ScanDeviationOptions options;
  double share = 1.0;  ///< of the measured points
  bool force = false;
};

/// \throws UsageError, InputError
std::vector<std::filesystem::path> planned_deviations(const std::vector<std::filesystem::path>& inputs,
                                                      const DeviateCommand& command) {
  if (command.output.empty()) return {};
  if (!names_folder(command.output)) return {command.output};
  if (command.options.colour_scale > 0.0)
    throw UsageError("-o " + command.output.string() +
                     ": with --colours scans are written anew, into one file; name it");
  return outputs_in_folder(inputs, command.output,
                           "only they can get a number more and keep all else; name a file");
}

/// \throws ValidationError
void require_within(const DeviateCommand& command, const DeviationSummary& all) {
  if (command.options.tolerance < 0.0) return;
  if (passes(all, command.share)) return;
  const double share = static_cast<double>(all.within) / static_cast<double>(all.count);
  throw ValidationError(fmt::format(
      "{} of {} measured points deviate by more than {:g}: {:.6g} % lie within, {:.6g} % are asked for",
      all.count - all.within, all.count, command.options.tolerance, 100.0 * share, 100.0 * command.share));
}

void run_deviate(DeviateCommand& command) {
  const auto start = std::chrono::steady_clock::now();
  cli::require_inputs(command.inputs);
  if (command.reference.empty())
    throw UsageError("--to is missing: the mesh from which deviations are measured");
  if (command.output.empty() && command.report.empty() && command.csv.empty() && command.histogram.empty() &&
      command.page.empty() && command.options.tolerance < 0.0)
    throw UsageError(
        "no output: give -o FILE (.las, .laz, .ply, .csv), --page, --report, --csv, --histogram or "
        "--tolerance");
  require_page_name(command.page);
  if (!command.output.empty() && !names_folder(command.output))
    MeasuredInputs::require_output(command.output, "deviations");
  if (command.share > 1.0)
    throw UsageError(fmt::format("--share {:g}: is a share, from 0 to 1", command.share));
  if (command.share < 1.0 && command.options.tolerance < 0.0)
    throw UsageError("--share has a meaning with --tolerance alone");
  const cli::PipedInput piped(command.inputs, command.input_format);
  const std::vector<std::filesystem::path> inputs = cli::expand_and_tell(command.inputs);
  std::vector<std::filesystem::path> reads = cli::also_read(command.inputs);
  reads.insert(reads.end(), inputs.begin(), inputs.end());
  reads.push_back(command.reference);
  reads.push_back(command.options.areas);
  const PlannedWrite::Existing existing = existing_by(command.force);
  const std::vector<std::filesystem::path> outputs = planned_deviations(inputs, command);
  if (names_folder(command.output) && !outputs.empty()) make_output_folder(command.output);
  std::vector<PlannedWrite> writes = {{command.report, "--report", existing},
                                      {command.csv, "--csv", existing},
                                      {command.histogram, "--histogram", existing},
                                      {command.page, "--page", existing}};
  for (const std::filesystem::path& output : outputs) writes.push_back({output, "-o", existing});
  cli::check_line_writes(reads, writes);
  ScanDeviationOptions options = command.options;
  if (options.temp.empty()) options.temp = std::filesystem::temp_directory_path();
  if (options.memory_bytes == 0) options.memory_bytes = detect_memory_cap().bytes;
  options.map = !command.page.empty();
  const ScanDeviationReport report = measure_deviation(inputs, command.reference, options, outputs);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  for (const std::string& notice : report.notices) fmt::print(stderr, "note: {}\n", notice);
  fmt::print("{}", describe(report.table, options.tolerance));
  fmt::print("{} points to {} faces, up to {:g}; left out: {}; {:.1f} s, peak {}\n", report.points,
             report.reference_faces, report.max_distance, report.left_out, seconds,
             format_bytes(peak_resident_bytes()));
  std::cout << std::flush;
  write_text_output(command.csv, to_csv(report.table, options.tolerance));
  write_text_output(command.histogram, histogram_csv(report.table));
  if (!command.page.empty())
    write_text_output(command.page,
                      survey_page_text(deviation_page(
                          report, {inputs, command.reference, options.areas, options.tolerance, command.share,
                                   options.colour_scale, options.memory_bytes, options.temp})));
  if (!command.report.empty()) {
    Json json = to_json(report, options.tolerance);
    json["inputs"] = Json::array();
    for (const std::filesystem::path& input : inputs) json["inputs"].push_back(json_text(input));
    json["reference"] = json_text(command.reference);
    json["outputs"] = Json::array();
    for (const std::filesystem::path& output : outputs) json["outputs"].push_back(json_text(output));
    json["seconds"] = seconds, json["peak_bytes"] = peak_resident_bytes();
    write_text_output(command.report, dump_json(json, 2) + "\n");
  }
  require_within(command, report.table.rows.front());
}

}  // namespace

cli::Command deviate_command() {
  auto shared = std::make_shared<DeviateCommand>();
  DeviateCommand& c = *shared;
  OptionTable t;
  cli::add_inputs(t, c.inputs);
  cli::add_input_format(t, c.input_format);
  cli::add_output(
      t, c.output,
      "file with a scalar 'deviation': points .las, .laz, .ply or a table .csv; a mesh .ply, whose "
      "vertices are measured; a folder (DIR/) gets a file for every LAS and LAZ file");
  ScanDeviationOptions& o = c.options;
  t.add("to", &c.reference, "the reference, a mesh: PLY, OBJ, STL, OFF or GLB").shown_as("FILE");
  t.add("max-distance", &o.max_distance,
        "what lies farther off is counted as far and has no deviation, scan units; 0 = a tenth of the "
        "reference's diagonal")
      .at_least(0);
  t.add("tolerance", &o.tolerance,
        "measured points must deviate by no more than this, either way, else the exit code is 6; any = no "
        "verdict")
      .at_least(0)
      .or_word("any", kNoTolerance);
  t.add("share", &c.share, "with --tolerance: so large a share of the measured points must, 0 to 1")
      .at_least(0);
  t.add(
      "within", &o.areas,
      "polygons (GeoJSON, in the coordinates of the scan), a row of figures each beside that of all points");
  t.add("colours", &o.colour_scale,
        "colours by deviation instead of those there were: red in front of the reference, blue behind, full "
        "at this "
        "deviation, magenta beyond; 0 = those there were")
      .at_least(0);
  t.add("csv", &c.csv, "also write the rows of figures to this file");
  t.add("histogram", &c.histogram, "also write a histogram of deviations to this file (CSV)");
  t.add("page", &c.page,
        "also write a page to read and to print: figures, verdict, histogram, pictures in the colours of "
        "deviations, worst places (.html)")
      .shown_as("FILE.html");
  t.add("report,json", &c.report, "also write the figures to this file");
  add_columns(t, o.columns);
  cli::add_force(t, c.force);
  cli::add_threads(t, o.threads, "threads; never changes the result");
  t.add("memory", &o.memory_bytes, "cap on memory; larger scans and meshes go through --temp").bytes();
  t.add("temp", &o.temp, "folder for scratch files; default: the system's");
  return {"deviate",
          "How far scans, or the vertices of a mesh, lie from a reference mesh: signed distances as a scalar "
          "of every "
          "point, figures and a verdict. Example: tessera deviate scan.laz --to design.stl -o deviation.laz "
          "--tolerance 0.02",
          t, [shared] { run_deviate(*shared); }};
}

}  // namespace tessera
