#include "stream/stages/coverage/missing_picture.h"

#include <algorithm>
#include <array>

namespace tessera {
namespace {

constexpr std::uint32_t kMaxPictureEdge = 640;  ///< pixels
constexpr std::uint32_t kMinPictureEdge = 160;
constexpr std::array<double, 3> kHeld = {196.0, 198.0, 202.0}, kMissed = {255.0, 0.0, 255.0};
constexpr double kLeastShown = 0.5;  ///< of the colour, where anything is missing at all

}  // namespace

std::filesystem::path missing_picture_path(const std::filesystem::path& output) {
  std::filesystem::path path = output;
  return path += ".missing.png";
}

MissingPicture::MissingPicture(std::uint32_t low_u, std::uint32_t low_v, std::uint32_t high_u,
                               std::uint32_t high_v)
    : low_u_(low_u), low_v_(low_v) {
  const std::uint32_t across = high_u - low_u + 1, up = high_v - low_v + 1;
  per_pixel_ = (std::max(across, up) + kMaxPictureEdge - 1) / kMaxPictureEdge;
  width_ = static_cast<int>((across + per_pixel_ - 1) / per_pixel_);
  height_ = static_cast<int>((up + per_pixel_ - 1) / per_pixel_);
  pixels_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
}

void MissingPicture::add(std::uint32_t u, std::uint32_t v, bool missing) {
  const std::uint32_t x = (u - low_u_) / per_pixel_, y = (v - low_v_) / per_pixel_;
  if (u < low_u_ || v < low_v_ || x >= static_cast<std::uint32_t>(width_) ||
      y >= static_cast<std::uint32_t>(height_))
    return;
  Pixel& pixel = pixels_[std::size_t{y} * static_cast<std::size_t>(width_) + x];
  ++pixel.seen;
  pixel.missing += missing;
}

Image MissingPicture::image() const {
  // Small scans get large pixels.
  const int scale = std::max(1, static_cast<int>(kMinPictureEdge) / std::max(width_, height_));
  Image image;
  image.width = width_ * scale;
  image.height = height_ * scale;
  image.rgb.assign(3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height), 255);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      // The second axis of the ground shows up.
      const Pixel& p =
          pixels_[static_cast<std::size_t>(height_ - 1 - y / scale) * static_cast<std::size_t>(width_) +
                  static_cast<std::size_t>(x / scale)];
      if (p.seen == 0) continue;
      const double share =
          p.missing == 0 ? 0.0 : kLeastShown + (1.0 - kLeastShown) * p.missing / static_cast<double>(p.seen);
      for (std::size_t c = 0; c < 3; ++c)
        image.pixel(x, y)[c] = static_cast<std::uint8_t>(kHeld[c] + (kMissed[c] - kHeld[c]) * share + 0.5);
    }
  return image;
}

}  // namespace tessera
