#include "stream/stages/tiles/folder_stage.h"

#include <utility>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"

namespace tessera {
namespace {

std::string below(const std::string& folder, const std::string& name) {
  return name.starts_with('@') ? name : folder + "/" + name;
}

class FolderContext : public TaskContext {
 public:
  FolderContext(const std::string& folder, TaskContext& outer) : folder_(folder), outer_(outer) {}
  std::filesystem::path create(const std::string& name) override {
    return outer_.create(below(folder_, name));
  }
  void check_stop() const override { outer_.check_stop(); }
  void advance(std::uint64_t units) override { outer_.advance(units); }
  void count_read(std::uint64_t bytes) override { outer_.count_read(bytes); }
  void count_written(std::uint64_t bytes) override { outer_.count_written(bytes); }

 private:
  const std::string& folder_;
  TaskContext& outer_;
};

class FolderStage : public Stage {
 public:
  FolderStage(std::string folder, std::unique_ptr<Stage> inner, std::string result_file,
              std::function<void(const Json&)> check)
      : folder_(std::move(folder)),
        inner_(std::move(inner)),
        result_file_(std::move(result_file)),
        check_(std::move(check)) {}
  std::string name() const override { return folder_ + "-" + inner_->name(); }
  std::size_t task_count() const override { return inner_->task_count(); }
  std::uint64_t task_bytes(std::size_t task) const override { return inner_->task_bytes(task); }
  std::uint64_t units() const override { return inner_->units(); }
  std::string unit_name() const override { return inner_->unit_name(); }
  std::uint64_t finish_bytes() const override { return inner_->finish_bytes(); }

  Json run(std::size_t task, TaskContext& context) const override {
    FolderContext inside(folder_, context);
    return inner_->run(task, inside);
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    FolderContext inside(folder_, context);
    Json result = inner_->finish(summaries, inside);
    if (result.empty()) return result;  // an idle stage
    if (check_) check_(result);
    if (!result_file_.empty()) write_durably(inside.create(result_file_), dump_json(result));
    return result;
  }

  std::vector<std::string> obsolete() const override {
    std::vector<std::string> names = inner_->obsolete();
    for (std::string& name : names) name = below(folder_, name);
    return names;
  }

 private:
  std::string folder_;
  std::unique_ptr<Stage> inner_;
  std::string result_file_;
  std::function<void(const Json&)> check_;
};

}  // namespace

StageEntry stage_in_folder(const std::string& folder, const StageEntry& entry, const std::string& result_file,
                           const std::function<void(const Json&)>& check) {
  return {folder + "-" + entry.name, [=](const JobState& state) -> std::unique_ptr<Stage> {
            JobState inside = state;
            inside.work = state.work / folder;
            return std::make_unique<FolderStage>(folder, entry.make(inside), result_file, check);
          }};
}

}  // namespace tessera
