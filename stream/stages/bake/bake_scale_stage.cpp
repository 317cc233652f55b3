#include <algorithm>
#include <cmath>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/bake/bake_scale.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/bake/texture_points.h"

namespace tessera {
namespace {

constexpr std::uint64_t kScaleTaskFaces = 1u << 20;
/// Two texels a point at least: with one, filtering blurs what points show (30.6 dB instead of 32.3 on a quarry), with four
/// pages are twice as large for 1 dB more.
constexpr double kTexelSpacings = 0.7;
constexpr double kDistanceSpacings = 8.0;
constexpr double kMaxTexels = 0x1p36;

/// Of the area of pages, what charts without their margins take.
constexpr double kFilledShare = 0.7;
/// Texels may be so much wider, in area, where that saves half a page.
constexpr double kCoarser = 1.1;

/// Not wider than asked for by more than that, so that what would be empty on the pages is used.
double texel_that_fills_pages(double area, double wanted, std::uint32_t page_size) {
  const double texels = area / (wanted * wanted) / kCoarser;
  const double largest = kFilledShare * page_size * page_size;
  double room = largest;
  if (texels > largest) {
    room *= std::ceil(texels / largest);
  } else {
    while (0.5 * room >= texels && room > 1.0) room *= 0.5;  // pages of half the area
  }
  return std::sqrt(area / room);
}

class BakeScaleStage : public Stage {
 public:
  BakeScaleStage(const JobState& state, const BakeOptions& options, const BakeStores& stores)
      : work_(state.work), options_(options), store_(stores.mesh(state)) {
    first_ = tasks_by_faces(store_.patches(), kScaleTaskFaces);
  }
  std::string name() const override { return "texture-scale"; }
  std::size_t task_count() const override { return first_.size() - 1; }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return 2 * store_.largest_patch_bytes() + (std::uint64_t{1} << 20);
  }
  std::uint64_t finish_bytes() const override {
    return store_.patches().size() * 200 + (std::uint64_t{4} << 20);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    Json areas = Json::array();
    for (std::size_t p = first_[task]; p < first_[task + 1]; ++p) {
      context.check_stop();
      const MeshBlock block = store_.load({&p, 1});
      double area = 0.0;
      for (const auto& f : block.faces)
        area += 0.5 * norm(triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]));
      areas.push_back(area);
      context.advance(block.faces.size());
    }
    return areas;
  }

  Json finish(const std::vector<Json>& tasks, TaskContext& context) const override {
    double area = 0.0;
    Json areas = Json::array();
    for (const Json& task : tasks)
      for (const Json& a : task) areas.push_back(a), area += a.get<double>();
    if (!(area > 0.0)) throw EmptyError("the mesh has no area: there is nothing to texture");
    const TexturePoints points(work_ / kBakePoints);
    BakeScale scale;
    scale.spacing = std::sqrt(area / static_cast<double>(points.cells().points));
    scale.texel = options_.one_page ? std::sqrt(area / kFilledShare) / options_.page_size
                  : options_.texel > 0.0
                      ? options_.texel
                      : texel_that_fills_pages(area, kTexelSpacings * scale.spacing, options_.page_size);
    scale.max_distance =
        options_.max_distance > 0.0 ? options_.max_distance : kDistanceSpacings * scale.spacing;
    scale.max_distance = std::max(scale.max_distance, scale.spacing);
    const double texels = area / (scale.texel * scale.texel);
    if (!(texels < kMaxTexels))
      throw UsageError("--texel " + number_text(scale.texel) + " would make " + number_text(texels) +
                       " texels: give more");
    write_text(context.create(kBakeScale), dump_json(Json{{"texel", scale.texel},
                                                          {"spacing", scale.spacing},
                                                          {"max_distance", scale.max_distance},
                                                          {"areas", areas}}));
    return {{"texel", scale.texel},
            {"spacing", scale.spacing},
            {"max_distance", scale.max_distance},
            {"area", area}};
  }

 private:
  std::filesystem::path work_;
  BakeOptions options_;
  MeshStore store_;
  std::vector<std::size_t> first_;
};

}  // namespace

BakeScale BakeScale::of_work(const std::filesystem::path& work) {
  const Json j = parse_json(read_text(work / kBakeScale));
  BakeScale scale;
  j.at("texel").get_to(scale.texel);
  j.at("spacing").get_to(scale.spacing);
  j.at("max_distance").get_to(scale.max_distance);
  j.at("areas").get_to(scale.areas);
  return scale;
}

std::vector<MeshBlockCut> BakeScale::blocks(const MeshStore& mesh) const {
  std::vector<std::uint64_t> weight;
  for (const double a : areas) weight.push_back(static_cast<std::uint64_t>(a / (texel * texel)) + 1);
  MeshBlocking blocking;
  blocking.max_faces = kBlockTextureFaces;
  blocking.max_weight = kBlockTexels;
  blocking.halves = true;
  return make_blocks(mesh, blocking, weight);
}

double BakeScale::block_texels(const MeshBlockCut& block) const {
  double sum = 0.0;
  for (const std::size_t p : block.patches) sum += areas.at(p);
  return sum / (texel * texel);
}

std::uint64_t block_raster_bytes(double texels, std::uint64_t page_size, std::uint64_t bytes_per_texel) {
  constexpr double kBoxes = 3.0;  ///< boxes of charts hold so many times their texels, at most as a rule
  return static_cast<std::uint64_t>(kBoxes * texels +
                                    2.0 * static_cast<double>(page_size * page_size) / 16.0) *
         bytes_per_texel;
}

std::unique_ptr<Stage> make_bake_scale_stage(const JobState& state, const BakeOptions& options,
                                             const BakeStores& stores) {
  return std::make_unique<BakeScaleStage>(state, options, stores);
}

}  // namespace tessera
