#include "kernels/picture/page_levels.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace tessera {
namespace {

/// Texels from `first` on under one texel of the coarser level, in parts of a texel times the coarser count.
struct LevelWeights {
  int first = 0, count = 0;
  std::array<std::uint64_t, 3> weight{};  // two, or three where the count is odd
};

LevelWeights weights_under(int coarse, int coarse_count, int fine_count) {
  LevelWeights out;
  const std::int64_t begin = std::int64_t{coarse} * fine_count, end = begin + fine_count;
  out.first = static_cast<int>(begin / coarse_count);
  for (int j = out.first; std::int64_t{j} * coarse_count < end; ++j) {
    const std::int64_t low = std::max<std::int64_t>(begin, std::int64_t{j} * coarse_count);
    const std::int64_t high = std::min<std::int64_t>(end, (std::int64_t{j} + 1) * coarse_count);
    out.weight[static_cast<std::size_t>(out.count++)] = static_cast<std::uint64_t>(high - low);
  }
  return out;
}

}  // namespace

void halve_page(Image& page) {
  const int width = std::max(1, page.width / 2), height = std::max(1, page.height / 2);
  const double whole = static_cast<double>(page.width) * page.height;
  std::vector<LevelWeights> across;
  for (int x = 0; x < width; ++x) across.push_back(weights_under(x, width, page.width));
  // A texel is written before all that are read after it, so that one buffer does.
  std::uint8_t* to = page.rgb.data();
  for (int y = 0; y < height; ++y) {
    const LevelWeights down = weights_under(y, height, page.height);
    for (const LevelWeights& right : across) {
      std::array<std::uint64_t, 3> sum{};
      for (int j = 0; j < down.count; ++j)
        for (int i = 0; i < right.count; ++i) {
          const std::uint64_t weight =
              down.weight[static_cast<std::size_t>(j)] * right.weight[static_cast<std::size_t>(i)];
          const std::uint8_t* from = page.pixel(right.first + i, down.first + j);
          for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * from[c] * from[c];
        }
      for (const std::uint64_t s : sum)
        *to++ = static_cast<std::uint8_t>(std::floor(std::sqrt(static_cast<double>(s) / whole) + 0.5));
    }
  }
  page.width = width, page.height = height;
  page.rgb.resize(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
}

}  // namespace tessera
