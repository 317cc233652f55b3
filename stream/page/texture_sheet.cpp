#include "stream/page/texture_sheet.h"

#include <algorithm>
#include <array>
#include <vector>

#include "stream/files/durable_file.h"
#include "stream/files/read_file.h"
#include "stream/formats/meshes/texture_reader.h"
#include "stream/formats/texture_image.h"
#include "stream/render/png_file.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxSheetPages = 12, kSheetColumns = 4;
constexpr std::uint32_t kThumbnail = 280, kThumbnailGap = 8;  ///< pixels
constexpr std::uint64_t kSheetCoordinateBytes = std::uint64_t{64} << 20;

/// Means of squares of texels, so that the longer side fits a thumbnail.
Image thumbnail_of(const TextureImage& page) {
  const std::uint32_t longer = std::max(page.size.width, page.size.height);
  const std::uint32_t by = (longer + kThumbnail - 1) / kThumbnail;
  Image out{static_cast<int>((page.size.width + by - 1) / by),
            static_cast<int>((page.size.height + by - 1) / by),
            {}};
  out.rgb.resize(3 * static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height));
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      std::array<std::uint32_t, 3> sum{};
      std::uint32_t count = 0;
      for (std::uint32_t j = static_cast<std::uint32_t>(y) * by;
           j < std::min(page.size.height, static_cast<std::uint32_t>(y + 1) * by); ++j)
        for (std::uint32_t i = static_cast<std::uint32_t>(x) * by;
             i < std::min(page.size.width, static_cast<std::uint32_t>(x + 1) * by); ++i, ++count)
          for (std::size_t c = 0; c < 3; ++c)
            sum[c] += page.rgb[3 * (std::size_t{j} * page.size.width + i) + c];
      for (std::size_t c = 0; c < 3; ++c)
        out.pixel(x, y)[c] = static_cast<std::uint8_t>((sum[c] + count / 2) / count);
    }
  return out;
}

}  // namespace

std::string texture_sheet(const std::filesystem::path& mesh, const std::filesystem::path& scratch,
                          std::uint64_t memory_bytes) {
  const auto textures = open_textures(mesh, std::min(memory_bytes, kSheetCoordinateBytes));
  if (!textures) return "";
  std::vector<Image> pages;
  for (const TexturePage& page : textures->pages()) {
    if (pages.size() == kMaxSheetPages) break;
    if (page.bytes == 0) continue;
    const ReadFile file(page.file);
    const auto size = texture_size(file, page.offset, page.bytes);
    if (!size || texture_image_bytes(*size, page.bytes) > memory_bytes) continue;
    pages.push_back(thumbnail_of(read_texture_image(file, page.offset, page.bytes)));
  }
  if (pages.empty()) return "";
  constexpr std::uint32_t kStep = kThumbnail + kThumbnailGap;
  const std::size_t rows = (pages.size() + kSheetColumns - 1) / kSheetColumns;
  Image sheet{
      static_cast<int>(std::min(pages.size(), kSheetColumns) * kStep), static_cast<int>(rows * kStep), {}};
  sheet.rgb.assign(3 * static_cast<std::size_t>(sheet.width) * static_cast<std::size_t>(sheet.height), 255);
  for (std::size_t p = 0; p < pages.size(); ++p)
    for (int y = 0; y < pages[p].height; ++y)
      std::copy_n(pages[p].pixel(0, y), 3 * pages[p].width,
                  sheet.pixel(static_cast<int>(p % kSheetColumns * kStep),
                              static_cast<int>(p / kSheetColumns * kStep) + y));
  const std::filesystem::path file = scratch / "textures.png";
  write_png(file, sheet);
  return read_text(file);
}

}  // namespace tessera
