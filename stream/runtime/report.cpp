#include "stream/runtime/report.h"

#include <algorithm>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/written_hash.h"
#include "stream/runtime/log.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

std::string job_hash(const Json& identity) {
  return hex64(hash_text(dump_json(identity)));
}

Json describe_file(const fs::path& path, std::uint64_t bytes, std::uint64_t hash) {
  return {{"path", json_text(path)}, {"bytes", bytes}, {"xxh3", hex64(hash)}};
}
Json describe_file(const fs::path& path) {
  return describe_file(path, fs::file_size(path), hash_written_file(path));
}

Json describe_output(const JobState& state, const std::vector<StageRecords>& done) {
  if (state.output.empty() || !fs::exists(state.output)) return nullptr;
  for (const StageRecords& records : done)
    for (const FileRecord& file : records.finish.files)
      if (file.name == kOutputName) return describe_file(state.output, file.bytes, file.xxh3);
  return describe_file(state.output);
}

/// Whether the file at `path` is the one that a report describes.
bool stands(const fs::path& path, const Json& described) {
  std::error_code error;
  return described.is_object() && fs::is_regular_file(path, error) &&
         described.value("bytes", std::uint64_t{0}) == fs::file_size(path, error) && !error &&
         described.value("xxh3", "") == hex64(hash_file(path));
}

/// What report_path() holds; null if that is no report.
Json earlier_report(const JobState& state) {
  const fs::path path = report_path(state);
  if (!fs::is_regular_file(path)) return nullptr;
  Json report = try_parse_json(read_text(path));
  return report.is_object() && report.value("tool", Json()) == "tessera" ? report : nullptr;
}

/// What it says of a file beside the output.
Json described_sidecar(const Json& report, const fs::path& file) {
  if (report.is_object())
    for (const Json& entry : report.value("beside", Json::array()))
      if (entry.is_object() && entry.value("path", "") == json_text(file)) return entry;
  return nullptr;
}

}  // namespace

Json warnings_of(const Json& entry) {
  return entry.is_object() ? entry.value("warnings", Json::array()) : Json::array();
}

Json result_of(const Json& report, const std::string& stage) {
  for (const Json& entry : report.at("stages"))
    if (entry.at("name") == stage) return entry.at("result").empty() ? Json(nullptr) : entry.at("result");
  return nullptr;
}

Json make_report(const JobState& state, const Json& identity, const std::vector<StageRecords>& done,
                 const std::vector<fs::path>& sidecars, const RunFigures& figures) {
  Json stages = Json::array();
  Json warnings = Json::array();
  std::uint64_t peak = figures.peak_bytes;
  for (const StageRecords& records : done) {
    Json stage = records.finish.stage_stats;
    double sum = 0.0, longest = 0.0;
    for (const TaskRecord& task : records.tasks) {
      sum += task.seconds;
      longest = std::max(longest, task.seconds);
    }
    stage["tasks_s"] = sum;
    stage["longest_task_s"] = longest;
    stage["end_s"] = records.finish.seconds;
    stage["result"] = records.finish.summary;
    for (const Json& w : warnings_of(records.finish.summary)) warnings.push_back(w);
    peak = std::max(peak, stage.value("peak_bytes", std::uint64_t{0}));
    stages.push_back(std::move(stage));
  }
  Json others = Json::array();
  for (const fs::path& path : sidecars)
    if (fs::exists(path)) others.push_back(describe_file(path));
  return {{"schema", kReportSchema},
          {"tool", "tessera"},
          {"version", TESSERA_VERSION},
          {"command", json_text(command_line())},
          {"finished", utc_now()},
          {"machine", machine_description()},
          {"job", job_hash(identity)},
          {"options", identity.at("options")},
          {"inputs", identity.at("inputs")},
          {"run",
           {{"memory_bytes", state.run.memory_bytes},
            {"memory_cap", figures.memory_cap},
            {"threads", state.run.threads},
            {"tile_cells", state.run.tile_cells},
            {"processes", state.run.processes},
            {"stages_resumed", figures.stages_resumed}}},
          {"wall_s", figures.wall_seconds},
          {"cpu_s", figures.cpu_seconds},
          {"peak_bytes", peak},
          {"memory_cap_bytes", state.run.memory_bytes},
          {"stages", std::move(stages)},
          {"warnings", std::move(warnings)},
          {"output", describe_output(state, done)},
          {"beside", std::move(others)}};
}

void add_sidecar(Json& report, const fs::path& file) {
  Json others = Json::array();
  for (const Json& entry : report.at("beside"))
    if (entry.at("path") != json_text(file)) others.push_back(entry);
  others.push_back(describe_file(file));
  report["beside"] = std::move(others);
}

fs::path report_path(const JobState& state) {
  if (!state.run.report.empty()) return fs::absolute(state.run.report);
  fs::path path = state.output;
  path += ".report.json";
  return path;
}

void write_report(const JobState& state, const Json& report) {
  const std::string text = dump_json(report, 1) + "\n";
  write_text(state.work / "report.json", text);  // goes with the work directory, unless that is kept
  write_durably(report_path(state), text);
}

bool is_own_earlier_file(const JobState& state, const fs::path& file) {
  const Json report = earlier_report(state);
  if (!report.is_object()) return false;
  const Json output = report.value("output", Json());
  if (!output.is_object() || output.value("path", "") != json_text(state.output)) return false;
  return file == report_path(state) || stands(file, described_sidecar(report, file));
}

bool output_is_done(const JobState& state, const Json& identity, const std::vector<fs::path>& results,
                    Json& report) {
  if (state.run.force || !fs::exists(state.output) || fs::exists(state.work / "job.json")) return false;
  report = earlier_report(state);
  if (report.is_object() && report.value("job", "") == job_hash(identity) &&
      stands(state.output, report.value("output", Json()))) {
    return std::all_of(results.begin(), results.end(),
                       [&](const fs::path& file) { return stands(file, described_sidecar(report, file)); });
  }
  throw UsageError(
      fmt::format("{}: is there already and not the result of this very command: give --force to "
                  "overwrite it, or another -o",
                  state.output.string()));
}

}  // namespace tessera
