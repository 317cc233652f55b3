#include "stream/runtime/idle_stage.h"

#include <utility>

#include <nlohmann/json.hpp>

namespace tessera {
namespace {

using json = nlohmann::json;

class IdleStage : public Stage {
 public:
  explicit IdleStage(std::string name) : name_(std::move(name)) {}
  std::string name() const override { return name_; }
  std::size_t task_count() const override { return 0; }
  std::uint64_t task_bytes(std::size_t) const override { return 0; }
  std::uint64_t units() const override { return 0; }
  std::string unit_name() const override { return "faces"; }
  json run(std::size_t, TaskContext&) const override { return {}; }
  json finish(const std::vector<json>&, TaskContext&) const override { return json::object(); }
  std::uint64_t finish_bytes() const override { return 0; }

 private:
  std::string name_;
};

}  // namespace

std::unique_ptr<Stage> make_idle_stage(std::string name) {
  return std::make_unique<IdleStage>(std::move(name));
}

}  // namespace tessera
