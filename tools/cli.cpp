#include "tools/cli.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <new>
#include <sstream>

#include <unistd.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kernels/holes/hole_filling.h"
#include "octree/error.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"

namespace tessera::cli {
namespace {

constexpr int kBugExit = 70;
constexpr int kSignalExit = 128;

/// Levenshtein distance.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitute = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substitute});
    }
  }
  return row[b.size()];
}

std::string nearest(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : known) {
    // What was typed may be a beginning ("--res"): as good as one slip.
    const bool begins = word.size() > 3 && candidate.rfind(word, 0) == 0;
    const std::size_t distance = begins ? 1 : edit_distance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
  }
  return names;
}

std::string hint(const std::string& best) {
  return best.empty() ? "" : fmt::format(", did you mean {}?", best);
}

const CLI::App& chosen_command(const CLI::App& app) {
  const auto parsed = app.get_subcommands();
  return parsed.empty() ? app : *parsed.front();
}

/// The sentence for words that CLI11 could not place.
std::string unknown_words(const CLI::App& app) {
  const CLI::App& command = chosen_command(app);
  const std::vector<std::string> words = app.remaining(true);
  const std::string word = words.empty() ? "" : words.front();
  if (&command == &app) {
    std::vector<std::string> names;
    for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(sub->get_name());
    }
    if (word.rfind('-', 0) == 0)
      return fmt::format("unknown option {}{}", word, hint(nearest(word, option_names(app))));
    return fmt::format("unknown command '{}'{}", word, hint(nearest(word, names)));
  }
  const std::string name = word.substr(0, word.find('='));
  if (name.rfind('-', 0) != 0) return fmt::format("{}: unexpected argument '{}'", command.get_name(), word);
  return fmt::format("{}: unknown option {}{} (see tessera {} --help)", command.get_name(), name,
                     hint(nearest(name, option_names(command))), command.get_name());
}

std::string json_word(const std::string& key, const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean() || value.is_number()) return value.dump();
  throw UsageError(
      fmt::format("job file: the value of '{}' must be a string, number, boolean or a list of these", key));
}

/// Fills options that the line did not give.
void apply_job_file(CLI::App& command, const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw InputError(fmt::format("{}: cannot read the job file", path.string()));
  nlohmann::json job;
  try {
    file >> job;
  } catch (const nlohmann::json::exception& e) {
    throw InputError(fmt::format("{}: not valid JSON: {}", path.string(), e.what()));
  }
  if (!job.is_object())
    throw InputError(fmt::format("{}: the job file must be one JSON object", path.string()));
  for (const auto& [key, value] : job.items()) {
    CLI::Option* option = command.get_option_no_throw(key == "inputs" ? key : "--" + key);
    if (option == nullptr || key == "job" || key == "help") {
      throw UsageError(fmt::format("{}: unknown key '{}'{}", path.string(), key,
                                   hint(nearest("--" + key, option_names(command)))));
    }
    if (option->count() > 0) continue;
    std::vector<std::string> words;
    if (value.is_array()) {
      // A list of numbers is one vector; a list of strings is a repeated option.
      const bool numbers =
          !value.empty() && std::all_of(value.begin(), value.end(),
                                        [](const nlohmann::json& item) { return item.is_number(); });
      std::string joined;
      for (const nlohmann::json& item : value) {
        if (numbers) {
          joined += (joined.empty() ? "" : ",") + json_word(key, item);
        } else {
          words.push_back(json_word(key, item));
        }
      }
      if (numbers) words.push_back(joined);
    } else {
      words.push_back(json_word(key, value));
    }
    if (words.empty()) continue;
    for (const std::string& word : words) option->add_result(word);
    option->run_callback();
  }
}

int fail(int code, const std::string& message) {
  std::cerr << "tessera: error: " << message << std::endl;
  return code;
}

int guarded(const std::function<void()>& body) {
  try {
    body();
    std::cout.flush();
    return static_cast<int>(ExitCode::kDone);
  } catch (const StoppedError& e) {
    if (stop_signal() != 0) return fail(kSignalExit + stop_signal(), e.what());
    return fail(static_cast<int>(e.code()), e.what());
  } catch (const Error& e) {
    return fail(static_cast<int>(e.code()), e.what());
  } catch (const std::bad_alloc&) {
    return fail(
        static_cast<int>(ExitCode::kResources),
        "out of memory: give a smaller --memory, so that work is cut finer, or free memory on this machine");
  } catch (const std::filesystem::filesystem_error& e) {
    const bool full = e.code() == std::errc::no_space_on_device;
    return fail(static_cast<int>(full ? ExitCode::kResources : ExitCode::kInput), e.what());
  } catch (const std::exception& e) {
    return fail(kBugExit, fmt::format("this is a bug of Tessera, please report it: {}", e.what()));
  }
}

}  // namespace

