#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/files/scratch_folder.h"
#include "stream/points/plan.h"
#include "stream/queue/makespan.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/report.h"
#include "stream/runtime/work_dir.h"
#include "stream/stages/reconstruct/forecast.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "stream/stages/reconstruct/site_after.h"
#include "stream/stages/surface/closing_stages.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/site.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

/// What planning itself took, then what will come; stages that have nothing to do are left out.
void print_forecast(const Forecast& forecast, const Json& report) {
  fmt::print("\n{:<12}{:>8}{:>14}{:>14}{:>8}{:>10}\n", "stage", "tasks", "memory", "disk", "files",
             "seconds");
  double seconds = 0.0;
  std::uint64_t disk = 0;
  std::uint64_t files = 0;
  for (const Json& done : report.at("stages")) {
    const auto tasks = done.at("tasks").get<std::uint64_t>();
    if (tasks > 0)
      fmt::print("{:<12}{:>8}{:>14}{:>14}{:>8}{:>10.1f}  done\n", done.at("name").get<std::string>(), tasks,
                 "", format_bytes(done.at("bytes_written").get<std::uint64_t>()), "",
                 done.at("wall_s").get<double>());
  }
  for (const StageForecast& f : forecast.stages) {
    if (f.is_idle()) continue;
    fmt::print("{:<12}{:>8}{:>14}{:>14}{:>8}{:>10.1f}\n", f.stage, f.tasks, format_bytes(f.memory_bytes()),
               format_bytes(f.disk_bytes), f.files, f.seconds);
    seconds += f.seconds;
    disk += f.disk_bytes;
    files += f.files;
  }
  fmt::print("{:<12}{:>8}{:>14}{:>14}{:>8}{:>10.1f}\n", "all", "", "", format_bytes(disk), files, seconds);
}

void print_plan(const Plan& plan, const Forecast& forecast, const ReconstructOptions& options,
                const JobState& state, const Json& report) {
  const PointDispositions& p = plan.dispositions;
  fmt::print("points       {} read, {} kept", p.read, p.kept);
  if (p.other_class > 0) fmt::print(", {} of other classes", p.other_class);
  if (p.other_return > 0) fmt::print(", {} of other returns", p.other_return);
  if (p.outside > 0) fmt::print(", {} outside", p.outside);
  if (p.thinned > 0) fmt::print(", {} thinned out", p.thinned);
  if (p.non_finite > 0) fmt::print(", {} not finite", p.non_finite);
  if (p.absurd > 0) fmt::print(", {} far outside", p.absurd);
  if (p.withheld > 0) fmt::print(", {} withheld", p.withheld);
  if (p.empty > 0) fmt::print(", {} empty", p.empty);
  if (p.missing > 0) fmt::print(", {} missing", p.missing);
  fmt::print("\nattributes   normals for {:.1f} %{}, {}, {} sensor positions\n", 100.0 * plan.normal_fraction,
             plan.grid_normals ? " from rows and columns" : "", plan.has_colour ? "colour" : "no colour",
             plan.sensors.size());
  if (plan.multi_return_fraction > 0)
    fmt::print("pulses       {:.1f} % of the points come from pulses of several returns\n",
               100.0 * plan.multi_return_fraction);
  if (plan.spacing > 0) {
    fmt::print("spacing      {:.6g} scan units, noise {:.3g} of the resolution\n", plan.spacing,
               plan.noise_cells);
  }
  fmt::print("resolution   {:.6g} scan units ({}), support radius {:.6g}\n", plan.lattice.h,
             plan.resolution_reason, plan.radius_cells * plan.lattice.h);
  fmt::print("lattice      {} x {} x {} bricks of 64^3 cells, {} occupied, in {} buckets\n",
             plan.brick_max[0] - plan.brick_min[0] + 1, plan.brick_max[1] - plan.brick_min[1] + 1,
             plan.brick_max[2] - plan.brick_min[2] + 1, plan.bricks, plan.buckets.size());
  fmt::print("mesh         about {:.3g} million faces before decimation\n",
             static_cast<double>(plan.faces_estimate) * 1e-6);
  fmt::print("memory cap   {}, {} threads\n", format_bytes(state.run.memory_bytes), state.run.threads);
  fmt::print("disk         at most {} at one time in the work directory\n",
             format_bytes(forecast.peak_disk_bytes));
  print_forecast(forecast, report);
  if (HolesMode(options.holes).close)
    fmt::print(
        "note: closing takes 7 to 55 s of processor time per million faces that it adds; which holes there "
        "are is "
        "not known yet\n");
  if (options.decimates())
    fmt::print(
        "note: write is told for the faces before decimation; usually a few per cent of them are left\n");
  for (const std::string& warning : plan.warnings) fmt::print("warning: {}\n", warning);
}

