#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/output_file.h"
#include "stream/formats/points/las_copy.h"
#include "stream/runtime/memory_budget.h"
#include "stream/survey/classify_scan.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/survey/scan_outputs.h"

namespace tessera {
namespace {

struct ClassifyCommand {
  std::vector<std::string> inputs;
  std::filesystem::path output, report;
  std::string classes = "all", water = "off";
  ClassifyOptions options;
  bool force = false;
};

std::vector<ScanToClassify> planned_scans(const std::vector<std::filesystem::path>& inputs,
                                          const ClassifyCommand& command) {
  std::vector<ScanToClassify> scans;
  if (!names_folder(command.output)) {
    if (inputs.size() > 1)
      throw UsageError("-o " + command.output.string() + ": of " + std::to_string(inputs.size()) +
                       " scans each gets a file of its own; name a folder: -o DIR/");
    LasCopy::is_compressed(command.output);
    return {{inputs.front(), command.output}};
  }
  const std::vector<std::filesystem::path> outputs =
      outputs_in_folder(inputs, command.output, "only their points have classes");
  for (std::size_t i = 0; i < inputs.size(); ++i) scans.push_back({inputs[i], outputs[i]});
  return scans;
}

std::string class_counts(const ClassifiedScan& scan) {
  std::string text;
  const auto add = [&](std::uint64_t count, const char* name) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, name);
  };
  add(scan.classes[kClassGround], "ground");
  add(scan.classes[kClassLowVegetation], "low");
  add(scan.classes[kClassMediumVegetation], "medium");
  add(scan.classes[kClassHighVegetation], "high vegetation");
  add(scan.classes[kClassBuilding], "building");
  add(scan.classes[kClassWater], "water");
  add(scan.classes[kClassNoise], "noise");
  add(scan.classes[kClassUnassigned], "unassigned");
  add(scan.kept, "left as they were");
  return text;
}

void run_classify(const ClassifyCommand& command) {
  const auto start = std::chrono::steady_clock::now();
  cli::require_inputs(command.inputs);
  cli::require_output(command.output);
  const std::vector<std::filesystem::path> inputs = cli::expand_and_tell(command.inputs);
  const std::vector<ScanToClassify> scans = planned_scans(inputs, command);
  if (names_folder(command.output)) make_output_folder(command.output);
  std::vector<std::filesystem::path> reads = cli::also_read(command.inputs);
  std::vector<PlannedWrite> writes = {{command.report, "--report", existing_by(command.force)}};
  for (const ScanToClassify& scan : scans) {
    reads.push_back(scan.input);
    writes.push_back({scan.output, "-o", existing_by(command.force)});
  }
  cli::check_line_writes(reads, writes);
  ClassifyOptions options = command.options;
  options.ground_only = command.classes == "ground";
  options.water = command.water == "on";
  if (options.temp.empty()) options.temp = std::filesystem::temp_directory_path();
  if (options.memory_bytes == 0) options.memory_bytes = detect_memory_cap().bytes;
  const ClassifyReport report = classify_scans(scans, options);
  for (const ClassifiedScan& scan : report.scans)
    fmt::print("{}: {} points: {}\n", scan.output.string(), scan.points, class_counts(scan));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (report.metres == 0.0)
    fmt::print(stderr, "note: the scan does not name the unit of its heights; defaults are for metres\n");
  fmt::print("ground: {} cells of {:g}, {:.1f} % of them without a point; {:.1f} s, peak {}\n", report.cells,
             report.cell, 100.0 * static_cast<double>(report.empty) / static_cast<double>(report.cells),
             seconds, format_bytes(peak_resident_bytes()));
  if (command.report.empty()) return;
  Json json = to_json(report);
  json["seconds"] = seconds, json["peak_bytes"] = peak_resident_bytes();
  OutputFile file(command.report);
  file.append(dump_json(json, 2) + "\n");
  file.finish();
}

}  // namespace

cli::Command classify_command() {
  auto shared = std::make_shared<ClassifyCommand>();
  ClassifyCommand& c = *shared;
  OptionTable t;
  cli::add_inputs(t, c.inputs);
  cli::add_output(t, c.output,
                  "file to write, .las, .laz or .copc.laz (COPC); a folder (DIR/) gets a file for every "
                  "scan, named like it");
  t.add("classes", &c.classes,
        "all: ground 2, vegetation 3, 4, 5 by height, planar roofs 6, noise 7, else 1; ground: 2, all else 1")
      .one_of({"all", "ground"});
  ClassifyOptions& o = c.options;
  t.add(
       "cell", &o.cell,
       "edge of a cell whose lowest point counts, scan units; 0 = 1 m, more where vegetation lets few points "
       "through")
      .at_least(0);
  t.add("slope", &o.slope, "steepest ground, rise over run: steeper steps are objects").at_least(0);
  t.add("window", &o.window, "half the width of the widest object to take away, scan units; 0 = 18 m")
      .at_least(0);
  t.add("threshold", &o.threshold,
        "distance from the surface up to which points of level ground are ground, scan units; 0 = 0.5 m")
      .at_least(0);
  t.add("scalar", &o.scalar, "so many times the slope are added to --threshold, scan units; 0 = 1.25 m")
      .at_least(0);
  t.add("pit-slope", &o.pit_slope,
        "the lowest point of a cell is noise where those around it lie higher by more than this many cells")
      .at_least(0);
  t.add("noise-height", &o.noise, "what is higher over the ground is noise, scan units; 0 = 200 m")
      .at_least(0);
  t.add("water", &c.water,
        "on: what would be ground is water 9 where few points came back, level and below its banks; off: it "
        "is ground")
      .one_of({"on", "off"});
  t.add("water-density", &o.water_density,
        "water: it has no more than this share of the points to an area that the land beside it has")
      .within(0.01, 1);
  t.add("water-width", &o.water_width,
        "water: it must hold a square so wide, scan units, and of five cells at least; 0 = 10 m")
      .at_least(0);
  t.add("water-relief", &o.water_relief,
        "water: nine tenths of its heights in such a square lie within this, scan units; 0 = 0.3 m")
      .at_least(0);
  t.add("all-points", &o.all_points,
        "points marked withheld or synthetic, and those of classes 7 and 18, take part too; else they keep "
        "their class and make no ground");
  t.add("report,json", &c.report, "also write the counts to this file");
  cli::add_force(t, c.force);
  cli::add_threads(t, o.threads, "threads; never changes the result");
  t.add("memory", &o.memory_bytes, "cap on memory; larger scans go through --temp").bytes();
  t.add("temp", &o.temp, "folder for scratch files; default: the system's");
  return {"classify",
          "Ground, vegetation and buildings in scans seen from above (LAS, LAZ), by SMRF; all else of the "
          "files stays. "
          "Example: tessera classify flight/*.laz -o classified/ --slope 0.3",
          t, [shared] { run_classify(*shared); }};
}

}  // namespace tessera
