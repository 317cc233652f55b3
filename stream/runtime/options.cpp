#include "stream/runtime/options.h"

#include <fmt/format.h>

#include "stream/files/json.h"
#include "stream/runtime/option_table.h"

namespace tessera {

OptionTable option_table(RunOptions& o) {
  OptionTable t("How it runs (never changes the result)");
  t.add("memory", &o.memory_bytes,
        "cap on the peak resident memory of the whole job, e.g. 512M or 2G; default: the smallest of "
        "physical memory, cgroup, SLURM and ulimit, times 0.8")
      .bytes();
  t.add("threads,t", &o.threads, "threads; 0 = one per core").within(0, 4096);
  t.add("temp", &o.temp, "folder for the work directory; default: beside the output");
  t.add("tile-size", &o.tile_cells,
        "edge of an execution tile in lattice cells, a multiple of 64; 0 = chosen by the memory cap")
      .within(0, 1 << 20);
  t.add("force", &o.force, "discard the work directory of another job and overwrite the output");
  t.add("keep", &o.keep, "keep the work directory when done");
  t.add("processes", &o.processes, "run every task as a process of its own");
  t.add("until", &o.until, "stop with exit code 7 once this stage is committed").shown_as("STAGE");
  t.add("progress", &o.progress, "progress on stderr; auto: bar on a terminal, else plain")
      .one_of({"auto", "bar", "plain", "json", "none"});
  t.add_flag(
      "verbose,v", [&o] { ++o.verbosity; }, "say more (repeatable)");
  t.add_flag(
      "quiet,q", [&o] { o.verbosity = -1; }, "say nothing but errors");
  t.add("log", &o.log, "log file; default: log.txt in the work directory");
  t.add("report", &o.report,
        "where the report goes; default: OUT.report.json; its page for people goes beside it, as .html");
  t.add_flag(
      "no-html", [&o] { o.page = false; }, "leave out the page: its pictures and figures take seconds");
  return t;
}

Json plan_to_json(const RunOptions& run) {
  return {{"memory", run.memory_bytes}, {"threads", run.threads}, {"tile-size", run.tile_cells}};
}

std::string first_difference(const Json& was, const Json& is) {
  for (const auto& [key, value] : is.items()) {
    const Json before = was.is_object() && was.contains(key) ? was.at(key) : Json();
    if (before != value) return fmt::format("{} was {} and is {}", key, dump_json(before), dump_json(value));
  }
  return "";
}

}  // namespace tessera
