#include "stream/survey/section_files.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace tessera {

SectionCsv::SectionCsv(const std::filesystem::path& output, SectionKind kind) : file_(output), kind_(kind) {
  file_.append("section,station,line,closed,offset,height,x,y,z\n");
}

void SectionCsv::add(const SectionLine& line, const SectionFrame& frame) {
  line_ = line.section == section_ ? line_ + 1 : 0;
  section_ = line.section;
  const std::size_t count = line.points.size();
  for (std::size_t k = 0; k < count + (line.closed ? 1 : 0); ++k) {
    const Double2& p = line.points[k % count];
    const Double3 at = frame.place({p[0], p[1], line.level});
    const double station = kind_ == SectionKind::kAlong ? p[0] : line.value;
    const std::string offset = kind_ == SectionKind::kAcross  ? fmt::format("{}", p[0])
                               : kind_ == SectionKind::kAlong ? "0"
                                                              : "";
    file_.append(fmt::format("{},{},{},{},{},{},{},{},{}\n", line.section, station, line_,
                             line.closed ? 1 : 0, offset, at[2], at[0], at[1], at[2]));
  }
}

namespace {

/// Height of the space for the text above a section, and width of the station of a piece, in heights of the text.
constexpr std::int64_t kTextRoom = 3, kTextWidth = 10;

std::string section_text(SectionKind kind, const SectionExtent& s) {
  if (kind == SectionKind::kHorizontal) return fmt::format("height {:.10g}", s.value);
  const std::string station = fmt::format("station {:.10g}", s.value);
  if (kind == SectionKind::kAlong) return station;
  return station + fmt::format(", heights {:.7g} to {:.7g}", s.min[1], s.max[1]);
}

}  // namespace

SectionSvg::SectionSvg(const std::filesystem::path& output, SectionKind kind,
                       std::vector<SectionExtent> sections)
    : file_(output), kind_(kind), sections_(std::move(sections)) {
  min_ = sections_.front().min, max_ = sections_.front().max;
  double tallest = 0.0;
  for (const SectionExtent& s : sections_) {
    for (std::size_t a = 0; a < 2; ++a)
      min_[a] = std::min(min_[a], s.min[a]), max_[a] = std::max(max_[a], s.max[a]);
    tallest = std::max(tallest, s.max[1] - s.min[1]);
  }
  if (kind_ == SectionKind::kAlong) {
    tallest = max_[1] - min_[1];
    for (SectionExtent& s : sections_) {
      s.min[1] = min_[1], s.max[1] = max_[1];
      s.value = std::max(s.value, min_[0]);  // the drawing begins where the mesh does
    }
  }
  const double span = std::max(max_[0] - min_[0], tallest);
  if (span > 0.0) unit_ = std::pow(10.0, std::floor(std::log10(span)) - 5.0);
  font_ = std::max<std::int64_t>(1, std::llround(span / unit_ / 60.0));
  const std::int64_t width = right(max_[0]) + 2 * font_;
  std::int64_t height = 2 * font_;
  for (const SectionExtent& s : sections_) {
    const std::int64_t row = kTextRoom * font_ + std::llround((s.max[1] - s.min[1]) / unit_);
    height = kind_ == SectionKind::kAlong ? 2 * font_ + row : height + row;
  }
  height += 2 * font_;
  file_.append(fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1200\" height=\"{:.6g}\" viewBox=\"0 0 {} {}\">\n"
      "<desc>1 unit = {:g} units of the mesh, on both axes</desc>\n"
      "<g fill=\"none\" stroke=\"#000\" stroke-width=\"{}\" stroke-linejoin=\"round\" "
      "font-family=\"sans-serif\" font-size=\"{}\">\n",
      1200.0 * static_cast<double>(height) / static_cast<double>(width), width, height, unit_,
      std::max<std::int64_t>(1, font_ / 16), font_));
  top_ = 2 * font_;
}

std::int64_t SectionSvg::right(double u) const {
  return 2 * font_ + std::llround((u - min_[0]) / unit_);
}

std::int64_t SectionSvg::down(double v) const {
  return kTextRoom * font_ + std::llround((sections_[next_ - 1].max[1] - v) / unit_);
}

void SectionSvg::begin_section(std::int64_t section) {
  if (next_ > 0) file_.append("</g>\n");
  while (next_ < sections_.size() && sections_[next_].section < section) ++next_;
  if (next_ > 0 && kind_ != SectionKind::kAlong) top_ += down(sections_[next_ - 1].min[1]);
  const SectionExtent& s = sections_[next_++];
  file_.append(fmt::format("<g id=\"section-{}\">\n", section));
  const std::int64_t row = top_ + kTextRoom * font_, bottom = top_ + down(s.min[1]);
  const auto put_axis = [&](std::int64_t x) {
    file_.append(fmt::format("<path stroke=\"#aaa\" d=\"M{},{}V{}\"/>\n", x, row - font_ / 2, bottom));
  };
  std::int64_t x = 2 * font_;
  if (kind_ == SectionKind::kAlong) {
    x = right(s.value);
    put_axis(x);
  } else if (kind_ == SectionKind::kAcross && min_[0] <= 0.0 && max_[0] >= 0.0) {
    put_axis(right(0.0));
  }
  // Text that would end beyond the drawing ends at its place.
  const char* anchor = x > 2 * font_ && x > right(max_[0]) - kTextWidth * font_ ? " text-anchor=\"end\"" : "";
  file_.append(fmt::format("<text x=\"{}\" y=\"{}\" stroke=\"none\" fill=\"#000\"{}>{}</text>\n", x,
                           row - font_, anchor, section_text(kind_, s)));
}

void SectionSvg::add(const SectionLine& line) {
  if (next_ == 0 || sections_[next_ - 1].section != line.section) begin_section(line.section);
  std::int64_t x = right(line.points.front()[0]), y = top_ + down(line.points.front()[1]);
  file_.append(fmt::format("<path d=\"M{},{}l", x, y));
  bool drawn = false;
  for (const Double2& p : line.points) {
    const std::int64_t to_x = right(p[0]), to_y = top_ + down(p[1]);
    if (to_x == x && to_y == y) continue;
    file_.append(fmt::format("{}{},{}", drawn ? " " : "", to_x - x, to_y - y));
    x = to_x, y = to_y, drawn = true;
  }
  file_.append(fmt::format("{}{}\"/>\n", drawn ? "" : "0,0", line.closed ? "z" : ""));
}

void SectionSvg::finish() {
  file_.append("</g>\n</g>\n</svg>\n");
  file_.finish();
}

}  // namespace tessera
