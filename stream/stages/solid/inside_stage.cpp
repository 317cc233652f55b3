/// Stage "inside" of solids: an open sheet is told from a solid with holes before anything is computed of either.

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {
namespace {

constexpr std::size_t kInsideSamples = 1000;
/// Where fewer of the samples tell of a sheet, the surface stage counts every root.
constexpr double kSurelySheet = 0.75;

class InsideStage : public SerialStage {
 public:
  InsideStage(const JobState& state, const SolidModel& model)
      : work_(state.work), lines_(load_solid_lines(state.work)) {
    // Of several operands one may well be a sheet that cuts another.
    is_requested_ = model.meshes.size() == 1 && model.shapes.empty() && lines_.at(0).borders > 0;
  }

  std::string name() const override { return "inside"; }
  std::uint64_t units() const override { return is_requested_ ? lines_[0].borders : 0; }
  std::string unit_name() const override { return "border edges"; }
  std::uint64_t finish_bytes() const override { return is_requested_ ? lines_[0].bytes() : 0; }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    if (!is_requested_) return Json::object();
    const double half = load_mesh_solid(work_, 0, lines_[0]).half_share(kInsideSamples);
    context.advance(lines_[0].borders);
    if (half > kSurelySheet) refuse_open_sheet();
    return {{"half_share", half}};
  }

 private:
  std::filesystem::path work_;
  std::vector<SolidLines> lines_;
  bool is_requested_ = false;
};

}  // namespace

void refuse_open_sheet() {
  throw EmptyError(
      "the mesh is an open sheet without an inside: at most of its faces the winding number passes from "
      "about "
      "-1/2 to 1/2; close it first");
}

std::unique_ptr<Stage> make_solid_inside_stage(const JobState& state, const SolidModel& model) {
  return std::make_unique<InsideStage>(state, model);
}

}  // namespace tessera
