#include "stream/page/plan_drawing.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "stream/page/html.h"

namespace tessera {
namespace {

constexpr double kUnits = 20.0;                        ///< of the drawing in a millimetre
constexpr double kWidthMm = 150.0, kHeightMm = 110.0;  ///< of the field, which fits A4 with margins
constexpr std::int64_t kLeft = 360, kTop = 60, kRight = 80, kBottom = 180;  ///< units around it
constexpr double kMinFieldMm = 6.0;
/// Lines of the grid are at least so far apart; those of heights may be nearer, so that there are some.
constexpr double kGridMm = 12.0, kNearGridMm = 4.0, kGridLines = 3.0;
constexpr std::int64_t kFarthest = 1 << 20;

/// 1, 2 or 5 times a power of ten, at least x > 0.
double round_step(double x) {
  const double power = std::pow(10.0, std::floor(std::log10(x)));
  for (const double step : {1.0, 2.0, 5.0})
    if (x <= step * power * (1.0 + 1e-12)) return step * power;
  return 10.0 * power;
}

bool same_spot(const std::array<std::int32_t, 2>& a, const std::array<std::int32_t, 2>& b, int bits) {
  return a[0] >> bits == b[0] >> bits && a[1] >> bits == b[1] >> bits;
}

const char* class_of(DrawnLine look) {
  switch (look) {
    case DrawnLine::kArea:
      return "area";
    case DrawnLine::kAxis:
      return "axis";
    case DrawnLine::kMark:
      return "mark";
    default:
      return "outline";
  }
}

}  // namespace

PlanDrawing::PlanDrawing(const Double2& min, const Double2& max, std::string right, std::string up,
                         std::size_t max_points)
    : min_(min), max_(max), right_(std::move(right)), up_(std::move(up)), max_points_(max_points) {
  const double need = std::max((max[0] - min[0]) / kWidthMm, (max[1] - min[1]) / kHeightMm);
  // Millimetres to metres: 1 : N with a round N.
  scale_ = (need > 0.0 ? round_step(need * 1000.0) / 1000.0 : 1.0) / kUnits;
  for (std::size_t a = 0; a < 2; ++a) {
    const double lacks = kMinFieldMm * kUnits * scale_ - (max_[a] - min_[a]);
    if (lacks > 0.0) min_[a] -= 0.5 * lacks, max_[a] += 0.5 * lacks;
  }
}

std::int64_t PlanDrawing::across(double x) const {
  return kLeft + std::llround((x - min_[0]) / scale_);
}

std::int64_t PlanDrawing::down(double y) const {
  return kTop + std::llround((max_[1] - y) / scale_);
}

void PlanDrawing::add(std::span<const Double2> points, bool closed, DrawnLine look) {
  lines_.push_back({{}, closed, look});
  const auto unit = [](std::int64_t at) {
    return static_cast<std::int32_t>(std::clamp<std::int64_t>(at, 0, kFarthest));
  };
  for (const Double2& p : points) {
    std::vector<std::array<std::int32_t, 2>>& kept = lines_.back().points;
    const std::array<std::int32_t, 2> at = {unit(across(p[0])), unit(down(p[1]))};
    if (!kept.empty() && same_spot(kept.back(), at, spot_bits_)) continue;
    kept.push_back(at);
    if (++points_ > max_points_) coarsen();
  }
}

void PlanDrawing::coarsen() {
  while (points_ > max_points_ / 2) {
    ++spot_bits_;
    points_ = 0;
    std::vector<Line> kept;
    for (Line& line : lines_) {
      const auto same = [&](const auto& a, const auto& b) { return same_spot(a, b, spot_bits_); };
      line.points.erase(std::unique(line.points.begin(), line.points.end(), same), line.points.end());
      const bool last = &line == &lines_.back();  // more of it may come
      if (line.points.size() < 2 && !last) continue;
      points_ += line.points.size();
      kept.push_back(std::move(line));
    }
    lines_ = std::move(kept);
  }
}

void PlanDrawing::label(const Double2& at, const std::string& text) {
  labels_.push_back({at, text});
}

std::string PlanDrawing::scale_text() const {
  const double n = scale_ * kUnits * 1000.0;
  return n >= 1.0 ? fmt::format("1 : {:.10g} on paper where coordinates are metres", n)
                  : fmt::format("{:.10g} : 1 on paper where coordinates are metres", 1.0 / n);
}

std::string PlanDrawing::grid() const {
  const double tall_mm = (max_[1] - min_[1]) / (scale_ * kUnits);
  const double step = round_step(kGridMm * kUnits * scale_),
               step_up = round_step(std::clamp(tall_mm / kGridLines, kNearGridMm, kGridMm) * kUnits * scale_);
  const std::int64_t right = across(max_[0]), bottom = down(min_[1]);
  std::string text;
  const auto number = [](double value) { return fmt::format("{:.10g}", value == 0.0 ? 0.0 : value); };
  for (double i = std::ceil(min_[0] / step); i * step <= max_[0]; ++i)
    text +=
        fmt::format("<path d=\"M{0},{1}V{2}\"/><text x=\"{0}\" y=\"{3}\" text-anchor=\"middle\">{4}</text>\n",
                    across(i * step), kTop, bottom, bottom + 68, number(i * step));
  for (double i = std::ceil(min_[1] / step_up); i * step_up <= max_[1]; ++i)
    text +=
        fmt::format("<path d=\"M{0},{1}H{2}\"/><text x=\"{3}\" y=\"{4}\" text-anchor=\"end\">{5}</text>\n",
                    kLeft, down(i * step_up), right, kLeft - 20, down(i * step_up) + 18, number(i * step_up));
  text += fmt::format("<text class=\"name\" x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>\n", right,
                      bottom + 148, html::escape(right_));
  return text + fmt::format(
                    "<text class=\"name\" x=\"60\" y=\"{0}\" text-anchor=\"middle\" transform=\"rotate(-90 "
                    "60 {0})\">{1}</text>\n",
                    (kTop + bottom) / 2, html::escape(up_));
}

std::string PlanDrawing::svg() const {
  const std::int64_t width = across(max_[0]) + kRight, height = down(min_[1]) + kBottom;
  std::string text = fmt::format(
      "<svg class=\"plan\" style=\"width:{:.2f}mm\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\n"
      "<g class=\"grid\">\n{}</g>\n",
      static_cast<double>(width) / kUnits, width, height, html::escape(right_ + ", " + up_), grid());
  for (const Line& line : lines_) {
    text += fmt::format("<path class=\"{}\" d=\"", class_of(line.look));
    std::array<std::int64_t, 2> last{};
    for (std::size_t i = 0; i < line.points.size(); ++i) {
      const std::array<std::int64_t, 2> at = {line.points[i][0], line.points[i][1]};
      text += fmt::format("{}{},{}", i == 0 ? "M" : i == 1 ? "l" : " ", at[0] - last[0], at[1] - last[1]);
      last = at;
    }
    text += line.points.size() == 1 ? "h0" : line.closed ? "z" : "";
    text += "\"/>\n";
  }
  for (const Label& label : labels_)
    text += fmt::format("<text class=\"label\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n",
                        across(label.at[0]), down(label.at[1]) + 20, html::escape(label.text));
  return text + "</svg>\n";
}

}  // namespace tessera
