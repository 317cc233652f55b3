#include <algorithm>
#include <nlohmann/json.hpp>

#include "stream/files/durable_file.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/deform/deform_stages.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint64_t kSlackBytes = std::uint64_t{1} << 20;

class ShapeStage : public SerialStage {
 public:
  ShapeStage(const JobState& state, DeformOptions options)
      : options_(std::move(options)), store_(open_imported_mesh(state.work, kDeformImport)) {}
  std::string name() const override { return "shape"; }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t finish_bytes() const override { return store_.largest_patch_bytes() + kSlackBytes; }

  json finish(const std::vector<json>&, TaskContext& context) const override {
    std::uint64_t vertices = 0;
    for (const MeshPatchEntry& e : store_.patches()) vertices += e.vertices;
    const bool small = vertices <= options_.base_vertices;
    double thin = 0.0, all = 0.0;
    for (std::size_t k = 0; k < store_.patches().size() && small; ++k) {
      context.check_stop();
      const MeshBlock patch = store_.load({{k}});
      for (const auto& f : patch.faces) {
        const Double3 &a = patch.position[f[0]], &b = patch.position[f[1]], &c = patch.position[f[2]];
        const double twice = norm(triangle_normal(a, b, c));
        const double longest =
            std::max({squared_distance(a, b), squared_distance(b, c), squared_distance(c, a)});
        all += twice;
        if (twice < kThinFace * longest) thin += twice;
      }
      context.advance(patch.faces.size());
    }
    const double share = all > 0.0 ? thin / all : 0.0;
    const json shape = {{"vertices", vertices},
                        {"thin_area", share},
                        {"own", options_.base != "even" && small && share <= kMostThin}};
    write_durably(context.create(kShapeFile), shape.dump());
    return shape;
  }

 private:
  DeformOptions options_;
  MeshStore store_;
};

}  // namespace

bool is_own_base(const JobState& state) {
  return json::parse(read_text(state.work / kShapeFile)).at("own").get<bool>();
}

std::unique_ptr<Stage> make_shape_stage(const JobState& state, const DeformOptions& options) {
  return std::make_unique<ShapeStage>(state, options);
}

}  // namespace tessera
