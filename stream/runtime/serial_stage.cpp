#include "stream/runtime/serial_stage.h"

#include <utility>

#include "stream/files/json.h"

namespace tessera {

namespace {

class IdleStage : public SerialStage {
 public:
  explicit IdleStage(std::string name) : name_(std::move(name)) {}
  std::string name() const override { return name_; }
  std::uint64_t units() const override { return 0; }
  std::string unit_name() const override { return "faces"; }
  Json finish(const std::vector<Json>&, TaskContext&) const override { return Json::object(); }
  std::uint64_t finish_bytes() const override { return 0; }

 private:
  std::string name_;
};

}  // namespace

Json SerialStage::run(std::size_t, TaskContext&) const {
  return {};
}

std::unique_ptr<Stage> make_idle_stage(std::string name) {
  return std::make_unique<IdleStage>(std::move(name));
}

}  // namespace tessera
