#include <optional>
#include <utility>

#include "kernels/texture/coloured_chart.h"
#include "kernels/texture/normal_map.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/stages/bake/bake_pages.h"
#include "stream/stages/bake/bake_scale.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/bake/texel_files.h"
#include "stream/stages/bake/texture_points.h"

namespace tessera {
namespace {

constexpr std::uint64_t kTexelFaceBytes = 500;

class BakeTexelsStage : public Stage {
 public:
  BakeTexelsStage(const JobState& state, const BakeOptions& options, const BakeStores& stores)
      : work_(state.work),
        options_(options),
        store_(stores.mesh(state)),
        scale_(BakeScale::of_work(state.work)),
        blocks_(scale_.blocks(store_)),
        points_(state.work / kBakePoints),
        pages_(BakePages::of_work(state.work)) {}

  std::string name() const override { return "texture-texels"; }
  std::size_t task_count() const override { return blocks_.size(); }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    const MeshBlockCut& cut = blocks_[task];
    const MeshBox box = store_.box_of(cut.patches);
    const std::vector<std::size_t> near = store_.select(box);
    std::uint64_t faces = 0;
    for (const std::size_t p : near) faces += store_.patches()[p].faces;
    return 2 * store_.block_bytes(near) + faces * kTexelFaceBytes +
           points_.count(grown(box, scale_.max_distance)) *
               (TexturePoints::bytes_per_point() + PointColours::bytes_per_point()) +
           block_raster_bytes(scale_.block_texels(cut) / (pages_.texel_scale * pages_.texel_scale),
                              options_.page_size, 12) +
           (std::uint64_t{3} << 20);
  }
  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json run(std::size_t task, TaskContext& context) const override {
    const MeshBlockCut& cut = blocks_[task];
    const MeshBlock block = store_.load(cut.patches);
    const MeshHaloBlock near = store_.load_near(cut.patches, 0.0);
    const AcrossEdges edges(near.block);
    const MeshBox box = store_.box_of(cut.patches);
    Double3 origin{};
    for (std::size_t a = 0; a < 3; ++a) origin[a] = 0.5 * (box.low[a] + box.high[a]);
    TexturePointBlock points = points_.load(grown(box, scale_.max_distance), origin);
    TexturePointBlock directed;
    std::optional<PointColours> directions;
    if (points_.cells().directions > 0) {
      directed = points.take_directions();
      if (options_.normal_map)
        directions.emplace(directed.position, directed.rgba, directed.normal,
                           PointColourOptions{scale_.spacing, scale_.max_distance, 8});
    }
    const PointColours colours(points.position, points.rgba, points.normal,
                               {scale_.spacing, scale_.max_distance, 8});
    context.count_read(store_.block_bytes(cut.patches) + points.position.size() * 20);
    const ColourSource from{block, edges, colours, origin, directions ? &*directions : nullptr};
    std::vector<Double3> normals;
    if (options_.normal_map) normals = star_normals(block, near.block);
    const ChartFile file(chart_file(work_, task), pages_.texel_scale, static_cast<int>(options_.margin));
    PackedWriter writer(context.create(texel_file(task)), kTexelKind, std::size_t{1} << 20);
    std::vector<TexelEntry> table;
    std::vector<ColouredChart> charts;
    TexelCounts counts;
    for (std::size_t c = 0; c < file.entries().size(); ++c) {
      context.check_stop();
      ColouredChart done = colour_chart(from, file.load(c), file.entries()[c].texel,
                                        static_cast<int>(options_.margin), counts);
      TexelEntry entry;
      entry.pixels = writer.append(bytes_of(done.pixels));
      if (options_.normal_map)
        entry.normals = writer.append(
            bytes_of(normal_pixels(from, done, normals, pages_.spots[pages_.first_chart[task] + c].turns)));
      entry.width = static_cast<std::uint32_t>(done.width);
      entry.height = static_cast<std::uint32_t>(done.height);
      table.push_back(entry);
      charts.push_back(std::move(done));
    }
    context.count_written(writer.finish(table));
    const ColourErrors errors = compare_colours(
        from, near.block, near.core, charts,
        {points.position, points.rgba, scale_.max_distance, points_.cells().low, scale_.spacing});
    context.advance(block.faces.size());
    return {{"inside", counts.inside},   {"bare", counts.bare},         {"points", errors.points},
            {"texture", errors.texture}, {"vertices", errors.vertices}, {"around", errors.around}};
  }

  Json finish(const std::vector<Json>& tasks, TaskContext&) const override {
    std::uint64_t inside = 0, bare = 0;
    ColourErrors all;
    for (const Json& t : tasks) {
      inside += t.at("inside").get<std::uint64_t>(), bare += t.at("bare").get<std::uint64_t>();
      all.points += t.at("points").get<std::uint64_t>(), all.texture += t.at("texture").get<std::uint64_t>();
      all.vertices += t.at("vertices").get<std::uint64_t>();
      all.around += t.at("around").get<std::uint64_t>();
    }
    Json out = {{"texels", inside}, {"without_points", bare}, {"compared_points", all.points}};
    if (all.points > 0) {
      out["psnr_db"] = colour_psnr_db(all.texture, all.points);
      out["points_around_psnr_db"] = colour_psnr_db(all.around, all.points);
      if (store_.info().colour) out["vertex_colours_psnr_db"] = colour_psnr_db(all.vertices, all.points);
    }
    return out;
  }

 private:
  std::filesystem::path work_;
  BakeOptions options_;
  MeshStore store_;
  BakeScale scale_;
  std::vector<MeshBlockCut> blocks_;
  TexturePoints points_;
  BakePages pages_;
};

}  // namespace

std::string texel_file(std::size_t block) {
  return kBakeTexels + task_file_stem(block) + ".ttx";
}

std::unique_ptr<Stage> make_bake_texels_stage(const JobState& state, const BakeOptions& options,
                                              const BakeStores& stores) {
  return std::make_unique<BakeTexelsStage>(state, options, stores);
}

}  // namespace tessera
