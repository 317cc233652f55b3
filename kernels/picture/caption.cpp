#include "kernels/picture/caption.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>
#include <vector>

namespace tessera {
namespace {

// Each glyph: polylines of digit pairs, x from 0 and y from 0 (descender) over 2 (baseline) and 6 (small
// letters) to 8 (capitals). A single pair is a dot. Polylines are separated by blanks.
struct Glyph {
  char character;
  const char* strokes;
};
constexpr Glyph kGlyphs[] = {
    {'0', "120307183847433212"},
    {'1', "071812 0222"},
    {'2', "07183847460242"},
    {'3', "071838474635 25354443321203"},
    {'4', "380444 3832"},
    {'5', "480805354443321203"},
    {'6', "4738180703123243443505"},
    {'7', "084812"},
    {'8', "15060718384746351504031232434435"},
    {'9', "0312324347381807061545"},
    {'A', "022842 1535"},
    {'B', "02083847463505 3544433202"},
    {'C', "4738180703123243"},
    {'D', "02082846442202"},
    {'E', "48080242 0535"},
    {'F', "480802 0535"},
    {'G', "47381807031232434525"},
    {'H', "0802 4842 0545"},
    {'I', "0222 1218 0828"},
    {'J', "4843321203"},
    {'K', "0802 4804 1542"},
    {'L', "080242"},
    {'M', "0208254842"},
    {'N', "02084248"},
    {'O', "120307183847433212"},
    {'P', "02083847463505"},
    {'Q', "120307183847433212 2442"},
    {'R', "02083847463505 2542"},
    {'S', "473818070615354443321203"},
    {'T', "0848 2822"},
    {'U', "080312324348"},
    {'V', "082248"},
    {'W', "0812253248"},
    {'X', "0248 0842"},
    {'Y', "082548 2522"},
    {'Z', "08480242"},
    {'a', "0516263532 341403122233"},
    {'b', "0802 0516263533221203"},
    {'c', "3526160503122233"},
    {'d', "3832 3526160503122233"},
    {'e', "04343526160503122233"},
    {'f', "281712 0626"},
    {'g', "3631201001 3526160503122233"},
    {'h', "0802 0516263532"},
    {'i', "0602 08"},
    {'j', "161100 18"},
    {'k', "0802 3603 1432"},
    {'l', "0802"},
    {'m', "0602 05162522 25364542"},
    {'n', "0602 0516263532"},
    {'o', "051626353322120305"},
    {'p', "0600 0516263533221203"},
    {'q', "3630 3526160503122233"},
    {'r', "0602 051626"},
    {'s', "35261605142433221203"},
    {'t', "181322 0626"},
    {'u', "0603122233 3632"},
    {'v', "061226"},
    {'w', "0612243246"},
    {'x', "0632 0236"},
    {'y', "0613 2600"},
    {'z', "06360232"},
    {'.', "02"},
    {',', "1201"},
    {':', "03 06"},
    {'-', "0434"},
    {'+', "0444 2622"},
    {'_', "0141"},
    {'/', "0138"},
    {'(', "18070312"},
    {')', "08171302"},
    {'%', "0248 07 43"},
    {'=', "0535 0333"},
    {'*', "2723 0644 0446"},
    {'~', "0415243544"},
    {'\'', "0806"},
};
constexpr const char* kBox = "0208282202";
constexpr double kBaseline = 2.0;
constexpr double kCapUnits = 6.0;
constexpr double kGap = 1.7;    // between glyphs, units
constexpr double kBlank = 2.0;  // width of a blank, units

const char* strokes_of(char c) {
  for (const Glyph& glyph : kGlyphs) {
    if (glyph.character == c) return glyph.strokes;
  }
  return kBox;
}

double glyph_width(char c) {
  if (c == ' ') return kBlank;
  double width = 0.0;
  bool is_x = true;
  for (const char* s = strokes_of(c); *s != '\0'; ++s) {
    if (*s == ' ') continue;
    if (is_x) width = std::max(width, static_cast<double>(*s - '0'));
    is_x = !is_x;
  }
  return width;
}

struct Segment {
  double x0, y0, x1, y1;
};

double distance_to(const Segment& s, double x, double y) {
  const double dx = s.x1 - s.x0, dy = s.y1 - s.y0;
  const double length2 = dx * dx + dy * dy;
  double t = length2 > 0.0 ? ((x - s.x0) * dx + (y - s.y0) * dy) / length2 : 0.0;
  t = std::clamp(t, 0.0, 1.0);
  const double ex = x - s.x0 - t * dx, ey = y - s.y0 - t * dy;
  return std::sqrt(ex * ex + ey * ey);
}

/// Draws all segments as one shape: coverage by distance, first the halo, then the ink.
void draw_strokes(Image& image, const std::vector<Segment>& segments, double half_width) {
  if (segments.empty()) return;
  const double halo = half_width + 1.6;
  double left = 1e30, right = -1e30, top = 1e30, bottom = -1e30;
  for (const Segment& s : segments) {
    left = std::min({left, s.x0, s.x1}), right = std::max({right, s.x0, s.x1});
    top = std::min({top, s.y0, s.y1}), bottom = std::max({bottom, s.y0, s.y1});
  }
  const int x0 = std::max(0, static_cast<int>(std::floor(left - halo - 1)));
  const int x1 = std::min(image.width, static_cast<int>(std::ceil(right + halo + 1)));
  const int y0 = std::max(0, static_cast<int>(std::floor(top - halo - 1)));
  const int y1 = std::min(image.height, static_cast<int>(std::ceil(bottom + halo + 1)));
  if (x0 >= x1 || y0 >= y1) return;
  const auto columns = static_cast<std::size_t>(x1 - x0);
  std::vector<float> nearest(columns * static_cast<std::size_t>(y1 - y0), 1e30f);
  for (const Segment& s : segments) {
    const int sx0 = std::max(x0, static_cast<int>(std::min(s.x0, s.x1) - halo - 1));
    const int sx1 = std::min(x1, static_cast<int>(std::max(s.x0, s.x1) + halo + 2));
    const int sy0 = std::max(y0, static_cast<int>(std::min(s.y0, s.y1) - halo - 1));
    const int sy1 = std::min(y1, static_cast<int>(std::max(s.y0, s.y1) + halo + 2));
    for (int y = sy0; y < sy1; ++y) {
      for (int x = sx0; x < sx1; ++x) {
        float& d = nearest[static_cast<std::size_t>(y - y0) * columns + static_cast<std::size_t>(x - x0)];
        d = std::min(d, static_cast<float>(distance_to(s, x + 0.5, y + 0.5)));
      }
    }
  }
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      const double d = static_cast<double>(
          nearest[static_cast<std::size_t>(y - y0) * columns + static_cast<std::size_t>(x - x0)]);
      const double light = 0.75 * std::clamp(halo + 0.5 - d, 0.0, 1.0);
      const double ink = 0.9 * std::clamp(half_width + 0.5 - d, 0.0, 1.0);
      if (light <= 0.0) continue;
      std::uint8_t* pixel = image.pixel(x, y);
      for (int c = 0; c < 3; ++c) {
        const double behind = pixel[c] * (1.0 - light) + 240.0 * light;
        pixel[c] = static_cast<std::uint8_t>(behind * (1.0 - ink) + 38.0 * ink + 0.5);
      }
    }
  }
}

