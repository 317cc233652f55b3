/// \file report.h
/// The run report, schema 1: what was asked, on what machine, what it took and what came out.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/runtime/resume.h"
#include "stream/runtime/stage.h"

namespace tessera {

inline constexpr int kReportSchema = 1;

/// Of this run as a whole.
struct RunFigures {
  std::string memory_cap;  ///< with its source
  double wall_seconds = 0.0;
  double cpu_seconds = 0.0;
  std::uint64_t peak_bytes = 0;
  std::size_t stages_resumed = 0;  ///< stages that earlier runs had completed
};

/// What the user should know of a finished stage's result, one sentence each; `entry` as Stage::finish gave it.
Json warnings_of(const Json& entry);

/// Keys: schema, tool, version, command, finished, machine, job (hash), options, inputs, run, wall_s, cpu_s,
/// peak_bytes, memory_cap_bytes, output {path, bytes, xxh3}, beside [{path, bytes, xxh3}], stages: a list of {name, tasks, tasks_resumed,
/// wall_s, cpu_s, tasks_s, longest_task_s, end_s (wall seconds of all tasks one after the other, of the longest, of the end), loops_s, ordered_s
/// (processor seconds of the loops of the end, and of what they do in order), peak_bytes, bytes_read, bytes_written, units, unit, result: what the stage reports}. A job with a page adds page {path, seconds, cpu_s}; one that was refused after
/// stages were committed has refused {code, meaning, message}, and of the output the path alone.
Json make_report(const JobState& state, const Json& identity, const std::vector<StageRecords>& done,
                 const std::vector<std::filesystem::path>& sidecars, const RunFigures& figures);

/// Adds a file to what stands beside the output; once, whatever is known of it.
void add_sidecar(Json& report, const std::filesystem::path& file);

/// What a stage reported; null where it did not run.
Json result_of(const Json& report, const std::string& stage);

/// run.report, or <output>.report.json.
std::filesystem::path report_path(const JobState& state);

/// True when a report of an earlier run of Tessera says that it made `file` beside this very output, and nobody has changed
/// it since; the report itself is such a file.
bool is_own_earlier_file(const JobState& state, const std::filesystem::path& file);

/// Writes report.json into the work directory and copies it to report_path().
void write_report(const JobState& state, const Json& report);

/// True when there is no work directory, but the output and a report that belongs to it and to this very job:
/// nothing is left to do. \param results  files that the job makes beside the output, which must stand as well \throws UsageError when the output is there, is not this job's and `force` is off
bool output_is_done(const JobState& state, const Json& identity,
                    const std::vector<std::filesystem::path>& results, Json& report);

}  // namespace tessera
