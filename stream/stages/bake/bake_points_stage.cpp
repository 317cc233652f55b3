#include <algorithm>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/import/crs_sidecar.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/bake/bake_colours.h"
#include "stream/stages/bake/bake_needs.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/bake/texture_points.h"

namespace tessera {
namespace {

class BakePointsStage : public SerialStage {
 public:
  BakePointsStage(const JobState& state, const BakeStores& stores)
      : work_(state.work), sort_bytes_(sort_bytes(state.run)), mesh_(stores.mesh(state)) {
    if (mesh_.face_count() == 0) throw EmptyError("the mesh has no faces: there is nothing to texture");
    colours_ = stores.colours(state);
    const Crs of_points = colours_->crs();
    if (!of_points.known()) return;
    const Crs own = crs_of_wkt(crs_of_mesh(state.inputs.at(0)));
    if (own.known() && !may_be_same(own, of_points))
      throw InputError(state.inputs.at(0).string() + ": is in " + own.name + ", the points are in " +
                       of_points.name + "; give both in one system");
  }

  std::string name() const override { return "texture-points"; }
  std::uint64_t units() const override { return std::max<std::uint64_t>(1, colours_->units()); }
  std::string unit_name() const override { return "points"; }
  std::uint64_t finish_bytes() const override {
    return bake_points_bytes(sort_bytes_, mesh_.patches().size()) + colours_->bytes();
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    std::uint64_t given = 0, kept = 0;
    context.count_written(write_texture_points(
        context.create(kBakePoints), mesh_, work_, sort_bytes_, colours_->has_normals(),
        {context, colours_->units(), units()},
        [&](TaskContext& reading, const TexturePointSink& sink) {
          colours_->read(mesh_.info().shift, reading, sink);
        },
        given, kept));
    if (kept == 0) throw EmptyError("no coloured point lies near the mesh; are both in one system?");
    Json result = {{"points", given}, {"near", kept}, {"left_out", colours_->left_out()}};
    if (const std::vector<std::string> notices = colours_->notices(); !notices.empty())
      result["warnings"] = notices;
    return result;
  }

 private:
  std::filesystem::path work_;
  std::uint64_t sort_bytes_;
  MeshStore mesh_;
  std::unique_ptr<BakeColours> colours_;
};

}  // namespace

std::unique_ptr<Stage> make_bake_points_stage(const JobState& state, const BakeStores& stores) {
  return std::make_unique<BakePointsStage>(state, stores);
}

}  // namespace tessera
