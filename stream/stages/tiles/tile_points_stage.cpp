#include "stream/stages/tiles/tile_points_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "kernels/texture/point_means.h"
#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/meshes/texture_option.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/bake/bake_colours.h"
#include "stream/stages/bake/bake_needs.h"
#include "stream/stages/bake/progress_share.h"
#include "stream/stages/bake/texture_colours.h"
#include "stream/stages/bake/texture_points.h"
#include "stream/stages/tiles/tile_levels.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPointsFile = "texture/points.ttp";  ///< of the job, and of a level
constexpr const char* kPointsScale = "texture/scale.json";
constexpr int kLevelsBelow = 2;      ///< whose faces are as wide as the points of a level lie apart
constexpr double kTexelShare = 0.7;  ///< of the spacing, as of baked textures: two texels a point
/// Cells of a file of points are so many cubes of means wide, or a few more: few cells to look through, few points in one.
constexpr double kCubesPerCell = 8.0;
constexpr std::uint64_t kMeasuringPart =
    4;  ///< one so many of the time, about: the area, before points are read

/// Vertices of the mesh, and points on its wide faces.
class SurfaceColours : public BakeColours {
 public:
  SurfaceColours(MeshStore vertices, MeshStore faces, double spacing)
      : vertices_(colours_of_store(std::move(vertices))), faces_(std::move(faces)), spacing_(spacing) {}
  void read(const Double3& shift, TaskContext& context, const TexturePointSink& sink) override {
    vertices_->read(shift, context, sink);
    const Double3 by = faces_.info().shift - shift;
    for (std::size_t p = 0; p < faces_.patches().size(); ++p) {
      context.check_stop();
      sample_wide_faces(
          faces_.load(std::array{p}), spacing_,
          [&](const Double3& at, std::uint32_t rgba, const Double3& n) { sink(at + by, rgba, n); });
      context.advance(faces_.patches()[p].faces);
    }
  }
  std::uint64_t units() const override { return vertices_->units() + faces_.face_count(); }
  std::uint64_t bytes() const override { return vertices_->bytes(); }
  bool has_normals() const override { return true; }

 private:
  std::unique_ptr<BakeColours> vertices_;
  MeshStore faces_;
  double spacing_;
};

/// Least share of a brick, a power of two, so that cells are as wide as `width` at the least.
double share_for(const MeshStore& mesh, double width) {
  double share = TexturePointCells{}.share;
  for (int i = 0; i < 40 && TextureCells::around(mesh, share).edge < width; ++i) share *= 2.0;
  return share;
}

Json read_scale(const fs::path& work) {
  return parse_json(read_text(work / kPointsScale));
}

/// How much wider than those of level 0 the faces of a level are.
double widening(const fs::path& work, int level) {
  return std::sqrt(static_cast<double>(open_level(work, 0).face_count()) /
                   static_cast<double>(std::max<std::uint64_t>(1, open_level(work, level).face_count())));
}

/// The level with the points that a level's textures are made of.
int level_of_points(const fs::path& work, int level) {
  if (read_scale(work).at("pages").get<bool>()) return level;
  return level == 0 ? -1 : std::max(0, level - kLevelsBelow);
}
fs::path points_path(const fs::path& work, int level) {
  return level == 0 ? work / kPointsFile : work / level_folder(level) / kPointsFile;
}

