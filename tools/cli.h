/// \file cli.h
/// What the commands of `tessera` share: registration, groups of options, exit codes.
/// A command lives in tools/<command>_command.cpp, declares its function in tools/commands.h and is called
/// from tools/tessera.cpp:
///
///     void add_info(CLI::App& app) {
///       auto options = std::make_shared<InfoOptions>();  // defaults live in this struct
///       CLI::App* command = cli::add_command(app, "info", "What a scan holds.", [options] {
///       run_info(*options); }); cli::add_inputs(*command, options->inputs);
///     }
///
/// The function given runs after the whole line is parsed; it prints to stdout what the user asked for and
/// throws to fail.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json_fwd.hpp>

#include "octree/lattice.h"
#include "stream/runtime/options.h"
#include "stream/runtime/progress.h"

namespace tessera::cli {

/// Adds a subcommand. Every command takes `--job FILE`: JSON with every option by the same key ("out",
/// "memory", "inputs", ...); flags on the line win.
CLI::App* add_command(CLI::App& app, const std::string& name, const std::string& description,
                      std::function<void()> run);

/// Positional inputs: files, folders, globs, @list. Checked by require_inputs, since a job file may give
/// them.
void add_inputs(CLI::App& command, std::vector<std::string>& inputs);
/// -o/--out
void add_output(CLI::App& command, std::filesystem::path& output, const std::string& help);
/// A size in bytes: "2G", "512MiB".
CLI::Option* add_bytes(CLI::App& command, const std::string& names, std::uint64_t& bytes,
                       const std::string& help);
/// A direction or position: "x,y,z".
CLI::Option* add_vector(CLI::App& command, const std::string& names, Double3& value, const std::string& help);
/// --memory, -t/--threads, --temp, --tile-size, --force, --keep, --processes, --until, --progress, -v/-q,
/// --log,
/// --report
void add_run_options(CLI::App& command, RunOptions& run);
/// --columns, for every command that reads text scans
void add_columns(CLI::App& command, std::vector<std::string>& columns);
/// Everything of ReconstructOptions
void add_reconstruct_options(CLI::App& command, ReconstructOptions& options);

/// Progress to stderr.
ProgressSink stderr_sink();

/// \throws UsageError when the user gave none
void require_inputs(const std::vector<std::string>& inputs);
void require_output(const std::filesystem::path& output);

/// One line for what a job's import repaired, from `input` of its report; none for a sound mesh.
void print_repairs(const std::string& input, const nlohmann::json& report);

/// "x,y,z" to numbers. \throws UsageError
Double3 parse_vector(const std::string& text);

/// Parses the line and runs the command chosen. Every failure is one line on stderr and a documented exit
/// code: 0 done, 2 usage, 3 input, 4 resources, 5 nothing to output, 6 validation, 7 stopped and resumable,
/// 130/143 after a signal, 70 a bug of Tessera.
int run(CLI::App& app, int argc, char** argv);

}  // namespace tessera::cli
