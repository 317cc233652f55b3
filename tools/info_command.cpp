#include <iostream>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/points/file_notices.h"
#include "stream/points/point_inputs.h"
#include "stream/points/point_summary.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/parallel.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/pipes.h"

namespace tessera {
namespace {

struct InfoCommand {
  std::vector<std::string> inputs;
  std::string input_format;  ///< of a pipe
  ReadOptions read;
  int threads = 0;
  bool json = false;
};

std::string vector_text(const Double3& v) {
  return fmt::format("{:.10g} {:.10g} {:.10g}", v[0], v[1], v[2]);
}

std::string attributes_text(const PointSummary& s) {
  const PointAttributes& a = s.info.attributes;
  std::string text;
  const auto add = [&](bool there, const std::string& what) {
    if (there) text += (text.empty() ? "" : ", ") + what;
  };
  const auto lacking = [](std::uint64_t n) {
    return n > 0 ? fmt::format(" ({} points without)", n) : std::string();
  };
  add(a.normals, "normals" + lacking(s.without_normal));
  add(a.colour, "colour" + lacking(s.without_colour));
  add(a.intensity, "intensity");
  add(a.sensor, "sensor positions");
  add(a.echo, "classes and returns");
  return text.empty() ? "positions only" : text;
}

std::string crs_text(const Crs& crs) {
  std::string text = crs.name;
  const std::string code = "EPSG:" + std::to_string(crs.horizontal);
  if (crs.horizontal != 0 && text.find(code) == std::string::npos) text += ", " + code;
  return text + (crs.wkt.empty() ? " (GeoTIFF keys)" : " (WKT)");
}

/// \param notices  null: warnings are printed here; else those that every tile of a survey may have go there
void print_text(const PointSummary& s, FileNotices* notices) {
  const auto line = [](const char* name, const std::string& value) {
    fmt::print("  {:<11} {}\n", name, value);
  };
  fmt::print("{}\n", s.info.path.string());
  line("format", fmt::format("{}, {} bytes", s.info.format, s.info.bytes));
  const std::string declared =
      s.info.declared_points > 0 ? fmt::format("{} declared", s.info.declared_points) : "no count declared";
  line("points", fmt::format("{} read, {}", s.counts.points, declared));
  line("fates", fmt::format("{} good, {} not finite, {} withheld, {} empty, {} missing",
                            s.counts.points - s.not_finite, s.not_finite, s.counts.withheld, s.counts.empty,
                            s.missing));
  line("attributes", attributes_text(s));
  if (s.info.crs.known()) line("system", crs_text(s.info.crs));
  if (s.min[0] <= s.max[0]) line("bounds", vector_text(s.min) + "  to  " + vector_text(s.max));
  if (s.info.has_bounds)
    line("declared", vector_text(s.info.declared_min) + "  to  " + vector_text(s.info.declared_max));
  if (s.spacing > 0) line("spacing", fmt::format("about {:.4g} (units of the scan)", s.spacing));
  for (const Double3& sensor : s.info.sensors) line("sensor", vector_text(sensor));
  if (!s.info.left_out.empty()) line("note", left_out_sentence(s.info));
  if (s.info.crs.geographic)
    line("note", "coordinates are degrees: reconstruct takes them with --project auto or EPSG:n");
  for (const std::string& w : s.warnings) {
    if (notices != nullptr && w == kWideBounds)
      notices->add(s.info.path, w);
    else
      line("warning", w);
  }
}

nlohmann::ordered_json to_json(const PointSummary& s) {
  nlohmann::ordered_json j;
  j["path"] = json_text(s.info.path);
  j["format"] = s.info.format;
  j["bytes"] = s.info.bytes;
  j["points"] = {{"declared", s.info.declared_points},
                 {"read", s.counts.points},
                 {"good", s.counts.points - s.not_finite},
                 {"not_finite", s.not_finite},
                 {"withheld", s.counts.withheld},
                 {"empty", s.counts.empty},
                 {"missing", s.missing}};
  const PointAttributes& a = s.info.attributes;
  j["attributes"] = {{"normals", a.normals},
                     {"colour", a.colour},
                     {"intensity", a.intensity},
                     {"sensor", a.sensor},
                     {"classes_and_returns", a.echo}};
  j["without_normal"] = s.without_normal;
  j["without_colour"] = s.without_colour;
  if (s.info.crs.known())
    j["coordinate_system"] = nlohmann::ordered_json::parse(dump_json(to_json(s.info.crs)));
  if (s.min[0] <= s.max[0]) j["bounds"] = {{"min", s.min}, {"max", s.max}};
  if (s.info.has_bounds) j["declared_bounds"] = {{"min", s.info.declared_min}, {"max", s.info.declared_max}};
  if (s.spacing > 0) j["spacing"] = s.spacing;
  j["sensors"] = s.info.sensors;
  if (!s.info.left_out.empty()) {
    nlohmann::ordered_json names = nlohmann::ordered_json::array();
    for (const std::string& name : s.info.left_out) names.push_back(json_text(name));
    j["left_out"] = names;
  }
  j["warnings"] = s.warnings;
  return j;
}

/// Describes every file that can be read; one that cannot is named and makes the command fail in the end.
void run_info(InfoCommand& command) {
  cli::require_inputs(command.inputs);
  const cli::PipedInput piped(command.inputs, command.input_format);
  const auto paths = cli::expand_and_tell(command.inputs);
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  std::string first_error;
  std::size_t failed = 0;
  constexpr std::size_t kFew = 3;
  FileNotices notices;
  WorkerPool pool(command.threads);
  for (const auto& path : paths) {
    try {
      PointSummary summary;
      pool.run_here([&] { summary = summarize_points(path, command.read); });
      if (command.json) {
        files.push_back(to_json(summary));
      } else {
        print_text(summary, paths.size() > kFew ? &notices : nullptr);
      }
    } catch (const InputError& e) {
      if (failed++ == 0) first_error = e.what();
      if (command.json) {
        files.push_back({{"path", json_text(path)}, {"error", e.what()}});
      } else if (paths.size() > 1) {
        fmt::print("{}\n  {:<11} {}\n", path.string(), "error", e.what());
      }
    }
  }
  if (!command.json)
    for (const std::string& line : notices.lines()) fmt::print("warning: {}\n", line);
  if (command.json) std::cout << nlohmann::ordered_json{{"schema", 1}, {"files", files}}.dump(2) << "\n";
  if (failed > 0 && paths.size() == 1) throw InputError(first_error);
  if (failed > 0) {
    throw InputError(
        fmt::format("{} of {} files cannot be read, the first: {}", failed, paths.size(), first_error));
  }
}

}  // namespace

cli::Command info_command() {
  auto shared = std::make_shared<InfoCommand>();
  OptionTable t;
  cli::add_inputs(t, shared->inputs);
  cli::add_input_format(t, shared->input_format);
  add_columns(t, shared->read.columns);
  cli::add_threads(t, shared->threads, "threads");
  t.add("json", &shared->json, "print one JSON object instead of text");
  return {"info",
          "Read scans whole and say what they hold: counts, fates of points, bounds, attributes, spacing.", t,
          [shared] { run_info(*shared); }};
}

}  // namespace tessera
