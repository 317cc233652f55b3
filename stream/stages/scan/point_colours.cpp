#include "stream/stages/scan/point_colours.h"

#include <algorithm>
#include <cmath>

#include "octree/error.h"
#include "stream/formats/points/point_records.h"

namespace tessera {
namespace {

/// Of the standard classes (LAS 1.4): never classified, unclassified, ground, low, medium and high vegetation, building,
/// low noise, key point, water, rail, road, overlap, wire guard, conductor, tower, connector, bridge deck, high noise.
constexpr std::array<std::uint32_t, 19> kClassColours = {
    0xb4b4b4, 0xc8c8c8, 0xa0784b, 0xa5d46a, 0x5aaa3c, 0x1e7828, 0xd25046, 0xff00ff, 0x8c643c, 0x3c78dc,
    0x786e82, 0x505050, 0xdcdcb4, 0xf0c83c, 0xffa000, 0x8c3cb4, 0xc85ad2, 0x6ec8c8, 0xff3ca0};

std::uint32_t class_colour(std::uint8_t kind) {
  const std::uint32_t rgb = kClassColours[kind < kClassColours.size() ? kind : 1];
  return pack_rgb(rgb >> 16, rgb >> 8 & 255u, rgb & 255u);
}

/// Blue, cyan, green, yellow, red.
std::uint32_t height_colour(double t) {
  const auto at = static_cast<std::uint32_t>(std::clamp(t, 0.0, 1.0) * (4 * 255));
  const std::uint32_t part = at % 255;
  switch (at / 255) {
    case 0:
      return pack_rgb(0, part, 255);
    case 1:
      return pack_rgb(0, 255, 255 - part);
    case 2:
      return pack_rgb(part, 255, 0);
    case 3:
      return pack_rgb(255, 255 - part, 0);
    default:
      return pack_rgb(255, 0, 0);
  }
}

std::size_t bin_of(std::uint16_t intensity) {
  return static_cast<std::size_t>(std::sqrt(static_cast<double>(intensity)));  // IEEE: the same everywhere
}

}  // namespace

ColourBy colour_by(const std::string& word) {
  if (word == "intensity") return ColourBy::kIntensity;
  if (word == "class") return ColourBy::kClass;
  if (word == "height") return ColourBy::kHeight;
  return word == "none" ? ColourBy::kNone : ColourBy::kRgb;
}

bool has_point_colours(ColourBy by, const PointInputs& inputs) {
  if (by == ColourBy::kRgb) return inputs.has_colour();
  bool tells = false;
  for (std::size_t i = 0; i < inputs.file_count(); ++i) {
    const PointAttributes& has = inputs.file(i).info().attributes;
    tells = tells || (by == ColourBy::kClass ? has.echo : has.intensity_16);
  }
  if (!tells && (by == ColourBy::kIntensity || by == ColourBy::kClass))
    throw UsageError(std::string("--colour ") + (by == ColourBy::kClass ? "class" : "intensity") +
                     ": no input tells that of its points, LAS files do" +
                     (by == ColourBy::kIntensity ? ", and E57, PTX and PLY files may" : ""));
  return by != ColourBy::kNone;
}

void IntensityHistogram::add(const PointChunk& chunk) {
  for (const std::uint16_t v : chunk.intensity) ++counts_[bin_of(v)];
}

void IntensityHistogram::merge(const std::vector<std::uint64_t>& counts) {
  for (std::size_t b = 0; b < std::min(counts.size(), counts_.size()); ++b) counts_[b] += counts[b];
}

std::array<double, 2> IntensityHistogram::range() const {
  std::uint64_t all = 0;
  for (const std::uint64_t n : counts_) all += n;
  const std::uint64_t cut = all / 50;
  std::size_t low = 0;
  std::size_t high = counts_.size() - 1;
  for (std::uint64_t below = counts_[low]; low + 1 < counts_.size() && below <= cut;) below += counts_[++low];
  for (std::uint64_t above = counts_[high]; high > low && above <= cut;) above += counts_[--high];
  const auto square = [](std::size_t v) { return static_cast<double>(v * v); };
  return {square(low), square(high + 1)};
}

void colour_points(ColourBy by, const Plan& plan, const PointChunk& chunk, const std::vector<double>& z,
                   std::vector<std::uint32_t>& rgba) {
  rgba.assign(chunk.size(), 0);
  const double low = plan.colour_range[0];
  const double scale = 1.0 / std::max(plan.colour_range[1] - low, 1e-300);
  if (by == ColourBy::kRgb) std::copy(chunk.rgba.begin(), chunk.rgba.end(), rgba.begin());
  if (by == ColourBy::kClass)
    for (std::size_t i = 0; i < chunk.echo.size(); ++i) rgba[i] = class_colour(chunk.echo[i].kind);
  if (by == ColourBy::kHeight)
    for (std::size_t i = 0; i < rgba.size(); ++i) rgba[i] = height_colour((z[i] - low) * scale);
  if (by == ColourBy::kIntensity)
    for (std::size_t i = 0; i < chunk.intensity.size(); ++i) {
      const double t = std::clamp((chunk.intensity[i] - low) * scale, 0.0, 1.0);
      const auto grey = static_cast<std::uint32_t>(t * 255.0);
      rgba[i] = pack_rgb(grey, grey, grey);
    }
}

}  // namespace tessera
