#include <fmt/format.h>

#include <memory>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/page/report_page.h"
#include "stream/page/report_value.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/report.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

struct ReportArguments {
  fs::path report;
  fs::path output;
  std::uint64_t memory_bytes = 0;
  bool force = false;
};

constexpr std::uintmax_t kMaxBytes = std::uintmax_t{256} << 20;  // far above any report

Json read_report(const fs::path& path) {
  std::error_code error;
  if (fs::is_regular_file(path, error) && fs::file_size(path, error) > kMaxBytes)
    throw InputError(path.string() + ": too large for a report of Tessera: name an OUT.report.json");
  const Json report = try_parse_json(read_text(path));
  if (text_at(report, "/tool") != "tessera" || !value_at(report, "/stages").is_array())
    throw InputError(path.string() + ": is no report of Tessera: name an OUT.report.json");
  if (value_at(report, "/schema") != kReportSchema)
    throw InputError(fmt::format("{}: is a report of schema {}, this program reads {}", path.string(),
                                 dump_json(value_at(report, "/schema")), kReportSchema));
  return report;
}

/// Where the report says it is; beside the report where both were moved.
fs::path mesh_of(const Json& report, const fs::path& path) {
  const fs::path mesh = bytes_of_json_text(text_at(report, "/output/path"));
  std::error_code error;
  if (fs::is_regular_file(mesh, error)) return mesh;
  const fs::path sibling = fs::absolute(path).parent_path() / mesh.filename();
  return mesh.has_filename() && fs::is_regular_file(sibling, error) ? sibling : mesh;
}

void run_report(const ReportArguments& a) {
  if (a.report.empty()) throw UsageError("no report given; name one: tessera report site.ply.report.json");
  const fs::path page = fs::absolute(a.output.empty() ? page_path(a.report) : a.output);
  const Json report = read_report(a.report);
  const fs::path mesh = mesh_of(report, a.report);
  cli::check_line_writes({a.report, mesh}, {{page, a.output.empty() ? "the page" : "-o",
                                             existing_by(a.force || is_page(page))}});
  const std::uint64_t memory = a.memory_bytes > 0 ? a.memory_bytes : detect_memory_cap().bytes;
  write_page(page, report, make_page_parts(report, {mesh, page.parent_path(), memory}));
  fmt::print("{}\n", page.string());
}

}  // namespace

cli::Command report_command() {
  auto arguments = std::make_shared<ReportArguments>();
  ReportArguments& a = *arguments;
  OptionTable t;
  t.add("report", &a.report, "OUT.report.json of a job").positional();
  cli::add_output(t, a.output, "page to write; default: beside the report, as .html");
  t.add("memory", &a.memory_bytes,
        "cap on the peak resident memory; default: the smallest limit of this machine x 0.8")
      .bytes();
  cli::add_force(t, a.force);
  return {"report", "The page of a finished or refused job for people (HTML), made again from its report.", t,
          [arguments] { run_report(*arguments); }};
}

}  // namespace tessera
