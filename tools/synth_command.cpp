#include <cmath>
#include <cstdlib>
#include <iostream>
#include <memory>

#include <fmt/format.h>

#include "kernels/scene/scene.h"
#include "octree/error.h"
#include "stream/commands/synth.h"
#include "stream/runtime/stop.h"
#include "tools/cli.h"
#include "tools/commands.h"

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
void parse_noise(const std::string& text, SynthOptions& options) {
  char* end = nullptr;
  options.noise = std::strtod(text.c_str(), &end);
  options.noise_in_spacings = std::string(end) == "s";
  if (end == text.c_str() || !(*end == '\0' || options.noise_in_spacings)) {
    throw UsageError(
        fmt::format("'{}' is not a noise: write 0.002 (scene units) or 0.5s (mean spacings)", text));
  }
}

void run_synth(const SynthCommand& command) {
  if (command.list) {
    for (const auto& scene : synth::scene_names()) fmt::print("{:<10} {}\n", scene.name, scene.summary);
    return;
  }
  cli::require_output(command.output);
  catch_stop_signals();
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

void add_synth(CLI::App& app) {
  auto shared = std::make_shared<SynthCommand>();
  SynthOptions& o = shared->options;
  CLI::App* command = cli::add_command(app, "synth", "Simulate a scan of a scene whose surface is known.",
                                       [shared] { run_synth(*shared); });
  cli::add_output(*command, shared->output, "scan to write: .ply, .las, .ptx or .xyz");
  std::string scenes;
  for (const auto& scene : synth::scene_names())
    scenes += (scenes.empty() ? "" : ", ") + std::string(scene.name);
  command->add_option("--scene", o.scene, "what is scanned: " + scenes)->capture_default_str();
  command
      ->add_option("--mode", o.mode,
                   "surface: direct, uniform in area; or the sensor: terrestrial, airborne, structured-light")
      ->capture_default_str();
  command->add_flag("--list-scenes", shared->list, "print the scenes and stop");
  command
      ->add_option_function<std::string>(
          "--points", [&o](const std::string& text) { o.points = parse_count(text); },
          "how many points, e.g. 250000 or 100M [1000000]")
      ->type_name("COUNT");
  command->add_option("--spacing", o.spacing, "mean distance of samples, scene units; replaces --points")
      ->check(CLI::NonNegativeNumber);
  command
      ->add_option_function<std::string>(
          "--noise", [&o](const std::string& text) { parse_noise(text, o); },
          "standard deviation of Gaussian noise in scene units, or with s behind it in mean spacings [0]")
      ->type_name("SIGMA");
  command->add_option("--outliers", o.outliers, "share of points that are uniform in a box around the scene")
      ->capture_default_str();
  command
      ->add_option("--flying", o.flying,
                   "sensors: share of range jumps that give a point between two surfaces")
      ->capture_default_str();
  command
      ->add_option("--missing", o.missing,
                   "share of the surface that is unseen, in balls around spots far apart")
      ->capture_default_str();
  command->add_option("--missing-spots", o.missing_spots, "how many such balls")->capture_default_str();
  command->add_option("--views", o.views, "sensors: number of set-ups; 0 = usual for sensor and scene")
      ->capture_default_str();
  command->add_flag("--per-scan", o.per_scan, "one file per set-up: NAME_001.EXT and so on");
  command->add_flag("--normals", o.normals, "write the exact normals");
  command->add_flag("--colour", o.colour, "write colours");
  command->add_flag("--double", o.double_positions, "double coordinates in PLY (a shift implies it)");
  cli::add_vector(*command, "--shift", o.shift, "added to every coordinate, for UTM-like frames");
  command->add_option("--seed", o.seed, "another seed, another sampling")->capture_default_str();
  command->add_option("--octaves", o.octaves, "detail of the terrain; 0 = what the spacing resolves")
      ->capture_default_str();
  command->add_option("-t,--threads", o.threads, "threads; 0 = one per core; never changes the result")
      ->capture_default_str()
      ->check(CLI::Range(0, 4096));
}

}  // namespace tessera
