#include <algorithm>
#include <cmath>

#include "stream/files/json.h"
#include "stream/stages/bake/bake_scale.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/bake/chart_files.h"

namespace tessera {
namespace {

/// Smaller charts have more of their texels in margins, larger ones are too few to fill a page.
constexpr double kChartTexels = 256.0;

class BakeChartsStage : public Stage {
 public:
  BakeChartsStage(const JobState& state, const BakeOptions& options, const BakeStores& stores)
      : work_(state.work),
        options_(options),
        store_(stores.mesh(state)),
        scale_(BakeScale::of_work(state.work)),
        blocks_(scale_.blocks(store_)) {}

  std::string name() const override { return "texture-charts"; }
  std::size_t task_count() const override { return blocks_.size(); }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    const MeshBlockCut& cut = blocks_[task];
    return store_.block_bytes(cut.patches) + cut.faces * kChartFaceBytes +
           block_raster_bytes(scale_.block_texels(cut), options_.page_size, 9) + (std::uint64_t{3} << 20);
  }
  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json run(std::size_t task, TaskContext& context) const override {
    const MeshBlock block = store_.load(blocks_[task].patches);
    context.count_read(store_.block_bytes(blocks_[task].patches));
    context.check_stop();
    const TriangleSpan mesh{block.position, block.faces};
    const int margin = static_cast<int>(options_.margin);
    // Whole cells of a page, margins taken off.
    const double room = static_cast<double>(static_cast<int>(options_.page_size) - 2 * margin - 1);
    ChartOptions options;
    options.max_stretch = options_.max_stretch;
    options.max_extent = std::min(kChartTexels, room / 1.5) * scale_.texel;
    ChartFileWriter writer(context.create(chart_file({}, task).string()));
    ChartStretch all;
    std::uint64_t charts = 0, unfolded = 0, coarse = 0, flipped = 0, overlapping = 0;
    for (const MeshChart& chart : make_charts(mesh, options)) {
      context.check_stop();
      ChartEntry entry;
      entry.texel = scale_.texel;
      // A single face may be larger than a page.
      while (std::max(chart.extent[0], chart.extent[1]) > room * entry.texel) entry.texel *= 1.25;
      const ChartStretch stretch = measure_stretch(mesh, chart);
      entry.surface = stretch.surface, entry.plane = stretch.plane, entry.stretch = stretch.stretch;
      entry.flipped = static_cast<std::uint32_t>(count_flipped(chart));
      entry.overlapping = static_cast<std::uint32_t>(count_overlapping(chart));
      writer.add(chart, chart_mask(raster_chart(chart, entry.texel, margin), kMaskCell), entry);
      all.merge(stretch);
      ++charts, unfolded += chart.unfolded, coarse += entry.texel > scale_.texel;
      flipped += entry.flipped, overlapping += entry.overlapping;
    }
    context.count_written(writer.finish());
    context.advance(block.faces.size());
    return {{"charts", charts},   {"unfolded", unfolded},       {"coarse", coarse},
            {"flipped", flipped}, {"overlapping", overlapping}, {"surface", all.surface},
            {"plane", all.plane}, {"stretch", all.stretch}};
  }

  Json finish(const std::vector<Json>& tasks, TaskContext&) const override {
    ChartStretch all;
    Json out = Json::object();
    for (const char* key : {"charts", "unfolded", "coarse", "flipped", "overlapping"}) {
      std::uint64_t sum = 0;
      for (const Json& t : tasks) sum += t.at(key).get<std::uint64_t>();
      out[key] = sum;
    }
    for (const Json& t : tasks)
      all.merge({t.at("surface").get<double>(), t.at("plane").get<double>(), t.at("stretch").get<double>()});
    out["stretch_l2"] = all.l2();
    out["charts_per_1000_faces"] =
        1000.0 * out.at("charts").get<double>() / static_cast<double>(store_.face_count());
    out["blocks"] = blocks_.size();
    if (const auto coarse = out.at("coarse").get<std::uint64_t>(); coarse > 0)
      out["warnings"] = {std::to_string(coarse) +
                         " faces are larger than a page of such texels and get coarser ones: give a larger "
                         "--page-size or --texel, or split them (tessera remesh)"};
    return out;
  }

 private:
  std::filesystem::path work_;
  BakeOptions options_;
  MeshStore store_;
  BakeScale scale_;
  std::vector<MeshBlockCut> blocks_;
};

}  // namespace

std::unique_ptr<Stage> make_bake_charts_stage(const JobState& state, const BakeOptions& options,
                                              const BakeStores& stores) {
  return std::make_unique<BakeChartsStage>(state, options, stores);
}

}  // namespace tessera
