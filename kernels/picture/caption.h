/// \file caption.h
/// Text and simple marks on pictures, in a stroke font of our own: no font file, same pixels everywhere.
#pragma once
#include <string>

#include "kernels/picture/picture.h"

namespace tessera {

/// Width in pixels of `text` (ASCII) with capitals `cap_height` pixels tall.
double caption_width(const std::string& text, double cap_height);

/// Draws dark text with a light halo; (x, y) is the left end of the baseline. Characters that the font lacks
/// become a box. What lies outside the image is cut.
void draw_caption(Image& image, double x, double y, double cap_height, const std::string& text);

/// A horizontal bar with end ticks, from (x, y) over `length` pixels.
void draw_scale_bar(Image& image, double x, double y, double length, double tick);

/// A circle around (x, y).
void draw_ring(Image& image, double x, double y, double radius);

/// Copies `from` into `to` with its top left corner at (x, y). \pre it fits
void paste(Image& to, const Image& from, int x, int y);

/// 1,234,567
[[nodiscard]] std::string with_commas(std::uint64_t value);

}  // namespace tessera
