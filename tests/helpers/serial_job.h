/// \file serial_job.h
/// Drives stages one task after the other in a folder of its own, for tests of single stages.
#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/runtime/stage.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::test {

class SerialContext : public TaskContext {
 public:
  explicit SerialContext(std::filesystem::path work) : work_(std::move(work)) {}
  std::filesystem::path create(const std::string& name) override {
    std::filesystem::create_directories((work_ / name).parent_path());
    return work_ / name;
  }
  void check_stop() const override {}
  void advance(std::uint64_t units) override { advanced += units; }
  void count_read(std::uint64_t bytes) override { read += bytes; }
  void count_written(std::uint64_t bytes) override { written += bytes; }
  std::uint64_t advanced = 0, read = 0, written = 0;

 private:
  std::filesystem::path work_;
};

/// Runs all tasks (last first when `backwards`) and the finish. Returns its report.
inline tessera::Json run_stage(const Stage& stage, const std::filesystem::path& work,
                               bool backwards = false) {
  SerialContext context(work);
  std::vector<tessera::Json> summaries(stage.task_count());
  for (std::size_t i = 0; i < summaries.size(); ++i) {
    const std::size_t k = backwards ? summaries.size() - 1 - i : i;
    summaries[k] = stage.run(k, context);
  }
  return stage.finish(summaries, context);
}

}  // namespace tessera::test