CLI::App* add_command(CLI::App& app, const std::string& name, const std::string& description,
                      std::function<void()> run) {
  CLI::App* command = app.add_subcommand(name, description);
  auto job = std::make_shared<std::filesystem::path>();
  command->add_option("--job", *job, "JSON file with every option by the same key; options given here win");
  command->callback([command, job, run = std::move(run)] {
    if (!job->empty()) apply_job_file(*command, *job);
    run();
  });
  return command;
}

void add_inputs(CLI::App& command, std::vector<std::string>& inputs) {
  command.add_option("inputs", inputs, "files, folders, globs or @list (a file with one path per line)");
}

void add_output(CLI::App& command, std::filesystem::path& output, const std::string& help) {
  command.add_option("-o,--out", output, help);
}

CLI::Option* add_bytes(CLI::App& command, const std::string& names, std::uint64_t& bytes,
                       const std::string& help) {
  return command
      .add_option_function<std::string>(
          names, [&bytes](const std::string& text) { bytes = parse_bytes(text); }, help)
      ->type_name("SIZE");
}

void print_repairs(const std::string& input, const nlohmann::json& report) {
  const nlohmann::json& repair = report.at("input").at("repair");
  static const std::pair<const char*, const char*> kWords[] = {
      {"nonfinite_vertices", "vertices without finite coordinates"},
      {"bad_faces", "faces that name no vertex dropped"},
      {"degenerate_faces", "degenerate faces dropped"},
      {"duplicate_faces", "duplicate faces dropped"},
      {"nonmanifold_edges", "edges with more than two faces taken apart"},
      {"inconsistent_edges", "edges cut where neighbours face opposite sides"},
      {"turned_faces", "faces turned"},
      {"split_vertices", "vertices split"}};
  std::string text;
  for (const auto& [key, words] : kWords) {
    const auto count = repair.value(key, std::uint64_t{0});
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, words);
  }
  if (!text.empty()) fmt::print("{}: repaired: {}\n", input, text);
}

Double3 parse_vector(const std::string& text) {
  Double3 value{};
  const char* at = text.c_str();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    char* end = nullptr;
    value[axis] = std::strtod(at, &end);
    const char expected = axis < 2 ? ',' : '\0';
    if (end == at || *end != expected || !std::isfinite(value[axis])) {
      throw UsageError(fmt::format("'{}' is not x,y,z: write three numbers with commas and no spaces", text));
    }
    at = end + 1;
  }
  return value;
}

CLI::Option* add_vector(CLI::App& command, const std::string& names, Double3& value,
                        const std::string& help) {
  return command
      .add_option_function<std::string>(
          names, [&value](const std::string& text) { value = parse_vector(text); }, help)
      ->type_name("X,Y,Z");
}

void add_run_options(CLI::App& command, RunOptions& run) {
  const std::string group = "How it runs (never changes the result)";
  add_bytes(
      command, "--memory", run.memory_bytes,
      "cap on the peak resident memory of the whole job, e.g. 512M or 2G; default: the smallest of physical "
      "memory, cgroup, SLURM and ulimit, times 0.8")
      ->group(group);
  command.add_option("-t,--threads", run.threads, "threads; 0 = one per core")
      ->capture_default_str()
      ->check(CLI::Range(0, 4096))
      ->group(group);
  command.add_option("--temp", run.temp, "folder for the work directory; default: beside the output")
      ->group(group);
  command
      .add_option("--tile-size", run.tile_cells,
                  "edge of an execution tile in lattice cells, a multiple of 64; "
                  "0 = chosen by the memory cap")
      ->capture_default_str()
      ->check(CLI::Range(0, 1 << 20))
      ->group(group);
  command
      .add_flag("--force", run.force, "discard the work directory of another job and overwrite the output")
      ->group(group);
  command.add_flag("--keep", run.keep, "keep the work directory when done")->group(group);
  command.add_flag("--processes", run.processes, "run every task as a process of its own")->group(group);
  command.add_option("--until", run.until, "stop with exit code 7 once this stage is committed")
      ->group(group);
  command
      .add_option("--progress", run.progress,
                  "progress on stderr: auto (bar on a terminal, else plain), bar, plain, "
                  "json or none")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "bar", "plain", "json", "none"}))
      ->group(group);
  command
      .add_flag_callback(
          "-v,--verbose", [&run] { ++run.verbosity; }, "say more (repeatable)")
      ->group(group);
  command
      .add_flag_callback(
          "-q,--quiet", [&run] { run.verbosity = -1; }, "say nothing but errors")
      ->group(group);
  command.add_option("--log", run.log, "log file; default: log.txt in the work directory")->group(group);
  command.add_option("--report", run.report, "where the report goes; default: OUT.report.json")->group(group);
}

void add_columns(CLI::App& command, std::vector<std::string>& columns) {
  command
      .add_option("--columns", columns,
                  "names of the columns of text scans, e.g. x,y,z,nx,ny,nz,r,g,b; default: the header line, "
                  "else x,y,z")
      ->delimiter(',')
      ->allow_extra_args(false);
}

