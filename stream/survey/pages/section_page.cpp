#include "stream/survey/pages/section_page.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kernels/picture/caption.h"
#include "stream/files/path_text.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxPoints = 20000;    // of a drawing
constexpr std::size_t kPagePoints = 600000;  // of all of them: many have fewer each
constexpr std::size_t kMapLabels = 25;
/// A point of a drawing, and its text in the page, which is held twice as it is put together.
constexpr std::uint64_t kPointBytes = sizeof(std::int32_t) * 2 * 2 + 2 * 12;

/// Enclosed by a closed line; counter-clockwise ones are positive.
double enclosed_area(std::span<const Double2> points) {
  double twice = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Double2 &o = points.front(), &a = points[i], &b = points[(i + 1) % points.size()];
    twice += (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
  }
  return 0.5 * twice;
}

double distance_between(const Double2& a, const Double2& b) {
  return std::sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]));
}

double length_of(std::span<const Double2> points, bool closed) {
  double length = 0.0;
  for (std::size_t i = 0; i + (closed ? 0 : 1) < points.size(); ++i)
    length += distance_between(points[i], points[(i + 1) % points.size()]);
  return length;
}

}  // namespace

SectionPage::SectionPage(std::filesystem::path mesh, const SectionOptions& options)
    : mesh_(std::move(mesh)), options_(options) {}

std::uint64_t SectionPage::bytes() const {
  return kPointBytes * kPagePoints;
}

void SectionPage::begin(std::span<const SectionExtent> sections, std::span<const AxisPiece> axis) {
  sections_ = sections.size();
  axis_.assign(axis.begin(), axis.end());
  if (options_.kind == SectionKind::kAlong) {  // one drawing of all pieces
    SectionExtent all = sections.front();
    for (const SectionExtent& s : sections)
      for (std::size_t a = 0; a < 2; ++a)
        all.min[a] = std::min(all.min[a], s.min[a]), all.max[a] = std::max(all.max[a], s.max[a]);
    shown_.push_back(
        {all, PlanDrawing(all.min, all.max, "station", "height", kMaxPoints), 0, 0, 0, 0, {}, {}});
    return;
  }
  stride_ = static_cast<std::size_t>(
      round_stride(static_cast<std::int64_t>(sections.size()), static_cast<std::int64_t>(kMaxSections)));
  const std::size_t most = std::min(kMaxPoints, kPagePoints / (sections.size() / stride_ + 1));
  const bool flat = options_.kind == SectionKind::kHorizontal;
  for (std::size_t i = 0; i < sections.size(); i += stride_) {
    Double2 low = sections[i].min, high = sections[i].max;
    if (!flat) low[0] = std::min(low[0], 0.0), high[0] = std::max(high[0], 0.0);  // with the axis
    PlanDrawing drawing(low, high, flat ? "x" : "offset", flat ? "y" : "height", most);
    if (!flat) drawing.add(std::vector<Double2>{{0.0, low[1]}, {0.0, high[1]}}, false, DrawnLine::kAxis);
    shown_.push_back({sections[i], std::move(drawing), 0, 0, 0, 0, {}, {}});
  }
}

SectionPage::Shown* SectionPage::shown_of(std::int64_t section) {
  if (options_.kind == SectionKind::kAlong) return &shown_.front();
  const auto at = std::partition_point(shown_.begin(), shown_.end(),
                                       [&](const Shown& s) { return s.extent.section < section; });
  return at != shown_.end() && at->extent.section == section ? &*at : nullptr;
}

void SectionPage::add(const SectionLine& line, const SectionFrame& frame) {
  Shown* const shown = shown_of(line.section);
  if (shown == nullptr) return;
  shown->drawing.add(line.points, line.closed, DrawnLine::kOutline);
  ++shown->lines, shown->closed += line.closed ? 1 : 0;
  shown->length += length_of(line.points, line.closed);
  if (line.closed) shown->area += enclosed_area(line.points);
  const Double3 from = frame.place({shown->extent.min[0], 0.0, line.level}),
                to = frame.place({shown->extent.max[0], 0.0, line.level});
  shown->from = {from[0], from[1]}, shown->to = {to[0], to[1]};
}

std::string SectionPage::name_of(const Shown& shown) const {
  if (options_.kind == SectionKind::kAlong) return "Along the axis";
  return fmt::format("Section {}", shown.extent.section);
}

