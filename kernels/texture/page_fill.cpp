#include "kernels/texture/page_fill.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace tessera {
namespace {

constexpr std::uint32_t kOpaque = 0xff000000u, kPageGrey = 0xff808080u;

}  // namespace

void fill_page(std::vector<std::uint32_t>& rgba, std::uint32_t width, std::uint32_t height) {
  struct Level {
    std::vector<std::uint32_t> rgba;
    std::uint32_t width, height;
  };
  std::vector<Level> levels;
  const std::vector<std::uint32_t>* below = &rgba;
  std::uint32_t w = width, h = height;
  while (w > 1 || h > 1) {
    const std::uint32_t half_w = std::max(1u, w / 2), half_h = std::max(1u, h / 2);
    std::vector<std::uint32_t> up(std::size_t{half_w} * half_h, 0);
    for (std::uint32_t y = 0; y < half_h; ++y)
      for (std::uint32_t x = 0; x < half_w; ++x) {
        std::array<std::uint32_t, 3> sum{};
        std::uint32_t count = 0;
        for (std::uint32_t j = y * (h / half_h); j < (y + 1) * (h / half_h); ++j)
          for (std::uint32_t i = x * (w / half_w); i < (x + 1) * (w / half_w); ++i) {
            const std::uint32_t c = (*below)[std::size_t{j} * w + i];
            if (c >> 24 == 0) continue;
            ++count;
            for (std::size_t k = 0; k < 3; ++k) sum[k] += c >> (8 * k) & 255u;
          }
        if (count == 0) continue;
        std::uint32_t mean = kOpaque;
        for (std::size_t k = 0; k < 3; ++k) mean |= (sum[k] + count / 2) / count << (8 * k);
        up[std::size_t{y} * half_w + x] = mean;
      }
    levels.push_back({std::move(up), half_w, half_h});
    below = &levels.back().rgba;
    w = half_w, h = half_h;
  }
  const auto pull = [](std::vector<std::uint32_t>& to, std::uint32_t to_w, std::uint32_t to_h,
                       const Level& from) {
    for (std::uint32_t y = 0; y < to_h; ++y)
      for (std::uint32_t x = 0; x < to_w; ++x) {
        std::uint32_t& c = to[std::size_t{y} * to_w + x];
        if (c >> 24 == 0)
          c = from.rgba[std::size_t{y / (to_h / from.height)} * from.width + x / (to_w / from.width)];
      }
  };
  if (levels.empty()) {
    if (!rgba.empty() && rgba[0] >> 24 == 0) rgba[0] = kPageGrey;
    return;
  }
  if (levels.back().rgba[0] >> 24 == 0) levels.back().rgba[0] = kPageGrey;
  for (std::size_t l = levels.size() - 1; l-- > 0;)
    pull(levels[l].rgba, levels[l].width, levels[l].height, levels[l + 1]);
  pull(rgba, width, height, levels[0]);
}

}  // namespace tessera
