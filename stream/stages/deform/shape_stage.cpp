#include <algorithm>

#include "kernels/edit/thin_faces.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/deform/deform_stages.h"

namespace tessera {
namespace {

constexpr std::uint64_t kShapeSlackBytes = std::uint64_t{1} << 20;

class ShapeStage : public SerialStage {
 public:
  ShapeStage(const JobState& state, DeformOptions options)
      : options_(std::move(options)), store_(open_imported_mesh(state.work, kDeformImport)) {}
  std::string name() const override { return "shape"; }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t finish_bytes() const override { return store_.largest_patch_bytes() + kShapeSlackBytes; }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    std::uint64_t vertices = 0;
    for (const MeshPatchEntry& e : store_.patches()) vertices += e.vertices;
    const bool small = vertices <= options_.base_vertices;
    ThinArea thin;
    for (std::size_t k = 0; k < store_.patches().size() && small; ++k) {
      context.check_stop();
      const MeshBlock patch = store_.load({{k}});
      thin.add(patch.position, patch.faces);
      context.advance(patch.faces.size());
    }
    const double share = thin.share();
    const Json shape = {
        {"vertices", vertices},
        {"thin_area", share},
        {"own", small && (options_.base == "own" || (options_.base != "even" && share <= kMaxThin))}};
    write_text(context.create(kShapeFile), dump_json(shape));
    return shape;
  }

 private:
  DeformOptions options_;
  MeshStore store_;
};

}  // namespace

bool is_own_base(const JobState& state) {
  return parse_json(read_text(state.work / kShapeFile)).at("own").get<bool>();
}

std::unique_ptr<Stage> make_shape_stage(const JobState& state, const DeformOptions& options) {
  return std::make_unique<ShapeStage>(state, options);
}

}  // namespace tessera
