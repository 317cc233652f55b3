#include "stream/runtime/job_report.h"

#include <sys/resource.h>

#include <algorithm>

#include <fmt/format.h>

#include "stream/files/durable_file.h"
#include "stream/files/path_text.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/report.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

const char* meaning(ExitCode code) {
  switch (code) {
    case ExitCode::kInput:
      return "input unreadable or invalid";
    case ExitCode::kResources:
      return "memory cap or disk cannot suffice";
    case ExitCode::kEmpty:
      return "nothing to output";
    case ExitCode::kValidation:
      return "tolerance or validation failed";
    default:
      return "options that make no sense";
  }
}

}  // namespace

double cpu_seconds() {
  double total = 0.0;
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage = {};
    ::getrusage(who, &usage);
    for (const timeval& t : {usage.ru_utime, usage.ru_stime}) {
      total += static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    }
  }
  return total;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::string cost_text(const Json& report) {
  return fmt::format("{:.1f} s, peak {}", report.at("wall_s").get<double>(),
                     format_bytes(report.at("peak_bytes").get<std::uint64_t>()));
}

void write_reports(const JobState& state, const JobDescription& job, Json& report,
                   std::chrono::steady_clock::time_point start) {
  for (const SidecarOutput& b : job.sidecars) {
    const fs::path path = b.path(state.output);
    if (!b.text || path.empty()) continue;
    if (const std::string text = b.text(report); !text.empty()) {
      write_durably(path, text);
      add_sidecar(report, path);
    } else {
      fs::remove(path);  // that of an earlier run (--force) is not of this output
    }
  }
  if (!job.page.make || !state.run.page) return write_report(state, report);
  const auto page_start = std::chrono::steady_clock::now();
  const double cpu_start = cpu_seconds();
  const auto write_page = job.page.make(state, report);
  const double cpu = cpu_seconds();
  report["page"] = {{"path", json_text(job.page.path(report_path(state)))},
                    {"seconds", seconds_since(page_start)},
                    {"cpu_s", cpu - cpu_start}};
  report["wall_s"] = seconds_since(start);
  report["cpu_s"] = cpu;
  report["peak_bytes"] = std::max(report.at("peak_bytes").get<std::uint64_t>(), peak_resident_bytes());
  write_report(state, report);
  write_page(report);
}

void report_refusal(const JobState& state, const JobDescription& job, const Error& refusal,
                    const std::function<Json()>& report_now) {
  try {
    Json report = report_now();
    report["refused"] = {{"code", static_cast<int>(refusal.code())},
                         {"meaning", meaning(refusal.code())},
                         {"message", json_text(std::string(refusal.what()))}};
    report["output"] = {{"path", json_text(state.output)}};
    write_report(state, report);
    if (job.page.make && state.run.page) job.page.make(state, report)(report);
  } catch (const std::exception&) {  // the refusal is what the user must hear of
  }
}

}  // namespace tessera
