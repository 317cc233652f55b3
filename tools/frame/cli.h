/// \file cli.h
/// What the commands of `tessera` share: registration, options, exit codes.
/// A command lives in tools/<command>_command.cpp, declares its function in tools/commands.h and is listed in
/// tools/tessera.cpp:
///
///     cli::Command info_command() {
///       auto options = std::make_shared<InfoOptions>();  // defaults live in this struct
///       OptionTable table;
///       cli::add_inputs(table, options->inputs);
///       return {"info", "What a scan holds.", table, [options] { run_info(*options); }};
///     }
///
/// The function given runs after the whole line is parsed; it prints to stdout what the user asked for and
/// throws to fail.
#pragma once
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/files/planned_writes.h"
#include "stream/formats/points/point_source.h"
#include "stream/runtime/option_table.h"
#include "stream/runtime/progress.h"
#include "stream/runtime/stage.h"

namespace tessera::cli {

/// Every command also takes `--job FILE`: JSON with every option by its key ("out", "memory", "inputs", ...); what is
/// on the line wins.
struct Command {
  std::string name;
  std::string description;
  OptionTable options;
  std::function<void()> run;
  /// Where words go that are none of its options; then it takes no `--job`, which may be among them. Null: they are errors.
  std::vector<std::string>* rest = nullptr;
};

/// Positional inputs: files, folders, globs, @list. Checked by require_inputs, since a job file may give
/// them.
void add_inputs(OptionTable& table, std::vector<std::string>& inputs);
/// -o/--out
void add_output(OptionTable& table, std::filesystem::path& output, const std::string& help);
/// -t/--threads
void add_threads(OptionTable& table, int& threads, const std::string& help);

/// list_inputs(), and a line on stderr for every folder and deep glob among them.
std::vector<std::filesystem::path> expand_and_tell(const std::vector<std::string>& inputs);
/// \throws UsageError when the user gave none
void require_inputs(const std::vector<std::string>& inputs);
void require_output(const std::filesystem::path& output);
/// -o, and that it may be written: check_writes() of one output. \param reads  files that the command reads
void require_new_output(const std::filesystem::path& output, bool force,
                        const std::vector<std::filesystem::path>& reads);
/// check_writes() for a command that is no job; adds the job file of this line to `reads`.
void check_line_writes(std::vector<std::filesystem::path> reads, const std::vector<PlannedWrite>& writes);
/// The job file of this line and the lists among the inputs (@list, .vpc).
std::vector<std::filesystem::path> also_read(const std::vector<std::string>& inputs);
/// --force for commands that are no jobs.
void add_force(OptionTable& table, bool& force);
/// The only input. \throws UsageError "meshes are <verb> one at a time" \pre there is one
std::filesystem::path one_input(const std::vector<std::filesystem::path>& inputs, const std::string& verb);

/// A command that runs a job with these options (validate(), option_table()): inputs, output, the job's options, how
/// it runs.
/// \param run  gets the options, checked, and a state with inputs and settings
template <typename Options>
Command job_command(const std::string& name, const std::string& description, const std::string& output,
                    std::function<void(const Options& options, JobState state)> run) {
  struct Arguments {
    std::vector<std::string> inputs;
    Options options;
    JobState state;
  };
  auto a = std::make_shared<Arguments>();
  OptionTable table;
  add_inputs(table, a->inputs);
  add_output(table, a->state.output, output);
  table.append(option_table(a->options));
  table.append(option_table(a->state.run));
  return {name, description, table, [a, run] {
            require_inputs(a->inputs);
            a->options.validate();
            a->state.inputs = expand_and_tell(a->inputs);
            a->state.also_read = also_read(a->inputs);
            a->state.settings = to_settings(a->options);
            run(a->options, a->state);
          }};
}

/// Progress to stderr.
ProgressSink stderr_sink();

/// One line for what a job's import repaired, none for a sound mesh; warnings of the report go to stderr.
void print_repairs(const std::string& input, const Json& report);
/// One line for what `--tolerance auto` was, from `tolerance` of a report; none where a number was given.
void print_tolerance(const Json& report);
/// Lines for what --smooth and --texture did, from `smoothing` and `texture` of a report; none where there is none.
void print_smoothing(const Json& report);
void print_texture(const Json& report);

/// Parses the words of a line, the command's name first, and runs the command; throws whatever it throws.
/// \throws UsageError for a line that none of the commands takes
void run_words(const std::string& name, const std::vector<Command>& commands,
               const std::vector<std::string>& words);

/// Parses the line and runs the command chosen. Every failure is one line on stderr and a documented exit
/// code: 0 done, 2 usage, 3 input, 4 resources, 5 nothing to output, 6 validation, 7 stopped and resumable,
/// 130/143 after a signal, 70 a bug of Tessera.
int run(const std::string& name, const std::string& description, const std::vector<Command>& commands,
        int argc, char** argv);

}  // namespace tessera::cli
