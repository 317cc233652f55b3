#include "stream/stages/bake/bake_needs.h"

#include <algorithm>

#include "stream/meshes/store_write_stage.h"
#include "stream/points/point_inputs.h"
#include "stream/stages/bake/bake_options.h"
#include "stream/stages/bake/bake_scale.h"
#include "stream/stages/bake/chart_files.h"
#include "stream/stages/bake/texture_points.h"
#include "stream/stages/plan/planned_patches.h"

namespace tessera {
namespace {

constexpr std::uint64_t kBakePointsFixed = std::uint64_t{24} << 20;
constexpr std::uint64_t kCellTableBytes = 27 * 120;  ///< of the cells around a patch
constexpr double kPointBytes = 20.0, kChartTexelBytes = 1.0, kTexelBytes = 6.0, kPageBytes = 2.6;
// Microseconds a point, a texel.
constexpr double kPointTime = 0.6, kChartTime = 0.15, kPackTime = 0.2, kTexelTime = 2.5, kPageTime = 0.25;
constexpr double kBlockFill = 0.5;  ///< of the texels that a block may have
/// Of the texels that blocks are cut for: one page that has room for them gets finer ones (full_page.h), .45 spacings wide, not .71.
constexpr double kFinerTexels = 2.5;

/// Of a block of so many faces while it is loaded.
std::uint64_t loading_bytes(std::uint64_t faces) {
  return MeshStore::block_bytes(bytes_of(static_cast<double>(faces), kVerticesPerFace), faces);
}

std::uint64_t texel_task_bytes(std::uint64_t page_size, double points_per_texel) {
  const auto texels = static_cast<double>(kBlockTexels);
  return block_raster_bytes(kFinerTexels * texels, page_size, 12) +
         static_cast<std::uint64_t>(2.0 * points_per_texel * texels) *
             (TexturePoints::bytes_per_point() + 60) +
         (std::uint64_t{8} << 20);
}

}  // namespace

std::uint64_t bake_points_bytes(std::uint64_t sort_bytes, std::uint64_t patches) {
  return sort_bytes + kBakePointsFixed + patches * kCellTableBytes;
}

std::vector<StageNeed> bake_needs(const RunOptions& run, std::uint64_t page_size, std::uint64_t faces,
                                  std::uint64_t brick_vertices) {
  const std::uint64_t patch_faces = std::min(faces, 2 * brick_vertices),
                      block_faces = std::min(faces, kBlockTextureFaces);
  const std::uint64_t patch = loading_bytes(patch_faces), block = loading_bytes(block_faces);
  // Blocks are halved until they have few enough faces and texels: of a large mesh some have at least half of one or the other.
  const double half = faces > kBlockTextureFaces ? kBlockFill * static_cast<double>(kBlockTexels) : 0.0;
  const auto raster = [&](double texels, std::uint64_t each) {
    return block_raster_bytes(texels, page_size, each);
  };
  const auto full = static_cast<double>(kBlockTexels);
  constexpr std::uint64_t kSlack = std::uint64_t{3} << 20;
  const StageNeed write = store_write_need(run, patch, faces / (patch_faces + 1), sort_bytes(run));
  return {{"texture-points", bake_points_bytes(sort_bytes(run), 0), 0},
          {"texture-scale", std::max(2 * patch + (std::uint64_t{1} << 20), std::uint64_t{4} << 20), 0},
          {"texture-charts",
           patch + std::min(raster(half, 9), raster(0.0, 9) + block_faces / 2 * kChartFaceBytes) + kSlack,
           block + block_faces * kChartFaceBytes + raster(full, 9) + kSlack},
          {"texture-pack", page_size * page_size / 32 + (std::uint64_t{4} << 20), 0},
          {"texture-texels", 2 * patch + raster(0.0, 12) + kSlack, texel_task_bytes(page_size, 1.0)},
          {"texture-pages", page_size * page_size * 13 + (std::uint64_t{12} << 20), 0},
          {write.stage, write.sure, write.likely + 2 * (block + 200 * block_faces)}};
}

StageForecast forecast_texture(const PlannedScan& scan, const std::string& stage, double texel,
                               bool normals) {
  const auto page_size = std::uint64_t{BakeOptions{}.page_size};
  // Two texels a point where nothing else is asked for; area from the faces of full resolution.
  const double h = scan.plan.lattice.h, area = 0.5 * scan.faces * h * h;
  const double texels = texel > 0.0 ? area / (texel * texel) : 2.0 * scan.points;
  // Vertices of full resolution have directions: half as many as faces.
  const double points = scan.points + (normals ? 0.5 * scan.faces : 0.0);
  const double pictures = normals ? 2.0 : 1.0;
  const double per_texel = texels > 0.0 ? std::min(points / texels, 4.0) : 0.0;
  const auto blocks =
      static_cast<std::uint64_t>(texels / (kBlockFill * static_cast<double>(kBlockTexels))) + 1;
  const auto pages =
      static_cast<std::uint64_t>(1.4 * texels / static_cast<double>(page_size * page_size)) + 1;
  StageForecast told = idle_forecast();
  if (stage == "texture-points") {
    told.finish_bytes = bake_points_bytes(sort_bytes(scan.run), scan.groups.size()) + PointInputs::kReadBytes;
    told.disk_bytes = bytes_of(points, kPointBytes), told.files = 1;
    told.processor_us = points * kPointTime;
    told.moved_bytes = 4.0 * static_cast<double>(told.disk_bytes);
  } else if (stage == "texture-charts") {
    told.tasks = told.files = blocks;
    told.task_bytes = block_raster_bytes(static_cast<double>(kBlockTexels), page_size, 9) +
                      kBlockTextureFaces * kChartFaceBytes;
    told.disk_bytes = bytes_of(texels, kChartTexelBytes / 4.0);
    told.processor_us = texels * kChartTime;
    told.moved_bytes = static_cast<double>(told.disk_bytes);
  } else if (stage == "texture-pack") {
    // A chart may be as large as a page; it is drawn anew for every width of texels that is tried.
    told.finish_bytes = bytes_of(texels, 0.25) + page_size * page_size * 8 + (std::uint64_t{8} << 20);
    told.files = 2;
    told.processor_us = texels * kPackTime * static_cast<double>(scan.run.threads);  // on one thread
  } else if (stage == "texture-texels") {
    told.tasks = told.files = blocks;
    told.task_bytes = texel_task_bytes(page_size, per_texel);
    told.disk_bytes = bytes_of(texels, pictures * kTexelBytes);
    told.processor_us = texels * pictures * kTexelTime;
    told.moved_bytes = static_cast<double>(told.disk_bytes) + points * kPointBytes;
  } else if (stage == "texture-pages") {
    told.tasks = told.files = pages;
    told.task_bytes = page_size * page_size * 13 + (std::uint64_t{12} << 20);
    told.disk_bytes = bytes_of(texels, pictures * kPageBytes);
    told.processor_us = texels * pictures * kPageTime;
    told.moved_bytes = texels * pictures * kTexelBytes;
  }
  return told;
}

}  // namespace tessera