class TilePointsStage : public SerialStage {
 public:
  TilePointsStage(const JobState& state, const TilesOptions& options)
      : state_(state), texture_(options.texture), mesh_(open_level(state.work, 0)) {
    pages_ = has_textures(state.inputs.at(0));
    if (!pages_ && !mesh_.info().colour)
      throw InputError(
          state.inputs.at(0).string() +
          ": has no colours, so there is nothing for --texture to show; tessera bake takes those "
          "of a scan");
    if (pages_) colours_ = colours_of_textures(state.inputs.at(0), state);
    for (const MeshPatchEntry& p : mesh_.patches()) vertices_ += p.vertices;
  }
  std::string name() const override { return "texture-points"; }
  std::uint64_t units() const override { return mesh_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t finish_bytes() const override {
    return tile_points_bytes(sort_bytes(state_.run), mesh_.patches().size()) +
           (pages_ ? colours_->bytes() : 0) + 10 * mesh_.largest_patch_bytes();
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    double area = 0.0;
    ProgressShare measuring(context, mesh_.face_count(), mesh_.face_count() / kMeasuringPart);
    for (std::size_t p = 0; p < mesh_.patches().size(); ++p) {
      context.check_stop();
      const MeshBlock block = mesh_.load(std::array{p});
      for (const auto& f : block.faces)
        area += 0.5 * norm(triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]));
      measuring.advance(block.faces.size());
    }
    measuring.complete();
    if (!(area > 0.0)) throw EmptyError("the mesh has no area: there is nothing to texture");
    // Vertices at seams of patches are counted more than once: the spacing comes out a little less than it is.
    double spacing = std::sqrt(area / static_cast<double>(vertices_));
    std::uint64_t given = 0, kept = 0;
    std::unique_ptr<BakeColours> surface;
    if (!pages_)
      surface =
          std::make_unique<SurfaceColours>(open_level(state_.work, 0), open_level(state_.work, 0), spacing);
    BakeColours& from = pages_ ? *colours_ : *surface;
    context.count_written(write_texture_points(
        context.create(kPointsFile), mesh_, state_.work, sort_bytes(state_.run), from.has_normals(),
        {context, from.units(), mesh_.face_count() - mesh_.face_count() / kMeasuringPart},
        [&](TaskContext& reading, const TexturePointSink& sink) {
          from.read(mesh_.info().shift, reading, sink);
        },
        given, kept, {share_for(mesh_, kCubesPerCell * spacing), true}));
    if (kept == 0) throw EmptyError("the textures of the mesh show nothing of it");
    spacing = std::sqrt(area / static_cast<double>(kept));
    const double texel = texture_ == kAutoTexture ? kTexelShare * spacing : texture_;
    write_text(context.create(kPointsScale),
               dump_json(Json{{"texel", texel}, {"spacing", spacing}, {"area", area}, {"pages", pages_}}));
    Json result = {
        {"from", pages_ ? "textures" : "vertices"}, {"points", kept}, {"spacing", spacing}, {"texel", texel}};
    if (const std::vector<std::string> notices = from.notices(); !notices.empty())
      result["warnings"] = notices;
    return result;
  }

 private:
  JobState state_;
  double texture_;
  MeshStore mesh_;
  bool pages_ = false;
  std::unique_ptr<BakeColours> colours_;
  std::uint64_t vertices_ = 0;
};

class LevelPointsStage : public SerialStage {
 public:
  LevelPointsStage(const JobState& state, int level)
      : sort_bytes_(sort_bytes(state.run)),
        temp_(state.work),
        mesh_(open_level(state.work.parent_path(), 0)),
        below_(points_path(state.work.parent_path(), level - 1)) {
    const Json scale = read_scale(state.work.parent_path());
    wanted_ = std::max(scale.at("spacing").get<double>(), scale.at("texel").get<double>() / kTexelShare) *
              widening(state.work.parent_path(), level);
  }
  std::string name() const override { return "texture-points"; }
  std::uint64_t units() const override { return below_.cells().points; }
  std::string unit_name() const override { return "points"; }
  std::uint64_t finish_bytes() const override {
    return tile_points_bytes(sort_bytes_, mesh_.patches().size()) + 200 * below_.largest_cell();
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    // Cubes that fill cells: then none has points in two.
    double cube = below_.cells().edge;
    while (cube > wanted_ * kHalfStep) cube *= 0.5;
    std::uint64_t given = 0, kept = 0;
    context.count_written(write_texture_points(
        context.create(kPointsFile), mesh_, temp_, sort_bytes_, true, {context, units(), units()},
        [&](TaskContext& reading, const TexturePointSink& sink) {
          below_.for_each_cell([&](const Double3& low, const TexturePointBlock& points) {
            reading.check_stop();
            mean_points(
                points.position, points.rgba, points.normal, cube,
                [&](const Double3& p, std::uint32_t rgba, const Double3& n) { sink(p + low, rgba, n); });
            reading.advance(points.position.size());
          });
        },
        given, kept, {share_for(mesh_, kCubesPerCell * cube), false}));
    return {{"cube", cube}, {"points", kept}};
  }

 private:
  static constexpr double kHalfStep = 1.4142135623730951;
  std::uint64_t sort_bytes_;
  fs::path temp_;
  MeshStore mesh_;
  TexturePoints below_;
  double wanted_ = 0.0;
};

}  // namespace

TileTextureScale TileTextureScale::of_level(const fs::path& work, int level) {
  const int from = level_of_points(work, level);
  const Json scale = read_scale(work);
  TileTextureScale out;
  out.points = points_path(work, from);
  out.texel = scale.at("texel").get<double>() * widening(work, from);
  const auto points = static_cast<double>(TexturePoints(out.points).cells().points);
  out.spacing = std::sqrt(scale.at("area").get<double>() / points);
  return out;
}

bool level_has_texture(const fs::path& work, const TilesOptions& options, int level) {
  return options.has_texture() && level_of_points(work, level) >= 0;
}

std::uint64_t tile_points_bytes(std::uint64_t sort_bytes, std::uint64_t patches) {
  return bake_points_bytes(sort_bytes, patches);
}

std::unique_ptr<Stage> make_tile_points_stage(const JobState& state, const TilesOptions& options) {
  return std::make_unique<TilePointsStage>(state, options);
}

std::unique_ptr<Stage> make_level_points_stage(const JobState& state, int level) {
  return std::make_unique<LevelPointsStage>(state, level);
}

}  // namespace tessera