double stroke_half_width(double cap_height) {
  return std::max(0.55, cap_height * 0.065);
}

}  // namespace

double caption_width(const std::string& text, double cap_height) {
  double units = 0.0;
  for (const char c : text) units += glyph_width(c) + kGap;
  return std::max(0.0, units - kGap) * cap_height / kCapUnits;
}

void draw_caption(Image& image, double x, double y, double cap_height, const std::string& text) {
  const double unit = cap_height / kCapUnits;
  std::vector<Segment> segments;
  for (const char c : text) {
    if (c != ' ') {
      std::string_view rest = strokes_of(c);
      while (!rest.empty()) {
        const std::size_t end = std::min(rest.find(' '), rest.size());
        const std::string_view line = rest.substr(0, end);
        rest.remove_prefix(std::min(end + 1, rest.size()));
        const auto px = [&](std::size_t i) { return x + unit * (line[2 * i] - '0'); };
        const auto py = [&](std::size_t i) { return y - unit * (line[2 * i + 1] - '0' - kBaseline); };
        const std::size_t count = line.size() / 2;
        if (count == 1) segments.push_back({px(0), py(0), px(0), py(0) - 0.5 * unit});  // a dot, to be seen
        for (std::size_t i = 0; i + 1 < count; ++i) segments.push_back({px(i), py(i), px(i + 1), py(i + 1)});
      }
    }
    x += unit * (glyph_width(c) + kGap);
  }
  draw_strokes(image, segments, stroke_half_width(cap_height));
}

void draw_scale_bar(Image& image, double x, double y, double length, double tick) {
  draw_strokes(
      image,
      {{x, y, x + length, y}, {x, y - tick, x, y + tick}, {x + length, y - tick, x + length, y + tick}}, 1.0);
}

void draw_ring(Image& image, double x, double y, double radius) {
  // Corners of a circle whose chords no pixel tells from arcs; rotated by products, without libm.
  constexpr int kChords = 32;
  constexpr double kCos = 0.98078528040323043, kSin = 0.19509032201612828;  // of a 32nd of the circle
  std::vector<Segment> segments;
  double right = radius, down = 0.0;
  for (int i = 0; i < kChords; ++i) {
    const double next = right * kCos - down * kSin, lower = right * kSin + down * kCos;
    segments.push_back({x + right, y + down, x + next, y + lower});
    right = next, down = lower;
  }
  draw_strokes(image, segments, std::max(1.0, 0.1 * radius));
}

void paste(Image& to, const Image& from, int x, int y) {
  for (int row = 0; row < from.height; ++row) {
    std::memcpy(to.pixel(x, y + row), from.pixel(0, row), 3 * static_cast<std::size_t>(from.width));
  }
}

std::string with_commas(std::uint64_t value) {
  const std::string digits = std::to_string(value);
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) text.push_back(',');
    text.push_back(digits[i]);
  }
  return text;
}

}  // namespace tessera
