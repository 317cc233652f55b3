#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "stream/files/direct_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/record_file.h"
#include "stream/files/task_files.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/bake/bake_pages.h"
#include "stream/stages/bake/bake_scale.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/bake/full_page.h"

namespace tessera {
namespace {

constexpr std::size_t kSpotPage = 4096;   ///< records read at a time
constexpr double kFinestSpacings = 0.45;  ///< of the points: width of texels that are automatic
/// Masks as they were cut, and those of a trial with finer texels.
constexpr std::uint64_t kTrialShare = 4;
constexpr std::uint64_t kRasterCellBytes = 2 * 4 * kMaskCell * kMaskCell;

class BakePackStage : public SerialStage {
 public:
  BakePackStage(const JobState& state, const BakeOptions& options) : work_(state.work), options_(options) {
    files_ = list_task_files(work_ / kBakeCharts, ".tch");
    for (const std::filesystem::path& file : files_) {
      const ChartFile charts(file);
      charts_ += charts.entries().size();
      for (const ChartEntry& e : charts.entries()) {
        mask_bytes_ += e.mask.bytes + 8;
        raster_bytes_ =
            std::max(raster_bytes_, std::uint64_t{e.mask_width} * e.mask_height * kRasterCellBytes);
      }
    }
  }
  std::string name() const override { return "texture-pack"; }
  std::uint64_t units() const override { return charts_; }
  std::string unit_name() const override { return "charts"; }
  std::uint64_t finish_bytes() const override {
    return kTrialShare * mask_bytes_ + raster_bytes_ +
           charts_ * (sizeof(ChartMask) + 4 * sizeof(ChartSpot) + 64) +
           std::uint64_t{options_.page_size} * options_.page_size / 32 + (std::uint64_t{4} << 20);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    std::vector<ChartMask> masks;
    std::vector<std::uint64_t> first = {0};
    masks.reserve(charts_);
    double inside = 0.0;
    for (const std::filesystem::path& file : files_) {
      context.check_stop();
      const ChartFile charts(file);
      for (std::size_t c = 0; c < charts.entries().size(); ++c) {
        masks.push_back(charts.mask(c));
        const ChartEntry& e = charts.entries()[c];
        inside += e.plane / (e.texel * e.texel);
      }
      first.push_back(masks.size());
    }
    double cells = 0.0;
    for (const ChartMask& mask : masks) cells += mask.cells;
    const BakeScale made_for = BakeScale::of_work(work_);
    std::optional<FullPage> full = fill_one_page(
        files_, cells, options_, std::min(1.0, kFinestSpacings * made_for.spacing / made_for.texel), context);
    const double scale = full ? full->texel_scale : 1.0;
    inside /= scale * scale;
    std::uint64_t advanced = 0;
    const auto packed = [&](std::size_t charts) {
      context.advance(charts - advanced);
      advanced = charts;
    };
    const ChartPacking packing =
        full ? std::move(full->packing)
             : pack_charts(
                   masks, options_.page_size / kMaskCell, [&] { context.check_stop(); }, packed);
    DirectFile spots(context.create(kBakeSpots), std::size_t{1} << 18);
    spots.write(packing.spots.data(), packing.spots.size() * sizeof(ChartSpot));
    context.count_written(spots.finish());
    Json pages = Json::array(), sizes = Json::array();
    double texels = 0.0;
    for (const PageSize& p : packing.pages) {
      pages.push_back({p.width * kMaskCell, p.height * kMaskCell});
      texels += static_cast<double>(p.width * kMaskCell) * (p.height * kMaskCell);
    }
    write_text(context.create(kBakePages),
               dump_json(Json{{"pages", pages}, {"first_chart", first}, {"texel_scale", scale}}));
    context.advance(charts_ - advanced);
    return {
        {"pages", pages},   {"charts", charts_},      {"texel", scale * made_for.texel},
        {"texels", texels}, {"chart_texels", inside}, {"used_share", texels > 0.0 ? inside / texels : 0.0}};
  }

