/// \file options.h
/// How jobs run; what a job computes are options of its own (option_table.h).
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "stream/files/json.h"

namespace tessera {

/// How a job runs. Nothing here changes a byte of the result.
struct RunOptions {
  std::uint64_t memory_bytes = 0;  ///< cap on peak RSS; 0 = detect (physical, cgroup, SLURM, ulimit) x 0.8
  int threads = 0;                 ///< 0 = all cores
  int tile_cells = 0;              ///< edge of an execution tile, multiple of 64; 0 = by the cap
  std::filesystem::path temp;      ///< where the work directory goes; empty = beside the output
  bool force = false;              ///< discard a work directory of another job, overwrite the output
  bool keep = false;               ///< keep the work directory
  bool processes = false;          ///< run every task as its own process (`tessera task`)
  std::string until;               ///< stop (exit code 7) once this stage is committed
  std::string progress = "auto";   ///< bar, plain, json, none; auto = bar on a terminal, else plain
  std::filesystem::path log;       ///< log file; empty = <work>/log.txt
  std::filesystem::path report;    ///< copy of report.json; empty = <output>.report.json
  bool page = true;                ///< write the report for people beside it
  int verbosity = 0;               ///< -1 quiet .. 2
};

class OptionTable;
OptionTable option_table(RunOptions& options);

/// What of RunOptions decides how work is cut into tasks.
Json plan_to_json(const RunOptions& run);

/// "resolution was 0.1 and is 0.2": the first difference between two flat objects, empty if there is none.
std::string first_difference(const Json& was, const Json& is);

}  // namespace tessera