/// \param state  with the work directory  \param folder  of the site
void print_site_plan(const Plan& plan, const Forecast& forecast, const JobState& state,
                     const fs::path& folder) {
  const SiteForecast site = forecast_site(plan, state, {});
  if (site.disk.site > 0)
    fmt::print("3D Tiles     about {}, beside it at most {} at one time in its work directory\n",
               format_bytes(site.disk.site), format_bytes(site.disk.work));
  else
    fmt::print("3D Tiles     what they take is known when the mesh is decimated\n");
  require_site(site, forecast, state, cli::Site(folder, "--tiles").tileset());
}

struct Simulation {
  std::vector<std::string> nodes;
  fs::path measured;
  std::uint64_t io_rate = 0;
  double points = 0.0;

  /// \throws UsageError  one that lacks another, or no number of nodes
  void check() const {
    if (nodes.empty() != measured.empty())
      throw UsageError(
          "--nodes and --measured go together: the times of stages come from the report of a job that ran");
    if (nodes.empty() && (io_rate > 0 || points > 0.0))
      throw UsageError("--io-rate and --points are for --nodes 1,8,64 --measured REPORT");
    counts();
  }
  std::vector<int> counts() const {
    std::vector<int> numbers;
    for (const std::string& word : nodes) {
      const std::vector<double> n = numbers_of(word, 1);
      if (n.empty() || n[0] < 1 || n[0] > kMaxNodes || n[0] != std::floor(n[0]))
        throw UsageError(fmt::format("--nodes {}: whole numbers from 1 to {}, with commas", word, kMaxNodes));
      numbers.push_back(static_cast<int>(n[0]));
    }
    return numbers;
  }

  static constexpr int kMaxNodes = 100000;
  static constexpr double kMaxScaling = 1000.0;
};

OptionTable option_table(Simulation& s) {
  OptionTable t("The same job on many machines");
  t.add("nodes", &s.nodes, "tells how long it would take on so many machines, as 1,8,64; wants --measured")
      .split()
      .shown_as("LIST");
  t.add("measured", &s.measured,
        "report of a reconstruction with the same options that ran, of a part of the scan or of one like it")
      .shown_as("REPORT");
  t.add("io-rate", &s.io_rate, "bytes a second that the shared file system moves in all; default: no bound")
      .bytes();
  t.add("points", &s.points, "as if the scan had so many points, 1e10; 0 = those that it has").at_least(0);
  return t;
}

/// A reconstruction that ran.
struct MeasuredJob {
  std::string name;  ///< of its report
  double points = 0.0;
  std::vector<StageCost> stages;
};

/// \throws InputError  it is no report of a reconstruction of this version
MeasuredJob read_measured(const fs::path& file) {
  MeasuredJob job;
  job.name = file.string();
  try {
    const Json report = parse_json(read_text(file), job.name);
    job.stages = stage_costs(report, job.name);
    job.points = result_of(report, "survey").at("points").at("kept").get<double>();
  } catch (const JsonError& e) {
    throw InputError(fmt::format("{}: is no report of a reconstruction ({})", job.name, e.what()));
  }
  return job;
}

