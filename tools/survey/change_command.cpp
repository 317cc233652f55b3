#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/change/scan_change.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/planned_writes.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/memory_budget.h"
#include "stream/survey/measured_inputs.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/survey/scan_outputs.h"

namespace tessera {
namespace {

struct ChangeCommand {
  std::vector<std::string> inputs, after;
  std::filesystem::path output, report, csv, histogram;
  std::string normals = "free", orient = "up";
  ScanChangeOptions options;
  bool force = false;
};

/// "up", an axis with its sign, or a place.
void read_orientation(const std::string& text, NormalRule& rule) {
  if (text == "up") return;
  const std::string axes = "xyz";
  if (text.size() == 2 && (text[0] == '+' || text[0] == '-') && axes.find(text[1]) != std::string::npos) {
    rule.direction = {};
    rule.direction[axes.find(text[1])] = text[0] == '-' ? -1.0 : 1.0;
    return;
  }
  const std::vector<double> place = numbers_of(text, 3);
  if (place.empty())
    throw UsageError("--orient " + text + ": is neither up, +x, -x, +y, -y, +z, -z nor a place X,Y,Z");
  rule.viewpoint = Double3{place[0], place[1], place[2]};
}

/// \throws UsageError, InputError
std::vector<std::filesystem::path> planned_changes(const std::vector<std::filesystem::path>& inputs,
                                                   const ChangeCommand& command) {
  if (command.output.empty()) return {};
  if (!names_folder(command.output)) return {command.output};
  if (command.options.colour_scale > 0.0 || command.options.core_spacing > 0.0)
    throw UsageError("-o " + command.output.string() +
                     ": with --colours and --core-spacing scans are written anew, into one file; name it");
  return outputs_in_folder(inputs, command.output,
                           "only they can get numbers more and keep all else; name a file");
}

/// Two scans without --to are the old and the new one.
void divide_inputs(ChangeCommand& command) {
  if (!command.after.empty()) return;
  if (command.inputs.size() != 2)
    throw UsageError(
        "--to is missing: the new scans, which are compared with the old ones; without it give one old and "
        "one "
        "new scan");
  command.after = {command.inputs[1]};
  command.inputs.pop_back();
}

void run_change(ChangeCommand command) {
  const auto start = std::chrono::steady_clock::now();
  cli::require_inputs(command.inputs);
  divide_inputs(command);
  if (command.output.empty() && command.report.empty() && command.csv.empty() && command.histogram.empty() &&
      command.options.raster.empty())
    throw UsageError(
        "no output: give -o FILE (.las, .laz, .ply, .csv), --raster, --report, --csv or --histogram");
  if (!command.output.empty() && !names_folder(command.output))
    MeasuredInputs::require_output(command.output, "changes");
  ScanChangeOptions options = command.options;
  options.normals.kind = command.normals == "vertical"     ? NormalRule::Kind::kVertical
                         : command.normals == "horizontal" ? NormalRule::Kind::kHorizontal
                                                           : NormalRule::Kind::kFree;
  read_orientation(command.orient, options.normals);
  const std::vector<std::filesystem::path> before = cli::expand_and_tell(command.inputs);
  const std::vector<std::filesystem::path> after = cli::expand_and_tell(command.after);
  std::vector<std::filesystem::path> reads = cli::also_read(command.inputs);
  for (const auto& some : {cli::also_read(command.after), before, after})
    reads.insert(reads.end(), some.begin(), some.end());
  reads.push_back(command.options.areas);
  const PlannedWrite::Existing existing = existing_by(command.force);
  const std::vector<std::filesystem::path> outputs = planned_changes(before, command);
  if (names_folder(command.output) && !outputs.empty()) make_output_folder(command.output);
  std::vector<PlannedWrite> writes = {{command.report, "--report", existing},
                                      {command.csv, "--csv", existing},
                                      {command.histogram, "--histogram", existing},
                                      {command.options.raster, "--raster", existing}};
  for (const std::filesystem::path& output : outputs) writes.push_back({output, "-o", existing});
  cli::check_line_writes(reads, writes);
  if (options.temp.empty()) options.temp = std::filesystem::temp_directory_path();
  if (options.memory_bytes == 0) options.memory_bytes = detect_memory_cap().bytes;
  options.progress_sink = cli::stderr_sink();
  const ScanChangeReport report = measure_change(before, after, options, outputs);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  for (const std::string& notice : report.notices) fmt::print(stderr, "note: {}\n", notice);
  fmt::print("{}{:.1f} s, peak {}\n", describe(report), seconds, format_bytes(peak_resident_bytes()));
  std::cout << std::flush;
  constexpr double kNoTolerance = -1.0;
  write_text_output(command.csv, to_csv(report.table, kNoTolerance));
  write_text_output(command.histogram, histogram_csv(report.table));
  if (command.report.empty()) return;
  Json json = to_json(report);
  const auto list = [&](const char* key, const std::vector<std::filesystem::path>& paths) {
    json[key] = Json::array();
    for (const std::filesystem::path& path : paths) json[key].push_back(json_text(path));
  };
  list("old", before), list("new", after), list("outputs", outputs);
  json["seconds"] = seconds, json["peak_bytes"] = peak_resident_bytes();
  write_text_output(command.report, dump_json(json, 2) + "\n");
}

}  // namespace

cli::Command change_command() {
  auto shared = std::make_shared<ChangeCommand>();
  ChangeCommand& c = *shared;
  OptionTable t;
  cli::add_inputs(t, c.inputs);
  cli::add_output(
      t, c.output,
      "file of the core points with scalars 'M3C2 distance', 'distance uncertainty' and 'significant "
      "change': .las, .laz, .ply or a table .csv; a folder (DIR/) gets a file for every LAS and LAZ "
      "file");
  ScanChangeOptions& o = c.options;
  t.add("to", &c.after, "the new scans; without it the inputs are one old and one new scan")
      .shown_as("FILE...");
  t.add("normal-scale", &o.normal_scale,
        "diameter of the ball of old points that a normal comes from, scan units; auto = 20 spacings of the "
        "sparser scan")
      .at_least(0)
      .or_word("auto", 0.0);
  t.add("projection-scale", &o.projection_scale,
        "diameter of the cylinder along the normal in which both scans are averaged, scan units; auto = 10 "
        "spacings")
      .at_least(0)
      .or_word("auto", 0.0);
  t.add("max-depth", &o.max_depth,
        "how far the cylinder reaches to either side, scan units: larger changes are not seen; auto = five "
        "times --projection-scale")
      .at_least(0)
      .or_word("auto", 0.0);
  t.add(
       "core-spacing", &o.core_spacing,
       "one core point in a cell of this size, the one nearest to its centre, scan units; 0 = all old points")
      .at_least(0);
  t.add("normals", &c.normals,
        "free: as the points lie; horizontal: without their z; vertical: straight up, which compares heights")
      .one_of({"free", "horizontal", "vertical"});
  t.add("orient", &c.orient,
        "the side that normals show to, where changes are positive: up, +x, -x, +y, -y, +z, -z, or towards a "
        "place X,Y,Z, e.g. the scanner");
  t.add("registration-error", &o.registration_error,
        "how well the scans are registered, scan units; added to the level of detection before the factor "
        "1.96")
      .at_least(0);
  t.add_flag(
      "median", [&o] { o.median = true; },
      "medians and interquartile ranges in place of means and standard deviations: for vegetation and "
      "outliers");
  t.add_flag(
      "all-fields", [&o] { o.all_fields = true; },
      "also write STD_cloud1, STD_cloud2, Npoints_cloud1, Npoints_cloud2 and NormalX, NormalY, NormalZ");
  t.add(
      "within", &o.areas,
      "polygons (GeoJSON, in the coordinates of the scan), a row of figures each beside that of all points");
  t.add("colours", &o.colour_scale,
        "colours by distance instead of those there were: red where the new scan lies in front, blue behind, "
        "full at this distance, magenta beyond; 0 = those there were")
      .at_least(0);
  t.add("raster", &o.raster,
        "also write mean distances by cell, seen from above, to this GeoTIFF; needs tessera-gdal");
  t.add("cell", &o.cell,
        "edge of a cell of the raster and of figures by area, scan units; auto = --projection-scale")
      .at_least(0)
      .or_word("auto", 0.0);
  t.add("csv", &c.csv, "also write the rows of figures to this file");
  t.add("histogram", &c.histogram, "also write a histogram of distances to this file (CSV)");
  t.add("report,json", &c.report, "also write the figures to this file");
  add_columns(t, o.columns);
  t.add("progress", &o.progress, "progress on stderr; auto: bar on a terminal, else plain")
      .one_of({"auto", "bar", "plain", "json", "none"});
  cli::add_force(t, c.force);
  cli::add_threads(t, o.threads, "threads; never changes the result");
  t.add("memory", &o.memory_bytes, "cap on memory; larger scans go through --temp").bytes();
  t.add("temp", &o.temp, "folder for scratch files; default: the system's");
  return {"change",
          "How far a new scan lies from an old one along local normals (M3C2), with the level from which on "
          "that is "
          "more than noise, at every point of the old one. Example: tessera change old.laz --to new.laz -o "
          "change.laz --registration-error 0.01",
          t, [shared] { run_change(*shared); }};
}

}  // namespace tessera
