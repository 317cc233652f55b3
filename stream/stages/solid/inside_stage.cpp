/// Stage "inside" of solids: an open sheet is told from a solid with holes before anything is computed of either, and which way
/// the faces of an open mesh show by where its inside is: its volume is known about a middle alone.

#include <algorithm>

#include "octree/error.h"
#include "stream/files/durable_file.h"
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
      : work_(state.work),
        lines_(load_solid_lines(state.work, false)),
        is_alone_(model.meshes.size() == 1 && model.shapes.empty()) {
    for (const SolidLines& l : lines_) borders_ += l.borders;
  }

  std::string name() const override { return "inside"; }
  std::uint64_t units() const override { return borders_; }
  std::string unit_name() const override { return "border edges"; }
  std::uint64_t finish_bytes() const override {
    std::uint64_t maximum = 0;
    for (const SolidLines& l : lines_)
      if (l.borders > 0) maximum = std::max(maximum, l.bytes());
    return maximum;
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    Json result = Json::object(), inside_out = Json::array();
    for (std::size_t o = 0; o < lines_.size(); ++o) {
      bool turned = lines_[o].inside_out;
      if (lines_[o].borders > 0) {
        const MeshSolid::Shares shares = load_mesh_solid(work_, o, lines_[o]).shares(kInsideSamples);
        context.advance(lines_[o].borders);
        // Of several operands one may well be a sheet that cuts another.
        if (is_alone_ && shares.half > kSurelySheet) refuse_open_sheet();
        if (is_alone_) result["half_share"] = shares.half;
        turned = turned != (shares.turned > shares.inside);
      }
      inside_out.push_back(turned);
    }
    write_text(context.create(kInsideSummary), dump_json(inside_out));
    if (borders_ > 0) result["inside_out"] = inside_out;
    return result;
  }

 private:
  std::filesystem::path work_;
  std::vector<SolidLines> lines_;
  bool is_alone_;
  std::uint64_t borders_ = 0;
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