void print_makespans(const Simulation& simulation, const MeasuredJob& measured, const Plan& plan,
                     int threads) {
  const double points = simulation.points > 0.0 ? simulation.points : static_cast<double>(plan.points());
  const std::vector<StageCost> stages = scaled(measured.stages, points / measured.points);
  fmt::print(
      "\n{:.3g} points on machines of {} threads, by the times of {} with {:.3g}; efficiency against one "
      "core "
      "that does it all\n",
      points, threads, measured.name, measured.points);
  if (points > Simulation::kMaxScaling * measured.points)
    fmt::print(
        "warning: what a job takes whatever its size was scaled {:.0f} times with the rest; measure a larger "
        "part\n",
        points / measured.points);
  fmt::print("{:>8}{:>12}{:>12}{:>12}{:>14}  {}\n", "nodes", "seconds", "efficiency", "serial", "busiest",
             "longest steps");
  for (const int nodes : simulation.counts()) {
    const Cluster cluster{nodes, threads, static_cast<double>(simulation.io_rate)};
    Makespan estimate = makespan(stages, plan_job().only_stages, cluster, {});
    fmt::print("{:>8}{:>12.1f}{:>12.2f}{:>12.1f}{:>12}/s ", nodes, estimate.seconds, estimate.efficiency,
               estimate.serial_seconds, format_bytes(static_cast<std::uint64_t>(estimate.busiest_io)));
    std::stable_sort(estimate.steps.begin(), estimate.steps.end(),
                     [](const StepSpan& a, const StepSpan& b) { return a.seconds > b.seconds; });
    estimate.steps.resize(std::min<std::size_t>(3, estimate.steps.size()));
    for (const StepSpan& span : estimate.steps)
      fmt::print(" {} {:.0f} s ({})", span.step.name, span.seconds, span.bound);
    fmt::print("\n");
  }
}

void run_plan(const ReconstructOptions& options, JobState state, const fs::path& tiles,
              const Simulation& simulation) {
  simulation.check();
  std::optional<MeasuredJob> measured;  // read before anything is planned: what it lacks is told at once
  if (!simulation.nodes.empty()) measured = read_measured(simulation.measured);
  HolesMode{options.holes};  // told before anything is measured
  if (!tiles.empty()) cli::Site(tiles, "--tiles").check(state);
  std::unique_ptr<ScratchFolder> scratch;
  const bool kept = !state.output.empty();
  if (!kept) {
    scratch = std::make_unique<ScratchFolder>(
        state.run.temp.empty() ? fs::temp_directory_path() : state.run.temp, "plan");
    state.output = scratch->path() / "plan.ply";
    state.run.temp.clear();
  }
  const Json report = run_job(state, plan_job(), cli::stderr_sink());
  const fs::path work = work_path(state.output, state.run.temp);
  const Plan plan = Plan::of_work(work);
  state.run.memory_bytes = report.at("run").at("memory_bytes").get<std::uint64_t>();
  state.run.threads = report.at("run").at("threads").get<int>();
  const Forecast forecast = Forecast::of_work(work);
  print_plan(plan, forecast, options, state, report);
  state.work = work;
  if (!tiles.empty()) print_site_plan(plan, forecast, state, tiles);
  if (measured) print_makespans(simulation, *measured, plan, state.run.threads);
  if (!state.run.report.empty()) {
    Json estimate = plan.to_json();
    estimate.update(fields_to_json(forecast));
    write_durably(state.run.report, dump_json(estimate, 1) + "\n");
  }
  if (kept)
    fmt::print("\n{} holds the plan; reconstruct with the same inputs and options goes on from it\n",
               work.string());
}

}  // namespace

cli::Command plan_command() {
  const auto tiles = std::make_shared<fs::path>();
  const auto simulation = std::make_shared<Simulation>();
  cli::Command command = cli::job_command<ReconstructOptions>(
      "plan", "What reconstruct will do: points, resolution, tasks, memory, disk, time.",
      "the mesh that reconstruct will write: the plan is kept in its work directory, for it and for task",
      [tiles, simulation](const ReconstructOptions& options, const JobState& state) {
        run_plan(options, state, *tiles, *simulation);
      });
  cli::add_tiles(command.options, *tiles);
  command.options.append(option_table(*simulation));
  return command;
}

}  // namespace tessera
