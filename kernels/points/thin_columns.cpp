#include "kernels/points/thin_columns.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "kernels/points/column_filters.h"

namespace tessera {
namespace {

/// What hangs is so far above the ground.
constexpr std::int32_t kThinHeight = 3 * kQuantaPerCell;
constexpr int kAroundRadius = 2;
/// What hangs is wide where it holds a square of this radius; a line of it has at least so many columns within the other.
constexpr int kThinRadius = 3, kLineRadius = 8, kThroughRadius = 4;
constexpr std::int64_t kLineColumns = 12;
/// Of what hangs, three in five columns show the ground, within a square as wide as a roof of which only the rims do; points in
/// between are one to so many columns at most; and all but one column in so many lie at the height of those around.
constexpr std::int64_t kEmptyBelow = 8, kEvenLine = 4;

}  // namespace

std::vector<std::uint8_t> find_thin_columns(std::span<const ColumnLayers> layers, int edge,
                                            std::vector<std::int32_t>& ground) {
  const ColumnSquare s{edge};
  const std::size_t n = layers.size();
  std::vector<std::int32_t> bottom(n), top(n, kNoHeight);
  std::vector<std::uint8_t> known(n), hanging(n);
  bool high = false;
  for (std::size_t i = 0; i < n; ++i) {
    bottom[i] = layers[i].bottom.height;
    known[i] = bottom[i] != kNoHeight && !layers[i].synthetic;
    high = high || (known[i] != 0 && layers[i].top.height - bottom[i] >= kThinHeight);
  }
  if (!high) return {};
  // Below roofs no wider than that it is the ground beside them.
  ground = extreme_around(s, bottom, std::vector<std::uint8_t>(n, 1), kThroughRadius, false);
  std::vector<std::int32_t> all(n), through(n), between(n);
  for (std::size_t i = 0; i < n; ++i) {
    const ColumnLayers& c = layers[i];
    if (known[i] == 0 || c.top.height - ground[i] < kThinHeight) continue;
    hanging[i] = 1, top[i] = c.top.height;
    all[i] = 1;
    through[i] = std::abs(std::int64_t{c.bottom.height} - ground[i]) <= kThinRise;
    between[i] = c.between;
  }
  const std::vector<std::int32_t> smooth = median5(s, top, hanging);
  std::vector<std::int32_t> even(n);
  for (std::size_t i = 0; i < n; ++i)
    even[i] = all[i] != 0 && std::abs(std::int64_t{top[i]} - smooth[i]) <= kQuantaPerCell;
  const std::vector<std::uint8_t> closed = erode(s, dilate(s, hanging, 1), 1);
  const std::vector<std::uint8_t> wide = dilate(s, erode(s, closed, kThinRadius), kThinRadius);
  const std::vector<std::int32_t> line = box_sums(s, all, kLineRadius);
  const std::vector<std::int32_t> across = box_sums(s, all, kThroughRadius);
  through = box_sums(s, through, kThroughRadius);
  for (std::vector<std::int32_t>* v : {&all, &between, &even}) *v = box_sums(s, *v, kAroundRadius);
  std::vector<std::uint8_t> thin(n);
  for (std::size_t i = 0; i < n; ++i)
    thin[i] = hanging[i] != 0 && wide[i] == 0 && line[i] >= kLineColumns && 5 * through[i] >= 3 * across[i] &&
              kEmptyBelow * between[i] <= all[i] && kEvenLine * even[i] >= (kEvenLine - 1) * all[i];
  // Single points of a wire lie in columns beside its line; what stands there by itself does not go with it.
  std::vector<std::uint8_t> beside = dilate(s, thin, 1);
  for (std::size_t i = 0; i < n; ++i)
    beside[i] = beside[i] != 0 && known[i] != 0 && (thin[i] != 0 || hanging[i] == 0);
  return beside;
}

}  // namespace tessera