PageDrawing SectionPage::drawing_of(Shown& shown) const {
  PageDrawing out{name_of(shown), {}, std::move(shown.drawing)};
  const SectionExtent& e = shown.extent;
  if (options_.kind == SectionKind::kAcross)
    out.facts.emplace_back("chainage", fmt::format("{:.10g}", e.value));
  if (options_.kind == SectionKind::kAlong)
    out.facts.emplace_back("stations", fmt::format("{:.7g} to {:.7g}", e.min[0], e.max[0]));
  if (options_.kind == SectionKind::kHorizontal)
    out.facts.emplace_back("height", fmt::format("{:.10g}", e.value));
  else
    out.facts.emplace_back("heights", fmt::format("{:.7g} to {:.7g}", e.min[1], e.max[1]));
  out.facts.emplace_back("lines", with_commas(shown.lines));
  out.facts.emplace_back("length", number_text(shown.length));
  return out;
}

PageTable SectionPage::table() const {
  const bool flat = options_.kind == SectionKind::kHorizontal;
  PageTable out;
  out.columns = {"section",
                 flat ? "height" : "chainage",
                 "lines",
                 "closed",
                 "length",
                 flat ? "area" : "lowest",
                 flat ? "" : "highest"};
  if (flat) out.columns.pop_back();
  for (const Shown& s : shown_) {
    std::vector<std::string> row = {name_of(s), fmt::format("{:.10g}", s.extent.value), with_commas(s.lines),
                                    with_commas(s.closed), number_text(s.length)};
    if (flat)
      row.push_back(s.closed > 0 ? number_text(s.area) : "");
    else
      row.push_back(fmt::format("{:.7g}", s.extent.min[1])),
          row.push_back(fmt::format("{:.7g}", s.extent.max[1]));
    out.rows.push_back(row);
  }
  out.note = flat ? "Area is what closed lines enclose, less what those that run clockwise do: of a solid "
                    "that of its "
                    "material."
                  : "Length is that of all lines in the section.";
  return out;
}

/// The axis and where its sections lie, seen from above.
PlanDrawing SectionPage::map() const {
  Double2 low = axis_.front().start, high = low;
  const auto grow = [&](const Double2& p) {
    for (std::size_t a = 0; a < 2; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
  };
  for (const AxisPiece& piece : axis_) grow(piece.start), grow(piece.end);
  const bool across = options_.kind == SectionKind::kAcross;
  if (across)
    for (const Shown& s : shown_) grow(s.from), grow(s.to);
  PlanDrawing map(low, high, "x", "y");
  if (across)
    for (const Shown& s : shown_) map.add(std::vector<Double2>{s.from, s.to}, false, DrawnLine::kMark);
  std::vector<Double2> corners = {axis_.front().start};
  for (const AxisPiece& piece : axis_) corners.push_back(piece.end);
  map.add(corners, false, DrawnLine::kAxis);
  const std::size_t every = (shown_.size() + kMapLabels - 1) / kMapLabels;
  if (across)
    for (std::size_t i = 0; i < shown_.size(); i += every)
      map.label(shown_[i].to, fmt::format("{:.7g}", shown_[i].extent.value));
  return map;
}

SurveyPage SectionPage::finish(const SectionReport& report) {
  const bool flat = options_.kind == SectionKind::kHorizontal;
  SurveyPage page;
  page.title = flat                                   ? "Horizontal sections"
               : options_.kind == SectionKind::kAlong ? "Section along an axis"
                                                      : "Sections";
  page.subject = json_text(mesh_.filename()), page.command = "section";
  page.headlines = {{"sections", with_commas(report.sections)},
                    {flat ? "lowest height" : "first station", fmt::format("{:.7g}", report.first)},
                    {flat ? "highest height" : "last station", fmt::format("{:.7g}", report.last)},
                    {"lines", with_commas(report.lines)}};
  page.inputs = {{"mesh", json_text(mesh_)}};
  if (!flat) page.inputs.emplace_back("axis", json_text(options_.axis));
  if (options_.spacing > 0.0)
    page.inputs.emplace_back("distance of two sections", number_text(options_.spacing));
  if (options_.width > 0.0) page.inputs.emplace_back("width", number_text(options_.width));
  page.inputs.emplace_back("lines",
                           with_commas(report.lines) + ", " + with_commas(report.closed) + " of them closed");
  page.inputs.emplace_back("points of the lines", with_commas(report.points));
  page.inputs.emplace_back("unit of all lengths", "that of the coordinates");
  page.tables_title = "Figures by section";
  page.tables.push_back(table());
  page.drawings_title = "Drawings";
  if (stride_ > 1) {
    page.drawings_note = fmt::format("This page shows one in {} of the {} sections; files (-o) have all.",
                                     stride_, with_commas(sections_));
    page.notices.push_back(page.drawings_note);
  }
  if (!flat) page.drawings.push_back({"Axis and sections from above", {}, map()});
  for (Shown& s : shown_) page.drawings.push_back(drawing_of(s));
  return page;
}

}  // namespace tessera
