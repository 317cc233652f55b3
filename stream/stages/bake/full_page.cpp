#include "stream/stages/bake/full_page.h"

#include <algorithm>
#include <cmath>

#include "stream/stages/bake/chart_files.h"

namespace tessera {
namespace {

constexpr double kFullest = 0.9;  ///< of a page, by masks: no trial begins fuller
constexpr double kFullnessStep = 1.02;
constexpr int kFullnessSteps = 60, kOnePageSteps = 120;
constexpr double kFirstFullness = 0.84;   ///< larger pages are looked at from here on
constexpr double kWidestScale = 1.12;     ///< of texels whose width is automatic
constexpr std::uint32_t kLeastSide = 32;  ///< cells

/// Masks of all charts with texels so much wider; empty where one is larger than the page or all are than it holds.
std::vector<ChartMask> scaled_masks(std::span<const std::filesystem::path> files, double scale, int margin,
                                    const PageSize& page, TaskContext& context) {
  std::vector<ChartMask> masks;
  const double room = static_cast<double>(page.width) * page.height;
  double cells = 0.0;
  for (const std::filesystem::path& path : files) {
    context.check_stop();
    const ChartFile file(path, scale, margin);
    for (std::size_t c = 0; c < file.entries().size(); ++c) {
      const ChartEntry& entry = file.entries()[c];
      if (std::max(entry.mask_width, entry.mask_height) > page.height ||
          std::min(entry.mask_width, entry.mask_height) > page.width)
        return {};
      masks.push_back(chart_mask(raster_chart(file.load(c), entry.texel, margin), kMaskCell));
      cells += masks.back().cells;
      if (cells > room) return {};
    }
  }
  return masks;
}

std::optional<FullPage> fill_page_of(std::span<const std::filesystem::path> files, double cells,
                                     const PageSize& page, const BakeOptions& options, double finest,
                                     TaskContext& context) {
  const double room = static_cast<double>(page.width) * page.height;
  const auto scale_of = [&](int step) {
    double fullness = kFullest;
    for (int i = 0; i < step; ++i) fullness /= kFullnessStep;
    return std::sqrt(cells / (room * fullness));
  };
  const auto trial = [&](int step) -> std::optional<FullPage> {
    const double scale = scale_of(step);
    const std::vector<ChartMask> masks =
        scaled_masks(files, scale, static_cast<int>(options.margin), page, context);
    if (masks.empty()) return std::nullopt;
    auto spots = pack_on_page(masks, page, [&] { context.check_stop(); });
    if (!spots) return std::nullopt;
    return FullPage{scale, {std::move(*spots), {page}}};
  };
  int low = -1, high = options.one_page ? kOnePageSteps : kFullnessSteps;
  while (!options.one_page && high > 0 && scale_of(high) > kWidestScale) --high;
  while (!options.one_page && low + 1 < high && scale_of(low + 1) < finest) ++low;
  std::optional<FullPage> best;
  // Most pages are filled within the first steps: by doubles to one that holds all, then halves.
  for (int step = 3; high - low > 1;) {
    const int at = best ? (low + high) / 2 : std::min(std::max(low, 0) + step, high);
    if (auto found = trial(at)) {
      best = std::move(found), high = at;
    } else if (at == high) {
      return std::nullopt;
    } else {
      low = at, step *= 2;
    }
  }
  return best;
}

}  // namespace

std::optional<FullPage> fill_one_page(std::span<const std::filesystem::path> files, double cells,
                                      const BakeOptions& options, double finest, TaskContext& context) {
  const std::uint32_t largest = options.page_size / kMaskCell;
  if (options.one_page) return fill_page_of(files, cells, {largest, largest}, options, finest, context);
  if (options.texel > 0.0) return std::nullopt;
  for (std::uint32_t side = std::min(kLeastSide, largest); side <= largest; side *= 2)
    for (const PageSize& page : {PageSize{side, side}, PageSize{side, 2 * side}}) {
      const double fullness = cells / (static_cast<double>(page.width) * page.height);
      if (page.height > largest || fullness > kFirstFullness) continue;
      if (fullness < 0.25 * kFirstFullness) return std::nullopt;  // two sizes were tried
      if (auto found = fill_page_of(files, cells, page, options, finest, context)) return found;
    }
  return std::nullopt;
}

}  // namespace tessera
