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
    const std::filesystem::path path = context.create(page_image_file(task, options_.is_jpeg()));
    {
      const Image image = page_of(task, &TexelEntry::pixels, context);
      if (options_.is_jpeg()) {
        write_jpeg(path, image, static_cast<int>(options_.quality));
      } else {
        write_png(path, image);
      }
    }
    std::uint64_t bytes = std::filesystem::file_size(path);
    if (options_.normal_map) {
      const std::filesystem::path normals = context.create(page_normals_file(task));
      write_png(normals, page_of(task, &TexelEntry::normals, context));
      bytes += std::filesystem::file_size(normals);
    }
    context.count_written(bytes);
    context.advance(std::uint64_t{size.width} * size.height);
    return {{"bytes", bytes}};
  }

  Json finish(const std::vector<Json>& tasks, TaskContext&) const override {
    std::uint64_t bytes = 0;
    for (const Json& t : tasks) bytes += t.at("bytes").get<std::uint64_t>();
    return {{"bytes", bytes}, {"pages", tasks.size()}};
  }
  std::vector<std::string> obsolete() const override { return {kBakeTexels}; }

 private:
  /// Charts on their page, gaps between them filled. \param what  colours or normals
  Image page_of(std::size_t page, Section TexelEntry::*what, TaskContext& context) const {
    const BakePages::Size& size = pages_.pages[page];
    std::vector<std::uint32_t> rgba(std::size_t{size.width} * size.height, 0);
    std::size_t open_block = ~std::size_t{0};
    std::unique_ptr<ChartFile> charts;
    std::unique_ptr<PackedFile> texels;
    std::vector<TexelEntry> table;
    for (const std::uint64_t chart : pages_.charts_of(static_cast<std::uint32_t>(page))) {
      context.check_stop();
      if (const std::size_t block = pages_.block_of(chart); block != open_block) {
        open_block = block;
        charts = std::make_unique<ChartFile>(chart_file(work_, block), pages_.texel_scale,
                                             static_cast<int>(options_.margin));
        texels = std::make_unique<PackedFile>(work_ / texel_file(block), kTexelKind, sizeof(TexelEntry));
        table = texels->table<TexelEntry>();
      }
      const auto in_block = static_cast<std::size_t>(chart - pages_.first_chart[open_block]);
      const TexelEntry& entry = table.at(in_block);
      const std::vector<std::uint32_t> pixels = texels->load<std::uint32_t>(entry.*what);
      for (std::uint32_t y = 0; y < entry.height; ++y)
        for (std::uint32_t x = 0; x < entry.width; ++x)
          if (const std::uint32_t c = pixels[std::size_t{y} * entry.width + x]; c >> 24 != 0)
            rgba[page_texel(charts->entries()[in_block], pages_.spots[chart], size, x, y)] = c;
    }
    fill_page(rgba, size.width, size.height);
    return page_image(rgba, size);
  }

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
