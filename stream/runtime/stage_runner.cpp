#include "stream/runtime/stage_runner.h"

#include "stream/files/json.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

class PlainContext : public TaskContext {
 public:
  PlainContext(const std::filesystem::path& work, const std::function<void()>& check_stop)
      : work_(work), check_stop_(check_stop) {}
  std::filesystem::path create(const std::string& name) override {
    std::filesystem::create_directories((work_ / name).parent_path());
    return work_ / name;
  }
  void check_stop() const override {
    if (check_stop_) check_stop_();
  }
  void advance(std::uint64_t) override {}
  void count_read(std::uint64_t) override {}
  void count_written(std::uint64_t) override {}

 private:
  const std::filesystem::path& work_;
  const std::function<void()>& check_stop_;
};

}  // namespace

std::vector<Json> run_stages(const JobState& state, const std::vector<StageEntry>& stages,
                             const std::function<void()>& check_stop) {
  WorkerPool pool(state.run.threads);
  keep_freed_memory(state.run.memory_bytes, state.run.threads);
  std::vector<Json> reports;
  for (const StageEntry& entry : stages) {
    trim_allocator();
    const std::unique_ptr<Stage> stage = entry.make(state);
    MemoryBudget budget(state.run.memory_bytes, resident_bytes());
    for (std::size_t k = 0; k < stage->task_count(); ++k)
      budget.require(stage->task_bytes(k), "task " + std::to_string(k) + " of stage " + entry.name);
    budget.require(stage->finish_bytes(), "the end of stage " + entry.name);
    PlainContext context(state.work, check_stop);
    std::vector<Json> summaries(stage->task_count());
    pool.run_tasks(
        summaries.size(), [&](std::size_t k) { return stage->task_bytes(k); }, budget,
        [&](std::size_t k) { summaries[k] = stage->run(k, context); }, TaskOrder::kLargestFirst);
    pool.run_tasks(
        1, [&](std::size_t) { return stage->finish_bytes(); }, budget,
        [&](std::size_t) { reports.push_back(stage->finish(summaries, context)); });
    for (const std::string& name : stage->obsolete()) std::filesystem::remove_all(state.work / name);
  }
  return reports;
}

}  // namespace tessera