void add_reconstruct_options(CLI::App& command, ReconstructOptions& options) {
  const std::string group = "What it computes";
  command
      .add_option("--resolution,--voxel", options.resolution,
                  "lattice spacing h, scan units; 0 = from the scan")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber)
      ->group(group);
  command
      .add_option("--radius", options.radius,
                  "support radius of the surface fit, scan units; 0 = from the scan")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber)
      ->group(group);
  command
      .add_option("--method", options.method,
                  "emc: feature-sensitive marching cubes; mc: plain, for comparison")
      ->capture_default_str()
      ->check(CLI::IsMember({"emc", "mc"}))
      ->group(group);
  command
      .add_option("--feature-angle", options.feature_angle_deg,
                  "degrees between normals from which a cell holds a sharp feature")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 180.0))
      ->group(group);
  command
      .add_option("--corner-angle", options.corner_angle_deg,
                  "degrees out of the plane of the crease from which a feature is a corner")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 180.0))
      ->group(group);
  command
      .add_option("--min-component", options.min_component,
                  "faces; smaller islands are dropped; 0 = from the scan, 1 = keep all")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--max-hole", options.max_hole,
                  "edges; holes with a rim of at most so many are filled smoothly; 0 = none")
      ->capture_default_str()
      ->check(CLI::Range(std::uint32_t{0}, kMostHoleEdges))
      ->group(group);
  command
      .add_option(
          "--holes", options.holes,
          "keep: the surface ends where the data does; close: every hole of an object is closed, of open "
          "terrain "
          "those that stay within 20 h of the data; fill-to:D: those within D of the data, scan units")
      ->capture_default_str()
      ->group(group);
  command.add_option("--outliers", options.outliers, "auto: drop isolated and flying points; off: keep all")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "off"}))
      ->group(group);
  command.add_option("--normals", options.normals, "auto: given ones, else estimated; given; estimate")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "given", "estimate"}))
      ->group(group);
  command
      .add_option("--max-uncertain", options.max_uncertain,
                  "estimated normals: share of points whose sign may stay in doubt, 0 to 1; above it the job "
                  "stops with "
                  "exit code 6, above 0.01 the job warns; both draw where; 1 = never stop")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0))
      ->group(group);
  command
      .add_option_function<std::vector<std::string>>(
          "--viewpoint",
          [&options](const std::vector<std::string>& texts) {
            options.viewpoints.clear();
            for (const std::string& text : texts) options.viewpoints.push_back(parse_vector(text));
          },
          "position of the scanner, scan units; normals point to it (repeatable)")
      ->type_name("X,Y,Z")
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option_function<std::string>(
          "--up",
          [&options](const std::string& text) {
            options.up = parse_vector(text);
            if (options.up == Double3{0, 0, 0}) throw UsageError("--up 0,0,0: has no direction");
            options.has_up = true;
          },
          "normals point to this side, for airborne scans")
      ->type_name("X,Y,Z")
      ->group(group);
  add_columns(command, options.columns);
  command.get_option("--columns")->group(group);
  command
      .add_option("--max-brick-points", options.max_brick_points,
                  "points; a brick of 64^3 cells with more is thinned to this")
      ->capture_default_str()
      ->check(CLI::PositiveNumber)
      ->group(group);
  command
      .add_option(
          "--tolerance", options.tolerance,
          "scan units; the mesh shrinks to what its geometry needs and stays, proven, within this distance; "
          "0 = every face of the lattice")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber)
      ->group(group);
  command
      .add_option("--reference", options.reference,
                  "with --tolerance: surface = the mesh of full resolution, both ways; points = every point "
                  "used too, "
                  "one way: passes use what the points, measured first, leave of it; exit code 6 where that "
                  "is nothing")
      ->capture_default_str()
      ->check(CLI::IsMember({"surface", "points"}))
      ->group(group);
  command
      .add_flag(
          "--keep-raw", options.keep_raw,
          "with --tolerance: also write the mesh of full resolution, as OUT with .raw before its extension")
      ->group(group);
  command
      .add_flag("--local-output", options.local_output,
                "write positions relative to the global shift, as floats; the report has the shift")
      ->group(group);
}

ProgressSink stderr_sink() {
  return {[](const std::string& text) { std::cerr << text << std::flush; }, ::isatty(STDERR_FILENO) == 1};
}

void require_inputs(const std::vector<std::string>& inputs) {
  if (inputs.empty()) throw UsageError("no input given: name files, folders, globs or @list");
}

void require_output(const std::filesystem::path& output) {
  if (output.empty()) throw UsageError("no output given: name it with -o FILE");
}

int run(CLI::App& app, int argc, char** argv) {
  return guarded([&] {
    try {
      app.parse(argc, argv);
    } catch (const CLI::Success& e) {
      app.exit(e);
    } catch (const CLI::ExtrasError&) {
      throw UsageError(unknown_words(app));
    } catch (const CLI::ParseError& e) {
      if (!app.remaining(true).empty()) throw UsageError(unknown_words(app));
      const CLI::App& command = chosen_command(app);
      const std::string where = &command == &app ? "" : command.get_name() + ": ";
      throw UsageError(where + e.what());
    }
  });
}

}  // namespace tessera::cli
