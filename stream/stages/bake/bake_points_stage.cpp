#include <array>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/import/crs_sidecar.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/bake/texture_points.h"
#include "stream/survey/measured_points.h"

namespace tessera {
namespace {

constexpr std::size_t kReadAhead = 3;  ///< slices of a scan
constexpr std::uint64_t kBakePointsFixed = std::uint64_t{24} << 20;

class BakePointsStage : public SerialStage {
 public:
  BakePointsStage(const JobState& state, const BakeOptions& options, const BakeStores& stores)
      : work_(state.work), sort_bytes_(sort_bytes(state.run)), mesh_(stores.mesh(state)) {
    if (mesh_.face_count() == 0) throw EmptyError("the mesh has no faces: there is nothing to texture");
    if (stores.fine) {
      fine_ = std::make_unique<MeshStore>(stores.fine(state));
      if (!fine_->info().colour)
        throw InputError("the finer mesh has no colours, so there is nothing to bake");
      return;
    }
    scans_.assign(state.inputs.begin() + 1,
                  state.inputs.begin() + 1 + static_cast<std::ptrdiff_t>(options.scans));
    const std::unique_ptr<MeasuredPoints> points = open_measured_scans(scans_, {}, kReadAhead);
    if (!points->attributes.colour)
      throw InputError(scans_.front().string() + ": its points have no colours, so there is nothing to bake");
    const Crs own = crs_of_wkt(crs_of_mesh(state.inputs.at(0)));
    if (own.known() && points->crs.known() && !may_be_same(own, points->crs))
      throw InputError(state.inputs.at(0).string() + ": is in " + own.name + ", the points are in " +
                       points->crs.name + "; give both in one system");
  }

  std::string name() const override { return "texture-points"; }
  std::uint64_t units() const override { return 1; }
  std::string unit_name() const override { return "passes"; }
  std::uint64_t finish_bytes() const override {
    return sort_bytes_ + kBakePointsFixed + mesh_.patches().size() * 27 * 120 +
           (fine_ ? 8 * fine_->largest_patch_bytes() : kReadAhead * kSliceMemory);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    std::uint64_t given = 0, kept = 0, left_out = 0;
    Json warnings = Json::array();
    const auto give = [&](const TexturePointSink& sink) {
      if (fine_) {
        give_vertices(sink, context);
      } else {
        const std::unique_ptr<MeasuredPoints> points = open_measured_scans(scans_, {}, kReadAhead);
        const Double3 by = points->shift - mesh_.info().shift;
        points->read([&](const PointChunk& chunk) {
          context.check_stop();
          if (chunk.rgba.empty()) return;  // of a scan without colours among others
          for (std::size_t i = 0; i < chunk.size(); ++i)
            sink(Double3{chunk.x[i], chunk.y[i], chunk.z[i]} + by, chunk.rgba[i] & 0xffffffu, {});
        });
        left_out = points->left_out;
        for (const std::string& notice : points->notices()) warnings.push_back(notice);
      }
    };
    context.count_written(write_texture_points(context.create(kBakePoints), mesh_, work_, sort_bytes_,
                                               fine_ != nullptr, give, given, kept));
    context.advance(1);
    if (kept == 0) throw EmptyError("no coloured point lies near the mesh; are both in one system?");
    Json result = {{"points", given}, {"near", kept}, {"left_out", left_out}};
    if (!warnings.empty()) result["warnings"] = warnings;
    return result;
  }

 private:
  /// Vertices of the finer mesh with the normals of their stars, each once.
  void give_vertices(const TexturePointSink& sink, TaskContext& context) const {
    const Double3 by = fine_->info().shift - mesh_.info().shift;
    for (std::size_t p = 0; p < fine_->patches().size(); ++p) {
      context.check_stop();
      const MeshHaloBlock near = fine_->load_near(std::array{p}, 0.0);
      const MeshBlock& block = near.block;
      std::vector<Double3> normal(block.key.size(), Double3{});
      for (const auto& f : block.faces) {
        const Double3 n = triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]);
        for (const std::uint32_t v : f) normal[v] = normal[v] + n;
      }
      for (const std::uint32_t v : near.core_vertices.at(0))
        if (near.first_patch[v] == p)
          sink(block.position[v] + by, block.rgba[v] & 0xffffffu, unit_or_zero(normal[v]));
    }
  }

  std::filesystem::path work_;
  std::uint64_t sort_bytes_;
  MeshStore mesh_;
  std::unique_ptr<MeshStore> fine_;
  std::vector<std::filesystem::path> scans_;
};

}  // namespace

std::unique_ptr<Stage> make_bake_points_stage(const JobState& state, const BakeOptions& options,
                                              const BakeStores& stores) {
  return std::make_unique<BakePointsStage>(state, options, stores);
}

}  // namespace tessera