 private:
  std::filesystem::path work_;
  BakeOptions options_;
  std::vector<std::filesystem::path> files_;
  std::uint64_t charts_ = 0, mask_bytes_ = 0, raster_bytes_ = 0;
};

}  // namespace

BakePages BakePages::of_work(const std::filesystem::path& work) {
  const Json j = parse_json(read_text(work / kBakePages));
  BakePages out;
  j.at("first_chart").get_to(out.first_chart);
  j.at("texel_scale").get_to(out.texel_scale);
  for (const Json& p : j.at("pages"))
    out.pages.push_back({p[0].get<std::uint32_t>(), p[1].get<std::uint32_t>()});
  for_each_page<ChartSpot>(work / kBakeSpots, kSpotPage, [&](std::span<const ChartSpot> spots) {
    out.spots.insert(out.spots.end(), spots.begin(), spots.end());
  });
  return out;
}

std::vector<std::uint64_t> BakePages::charts_of(std::uint32_t page) const {
  std::vector<std::uint64_t> charts;
  for (std::uint64_t c = 0; c < spots.size(); ++c)
    if (spots[c].page == page) charts.push_back(c);
  return charts;
}

std::size_t BakePages::block_of(std::uint64_t chart) const {
  return static_cast<std::size_t>(std::upper_bound(first_chart.begin(), first_chart.end(), chart) -
                                  first_chart.begin()) -
         1;
}

Double2 page_uv(const ChartEntry& chart, const ChartSpot& spot, const BakePages::Size& page, int margin,
                const Double2& uv) {
  const double x = uv[0] / chart.texel + margin, y = uv[1] / chart.texel + margin;
  const double width = chart.mask_width * kMaskCell, height = chart.mask_height * kMaskCell;
  const std::array<Double2, 4> at = {{{x, y}, {height - y, x}, {width - x, height - y}, {y, width - x}}};
  const Double2& p = at[spot.turns % 4];
  return {(spot.x * kMaskCell + p[0]) / page.width, (spot.y * kMaskCell + p[1]) / page.height};
}

std::size_t page_texel(const ChartEntry& chart, const ChartSpot& spot, const BakePages::Size& page,
                       std::uint32_t x, std::uint32_t y) {
  const std::uint32_t right = chart.mask_width * kMaskCell - 1, top = chart.mask_height * kMaskCell - 1;
  const std::array<std::array<std::uint32_t, 2>, 4> at = {
      {{x, y}, {top - y, x}, {right - x, top - y}, {y, right - x}}};
  const auto& p = at[spot.turns % 4];
  return std::size_t{spot.y * kMaskCell + p[1]} * page.width + spot.x * kMaskCell + p[0];
}

Image page_image(const std::vector<std::uint32_t>& rgba, const BakePages::Size& page) {
  Image image{static_cast<int>(page.width), static_cast<int>(page.height), {}};
  image.rgb.resize(3 * rgba.size());
  for (std::uint32_t y = 0; y < page.height; ++y)
    for (std::uint32_t x = 0; x < page.width; ++x) {
      std::uint8_t* to = image.pixel(static_cast<int>(x), static_cast<int>(page.height - 1 - y));
      for (std::size_t c = 0; c < 3; ++c)
        to[c] = static_cast<std::uint8_t>(rgba[std::size_t{y} * page.width + x] >> (8 * c) & 255u);
    }
  return image;
}

std::string page_image_name(const std::filesystem::path& output, std::size_t page, bool jpeg) {
  return output.stem().string() + "_" + std::to_string(page) + (jpeg ? ".jpg" : ".png");
}

std::string page_image_file(std::size_t page, bool jpeg) {
  return kBakeImages + task_file_stem(page) + (jpeg ? ".jpg" : ".png");
}

std::string page_normals_name(const std::filesystem::path& output, std::size_t page) {
  return output.stem().string() + "_" + std::to_string(page) + "_normal.png";
}

std::string page_normals_file(std::size_t page) {
  return kBakeImages + task_file_stem(page) + "_normal.png";
}

std::unique_ptr<Stage> make_bake_pack_stage(const JobState& state, const BakeOptions& options) {
  return std::make_unique<BakePackStage>(state, options);
}

}  // namespace tessera
