#include "kernels/texture/page_fill.h"
#include "stream/files/json.h"
#include "stream/render/jpeg_file.h"
#include "stream/render/png_file.h"
#include "stream/stages/bake/bake_pages.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/bake/texel_files.h"

namespace tessera {
namespace {

class BakePagesStage : public Stage {
 public:
  BakePagesStage(const JobState& state, const BakeOptions& options)
      : work_(state.work), options_(options), pages_(BakePages::of_work(state.work)) {
    for (const BakePages::Size& p : pages_.pages) texels_ += std::uint64_t{p.width} * p.height;
  }
  std::string name() const override { return "texture-pages"; }
  std::size_t task_count() const override { return pages_.pages.size(); }
  std::uint64_t units() const override { return texels_; }
  std::string unit_name() const override { return "texels"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    const BakePages::Size& p = pages_.pages[task];
    // The page with its levels, the picture, a chart.
    return std::uint64_t{p.width} * p.height * (options_.is_jpeg() ? 16 : 13) + pages_.spots.size() * 8 +
           (std::uint64_t{12} << 20);
  }
  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json run(std::size_t task, TaskContext& context) const override {
    const BakePages::Size& size = pages_.pages[task];
    std::vector<std::uint32_t> rgba(std::size_t{size.width} * size.height, 0);
    std::size_t open_block = ~std::size_t{0};
    std::unique_ptr<ChartFile> charts;
    std::unique_ptr<PackedFile> texels;
    std::vector<TexelEntry> table;
    for (const std::uint64_t chart : pages_.charts_of(static_cast<std::uint32_t>(task))) {
      context.check_stop();
      if (const std::size_t block = pages_.block_of(chart); block != open_block) {
        open_block = block;
        charts = std::make_unique<ChartFile>(chart_file(work_, block));
        texels = std::make_unique<PackedFile>(work_ / texel_file(block), kTexelKind, sizeof(TexelEntry));
        table = texels->table<TexelEntry>();
      }
      const auto in_block = static_cast<std::size_t>(chart - pages_.first_chart[open_block]);
      const TexelEntry& entry = table.at(in_block);
      const std::vector<std::uint32_t> pixels = texels->load<std::uint32_t>(entry.pixels);
      for (std::uint32_t y = 0; y < entry.height; ++y)
        for (std::uint32_t x = 0; x < entry.width; ++x)
          if (const std::uint32_t c = pixels[std::size_t{y} * entry.width + x]; c >> 24 != 0)
            rgba[page_texel(charts->entries()[in_block], pages_.spots[chart], size, x, y)] = c;
    }
    fill_page(rgba, size.width, size.height);
    Image image{static_cast<int>(size.width), static_cast<int>(size.height), {}};
    image.rgb.resize(3 * rgba.size());
    for (std::uint32_t y = 0; y < size.height; ++y)
      for (std::uint32_t x = 0; x < size.width; ++x) {
        std::uint8_t* to = image.pixel(static_cast<int>(x), static_cast<int>(size.height - 1 - y));
        for (std::size_t c = 0; c < 3; ++c)
          to[c] = static_cast<std::uint8_t>(rgba[std::size_t{y} * size.width + x] >> (8 * c) & 255u);
      }
    std::vector<std::uint32_t>().swap(rgba);
    context.check_stop();
    const std::filesystem::path path = context.create(page_image_file(task, options_.is_jpeg()));
    if (options_.is_jpeg()) {
      write_jpeg(path, image, static_cast<int>(options_.quality));
    } else {
      write_png(path, image);
    }
    context.count_written(std::filesystem::file_size(path));
    context.advance(std::uint64_t{size.width} * size.height);
    return {{"bytes", std::filesystem::file_size(path)}};
  }

  Json finish(const std::vector<Json>& tasks, TaskContext&) const override {
    std::uint64_t bytes = 0;
    for (const Json& t : tasks) bytes += t.at("bytes").get<std::uint64_t>();
    return {{"bytes", bytes}, {"pages", tasks.size()}};
  }
  std::vector<std::string> obsolete() const override { return {kBakeTexels}; }

 private:
  std::filesystem::path work_;
  BakeOptions options_;
  BakePages pages_;
  std::uint64_t texels_ = 0;
};

}  // namespace

std::unique_ptr<Stage> make_bake_pages_stage(const JobState& state, const BakeOptions& options) {
  return std::make_unique<BakePagesStage>(state, options);
}

}  // namespace tessera
