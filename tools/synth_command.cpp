#include <cmath>
#include <cstdlib>
#include <iostream>
#include <memory>

#include <fmt/format.h>

#include "kernels/scene/scene.h"
#include "octree/error.h"
#include "stream/commands/synth.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

struct SynthCommand {
  SynthOptions options;
  std::filesystem::path output;
  bool list = false;
};

/// "250000", "1e6", "100M": k, M, G count in thousands.
std::uint64_t parse_count(const std::string& text) {
  char* end = nullptr;
  double value = std::strtod(text.c_str(), &end);
  const std::string suffix = end;
  if (suffix == "k") value *= 1e3;
  if (suffix == "M") value *= 1e6;
  if (suffix == "G") value *= 1e9;
  const bool known = suffix.empty() || suffix == "k" || suffix == "M" || suffix == "G";
  if (end == text.c_str() || !known || !(value >= 1.0 && value <= 1e15) || value != std::floor(value)) {
    throw UsageError(fmt::format("'{}' is not a number of points: write 250000, 1e6 or 100M", text));
  }
  return static_cast<std::uint64_t>(value);
}

/// "0.002" in scene units, "0.5s" in mean spacings.
void parse_length(const std::string& text, const char* what, double& length, bool& in_spacings) {
  char* end = nullptr;
  length = std::strtod(text.c_str(), &end);
  in_spacings = std::string(end) == "s";
  if (end == text.c_str() || !(*end == '\0' || in_spacings)) {
    throw UsageError(
        fmt::format("'{}' is not {}: write 0.002 (scene units) or 0.5s (mean spacings)", text, what));
  }
}

void run_synth(const SynthCommand& command) {
  if (command.list) {
    for (const auto& scene : synth::scene_names()) fmt::print("{:<10} {}\n", scene.name, scene.summary);
    return;
  }
  cli::require_output(command.output);
  cli::check_line_writes({}, {{command.output, "-o", PlannedWrite::Existing::kReplace}});
  const SynthReport report = synthesize(command.options, command.output);
  for (const auto& file : report.files) fmt::print("{}\n", file.string());
  fmt::print(
      "{} points ({} outliers, {} flying), spacing {:.6g}, noise {:.6g}, area {:.8g}, {:.2f} s, {:.3g} "
      "points/s\n",
      report.points, report.outliers, report.flying, report.spacing, report.noise, report.area,
      report.seconds, static_cast<double>(report.points) / report.seconds);
  fmt::print("truth: {}\n", report.truth.string());
}

}  // namespace

cli::Command synth_command() {
  auto shared = std::make_shared<SynthCommand>();
  SynthOptions& o = shared->options;
  OptionTable t;
  cli::add_output(t, shared->output, "scan to write: .ply, .las, .laz, .ptx or .xyz");
  std::string scenes;
  for (const auto& scene : synth::scene_names())
    scenes += (scenes.empty() ? "" : ", ") + std::string(scene.name);
  t.add("scene", &o.scene, "what is scanned: " + scenes + "; or FILE.ply, .obj, .stl, .off, .glb: any mesh");
  t.add("mode", &o.mode,
        "surface: direct, uniform in area; or the sensor: terrestrial, airborne, structured-light");
  t.add("list-scenes", &shared->list, "print the scenes and stop");
  t.add("points", OptionSetter([&o](const std::string& text) { o.points = parse_count(text); }),
        "how many points, e.g. 250000 or 100M; default: 1M")
      .shown_as("COUNT");
  t.add("spacing", &o.spacing, "mean distance of samples, scene units; replaces --points; 0 = by --points")
      .at_least(0);
  t.add("noise", OptionSetter([&o](const std::string& text) {
          parse_length(text, "a noise", o.noise, o.noise_in_spacings);
        }),
        "standard deviation of Gaussian noise in scene units, or with s behind it in mean spacings; default: "
        "0")
      .shown_as("SIGMA");
  t.add("noise-length", OptionSetter([&o](const std::string& text) {
          parse_length(text, "a length", o.noise_length, o.noise_length_in_spacings);
        }),
        "length over which the noise is correlated, as that of dense matching is, in scene units, or with s "
        "in mean "
        "spacings; default: 0, every point has its own")
      .shown_as("X");
  t.add("outliers", &o.outliers, "share of points that are uniform in a box around the scene");
  t.add("flying", &o.flying, "sensors: share of range jumps that give a point between two surfaces");
  t.add("missing", &o.missing, "share of the surface that is unseen, in balls around spots far apart");
  t.add("missing-spots", &o.missing_spots, "how many such balls");
  t.add("views", &o.views, "sensors: number of set-ups; 0 = usual for sensor and scene");
  t.add("per-scan", &o.per_scan, "one file per set-up: NAME_001.EXT and so on");
  t.add("normals", &o.normals, "write the exact normals");
  t.add("colour", &o.colour, "write colours");
  t.add("double", &o.double_positions, "double coordinates in PLY (a shift implies it)");
  t.add("shift", &o.shift, "added to every coordinate, for UTM-like frames");
  t.add("seed", &o.seed, "another seed, another sampling");
  t.add("octaves", &o.octaves, "detail of the terrain; 0 = what the spacing resolves");
  t.add("memory", &o.memory_bytes,
        "cap for the mesh of a scene, which is held in memory, e.g. 512M; default: the smallest limit of "
        "this machine x 0.8")
      .bytes();
  cli::add_force(t, o.force);
  cli::add_threads(t, o.threads, "threads; never changes the result");
  return {"synth", "Simulate a scan of a scene whose surface is known.", t, [shared] { run_synth(*shared); }};
}

}  // namespace tessera
