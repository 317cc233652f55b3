#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/runtime/memory_budget.h"
#include "stream/survey/gdal_program.h"
#include "stream/survey/mesh_section.h"
#include "stream/survey/pages/section_page.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/pipes.h"
#include "tools/survey/scan_outputs.h"

namespace tessera {
namespace {

constexpr double kWholeWidth = -1.0;

struct SectionCommand {
  std::filesystem::path mesh, output, page;
  std::string input_format;  ///< of a mesh that comes through a pipe
  SectionOptions options;
  double width = kWholeWidth;
  bool along = false, horizontal = false, force = false;
};

/// What the options say together. \throws UsageError
SectionOptions section_options(const SectionCommand& command) {
  SectionOptions options = command.options;
  if (command.along && command.horizontal)
    throw UsageError("--along and --horizontal: sections are one or the other");
  options.kind = command.along        ? SectionKind::kAlong
                 : command.horizontal ? SectionKind::kHorizontal
                                      : SectionKind::kAcross;
  if (command.horizontal && !options.axis.empty())
    throw UsageError("--line has no meaning with --horizontal: those sections have no axis");
  if (!command.horizontal && options.axis.empty())
    throw UsageError("--line is missing: GeoJSON with the axis; or give --horizontal");
  if (options.kind == SectionKind::kAcross && !(options.spacing > 0.0))
    throw UsageError("--spacing is missing: the distance of two sections along the axis, more than 0");
  if (command.width == 0.0) throw UsageError("--width 0: a section needs a width of more than 0");
  if (command.width > 0.0 && options.kind != SectionKind::kAcross)
    throw UsageError("--width has a meaning for sections across an axis alone");
  options.width = command.width > 0.0 ? command.width : 0.0;
  return options;
}

void run_section(SectionCommand& command) {
  if (command.mesh.empty())
    throw UsageError(
        "no mesh given; name one: tessera section mesh.ply --line axis.geojson --spacing 20 -o sections.svg");
  if (command.page.empty()) cli::require_output(command.output);
  require_page_name(command.page);
  const std::string format = command.output.empty() ? "CSV" : section_format(command.output);
  SectionOptions options = section_options(command);
  const cli::PipedInput piped(command.mesh, command.input_format);
  cli::check_line_writes({command.mesh, options.axis, options.crs},
                         {{command.output, "-o", existing_by(command.force)},
                          {command.page, "--page", existing_by(command.force)}});
  if (format != "CSV" && format != "SVG") options.crs = surveyed_crs(command.mesh, options.crs);
  if (options.temp.empty()) options.temp = std::filesystem::temp_directory_path();
  if (options.memory_bytes == 0) options.memory_bytes = detect_memory_cap().bytes;
  SectionPage page(command.mesh, options);
  const SectionReport report =
      write_sections(command.mesh, options, command.output, command.page.empty() ? nullptr : &page);
  if (!command.page.empty()) write_text_output(command.page, survey_page_text(page.finish(report)));
  if (!report.warnings.empty()) fmt::print(stderr, "{}\n", report.warnings);
  fmt::print("{}: {} sections, {} lines, {} of them closed, {} points, {} {:.10g} to {:.10g}\n",
             (command.output.empty() ? command.page : command.output).string(), report.sections, report.lines,
             report.closed, report.points, options.kind == SectionKind::kHorizontal ? "heights" : "stations",
             report.first, report.last);
}

}  // namespace

cli::Command section_command() {
  auto shared = std::make_shared<SectionCommand>();
  SectionCommand& c = *shared;
  OptionTable t;
  t.add("mesh", &c.mesh, "PLY, OBJ, STL, OFF or GLB").positional();
  cli::add_output(
      t, c.output,
      "lines to write: a table (.csv), a drawing (.svg), or lines in place (.dxf, .gpkg, .geojson)");
  cli::add_input_format(t, c.input_format);
  t.add("page", &c.page,
        "also write a page to read and to print, with a drawing to scale of up to 200 sections, and a map of "
        "their axis (.html)")
      .shown_as("FILE.html");
  t.add("line", &c.options.axis,
        "axis: the first LineString of this GeoJSON file, in the coordinates of the mesh");
  t.add("spacing", &c.options.spacing,
        "distance of two sections, units of the mesh: along the axis from its start, or upwards from --from, "
        "where 0 is that one alone")
      .at_least(0);
  t.add("width", &c.width, "lines across the axis end half of it to either side; all = where the mesh does")
      .at_least(0)
      .or_word("all", kWholeWidth);
  t.add("along", &c.along, "the section along the axis instead of those across it");
  t.add("horizontal", &c.horizontal, "horizontal sections: slices, floor plans");
  t.add("from", &c.options.from, "height of the first horizontal section");
  t.add(
       "crs", &c.options.crs,
       "coordinate system of the mesh, EPSG:n, WKT or a file with it; default: what the .prj beside the mesh "
       "says")
      .shown_as("EPSG:n|FILE");
  cli::add_force(t, c.force);
  cli::add_threads(t, c.options.threads, "threads; never changes the result");
  t.add("memory", &c.options.memory_bytes, "cap on memory; larger meshes go through --temp").bytes();
  t.add("temp", &c.options.temp, "folder for scratch files; default: the system's");
  return {
      "section",
      "Sections of a mesh, exact on its faces: upright ones across or along an axis, and horizontal ones. "
      "Example: tessera section site.ply --line axis.geojson --spacing 20 --width 60 -o sections.svg",
      t, [shared] { run_section(*shared); }};
}

}  // namespace tessera
