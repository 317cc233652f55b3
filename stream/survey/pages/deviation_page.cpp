#include "stream/survey/pages/deviation_page.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kernels/picture/caption.h"
#include "octree/error.h"
#include "stream/files/path_text.h"
#include "stream/render/render_scene.h"
#include "stream/render/value_picture.h"
#include "stream/runtime/numbers.h"
#include "stream/survey/pages/area_sketch.h"

namespace tessera {
namespace {

constexpr std::int64_t kMaxBars = 80, kMaxTicks = 7;  // of the histogram
constexpr std::size_t kNamedInputs = 20;              // the others are counted
constexpr std::size_t kNamedAreas = 500;

std::string signed_text(double value) {
  return (value > 0.0 ? "+" : "") + number_text(value);
}

/// Nothing is 100 % of which a part is missing.
std::string share_text(std::uint64_t part, std::uint64_t all) {
  if (all == 0) return "";
  if (part == all) return "100 %";
  const double percent = 100.0 * static_cast<double>(part) / static_cast<double>(all);
  return fmt::format("{:.7g} %", std::floor(1e4 * percent) / 1e4);
}

double scale_end(const ScanDeviationReport& report, const DeviationPageFacts& facts) {
  if (facts.colour_scale > 0.0) return facts.colour_scale;
  if (facts.tolerance > 0.0) return facts.tolerance;
  const DeviationSummary& all = report.table.rows.front();
  const double tails = std::max(std::abs(all.percentiles.front()), std::abs(all.percentiles.back()));
  return tails > 0.0 ? tails : std::max({std::abs(all.min), std::abs(all.max), 1e-300});
}

PageRows input_rows(const ScanDeviationReport& report, const DeviationPageFacts& facts) {
  PageRows rows;
  for (std::size_t i = 0; i < std::min(facts.inputs.size(), kNamedInputs); ++i)
    rows.emplace_back(report.vertices ? "mesh, its vertices" : "scan", json_text(facts.inputs[i]));
  if (facts.inputs.size() > kNamedInputs)
    rows.emplace_back("and more scans", with_commas(facts.inputs.size() - kNamedInputs));
  rows.emplace_back("reference", json_text(facts.reference));
  rows.emplace_back("faces of the reference", with_commas(report.reference_faces));
  rows.emplace_back("points", with_commas(report.points));
  rows.emplace_back("left out: not finite, withheld or missing", with_commas(report.left_out));
  rows.emplace_back("coordinate system", report.crs.empty() ? "none is named" : report.crs);
  rows.emplace_back("unit of all lengths", "that of the coordinates");
  if (!facts.areas.empty()) rows.emplace_back("polygons", json_text(facts.areas));
  return rows;
}

PageRows figure_rows(const ScanDeviationReport& report, const DeviationPageFacts& facts) {
  const DeviationSummary& all = report.table.rows.front();
  PageRows rows = {{"points measured", with_commas(all.count)},
                   {"farther off than " + number_text(report.max_distance) + ", without a deviation",
                    with_commas(all.far)},
                   {"measured beside a border of the reference", with_commas(all.border)},
                   {"mean", signed_text(all.mean)},
                   {"root mean square", number_text(all.rms)},
                   {"standard deviation", number_text(all.deviation)}};
  for (std::size_t k = 0; k < kDeviationPercents.size(); ++k)
    rows.emplace_back(
        kDeviationPercents[k] == 50 ? "median" : fmt::format("percentile {} %", kDeviationPercents[k]),
        signed_text(all.percentiles[k]));
  rows.emplace_back("lowest", signed_text(all.min) + " at " + place_text(all.min_at));
  rows.emplace_back("highest", signed_text(all.max) + " at " + place_text(all.max_at));
  if (facts.tolerance < 0.0) return rows;
  rows.emplace_back("tolerance, either way", number_text(facts.tolerance));
  rows.emplace_back("within the tolerance",
                    share_text(all.within, all.count) + ", " + with_commas(all.within) + " points");
  rows.emplace_back("beyond it", with_commas(all.count - all.within) + " points");
  return rows;
}

/// Bins joined to about kMaxBars, from whole multiples of their width on, with the tolerance across.
html::Histogram histogram_of(const DeviationTable& table, double tolerance) {
  html::Histogram h;
  h.title = "Points by deviation; the outer bars hold what lies beyond";
  // All inner bins are of one width; the outer ones reach to infinity.
  const std::vector<DeviationBin>& bins = table.histogram;
  const double bin = bins[1].high - bins[1].low;
  const auto inner = static_cast<std::int64_t>(bins.size()) - 2;
  const std::int64_t first = std::llround(bins[1].low / bin), joined = round_stride(inner, kMaxBars);
  const auto bar_of = [&](std::int64_t k) { return k >= 0 ? k / joined : -((joined - 1 - k) / joined); };
  const std::int64_t low = bar_of(first), bars = bar_of(first + inner - 1) - low + 1;
  h.counts.assign(static_cast<std::size_t>(bars) + 2, 0.0);
  for (std::size_t k = 0; k < bins.size(); ++k) {
    const std::int64_t bar = k == 0 ? 0
                             : k + 1 == bins.size()
                                 ? bars + 1
                                 : bar_of(first + static_cast<std::int64_t>(k) - 1) - low + 1;
    h.counts[static_cast<std::size_t>(bar)] += static_cast<double>(bins[k].count);
  }
  const double width = bin * static_cast<double>(joined);
  h.edges.resize(h.counts.size() + 1);
  const std::int64_t stride = round_stride(bars, kMaxTicks);
  for (std::int64_t i = 0; i <= bars; ++i)
    if ((low + i) % stride == 0)
      h.edges[static_cast<std::size_t>(i) + 1] = signed_text(static_cast<double>(low + i) * width);
  if (tolerance >= 0.0)
    for (const double at : {-tolerance, tolerance}) {
      const double bar = at / width - static_cast<double>(low) + 1.0;
      if (bar >= 0.0 && bar <= static_cast<double>(h.counts.size()))
        h.marks.push_back({bar, signed_text(at)});
    }
  return h;
}

PageTable area_table(const DeviationTable& table, double tolerance) {
  PageTable out;
  out.columns = {"polygon", "points", "mean", "rms", "st. dev.", "median", "min", "max"};
  if (tolerance >= 0.0) out.columns.emplace_back("within");
  const std::size_t shown = std::min(table.rows.size(), kNamedAreas + 1);
  for (std::size_t i = 1; i < shown; ++i) {
    const DeviationSummary& r = table.rows[i];
    std::vector<std::string> row = {r.name, with_commas(r.count)};
    if (r.count > 0) {
      for (const double v : {r.mean, r.rms, r.deviation, r.percentiles[3], r.min, r.max})
        row.push_back(number_text(v));
      if (tolerance >= 0.0) row.push_back(share_text(r.within, r.count));
    }
    row.resize(out.columns.size());
    out.rows.push_back(row);
  }
  out.note = "Polygons in the order of the file.";
  if (shown < table.rows.size())
    out.note += fmt::format(" The first {} of {}; --csv has all.", with_commas(shown - 1),
                            with_commas(table.rows.size() - 1));
  return out;
}

void add_pictures(SurveyPage& page, const ScanDeviationReport& report, const DeviationPageFacts& facts) {
  const double end = scale_end(report, facts);
  page.scale = PageScale{-end, end, "Deviation", "unit of the coordinates", {}};
  page.scale->others = {{"#d02ac0", "beyond the scale, either way"}};
  if (report.table.rows.front().far > 0)
    page.scale->others.emplace_back("#606060", "no deviation: too far from the reference");
  try {
    ValuePicture drawn = draw_values(report.map, end, facts.memory_bytes, facts.temp);
    page.pictures.push_back(
        {std::move(drawn.png),
         "The measured points in the colours of their deviations, from four sides: twice from above a "
         "corner, from the "
         "front, from the top",
         fmt::format("Blue behind the reference, red in front of it. {} spots, each the mean of the points "
                     "in a cube of "
                     "{}; rings are the worst places below, in the views that show them.",
                     with_commas(report.map.cells.size()), number_text(report.map.cell))});
    for (const std::string& notice : drawn.notices) page.pictures_note += notice + ". ";
  } catch (const StoppedError&) {
    throw;
  } catch (const std::exception& e) {
    page.pictures_note = fmt::format("Pictures left out: {}", e.what());
  }
}

}  // namespace

bool passes(const DeviationSummary& all, double share) {
  return static_cast<double>(all.within) / static_cast<double>(all.count) >= share;
}

SurveyPage deviation_page(const ScanDeviationReport& report, const DeviationPageFacts& facts) {
  const DeviationSummary& all = report.table.rows.front();
  SurveyPage page;
  page.title = "Deviations", page.command = "deviate";
  page.subject = json_text(facts.inputs.front().filename()) +
                 (facts.inputs.size() > 1 ? fmt::format(" and {} more", facts.inputs.size() - 1) : "") +
                 " to " + json_text(facts.reference.filename());
  if (facts.tolerance >= 0.0)
    page.verdict = PageVerdict{
        passes(all, facts.share),
        fmt::format("{} of the measured points deviate by no more than {}; {:.6g} % are asked for.",
                    share_text(all.within, all.count), number_text(facts.tolerance), 100.0 * facts.share)};
  page.headlines = {{"points measured", with_commas(all.count)},
                    {"mean", fmt::format("{:+.4g}", all.mean)},
                    {"root mean square", fmt::format("{:.4g}", all.rms)},
                    {"lowest", fmt::format("{:+.4g}", all.min)},
                    {"highest", fmt::format("{:+.4g}", all.max)}};
  page.notices = report.notices;
  page.inputs = input_rows(report, facts);
  page.figures = figure_rows(report, facts);
  page.histogram = histogram_of(report.table, facts.tolerance);
  add_pictures(page, report, facts);
  page.place_columns = {"deviation"};
  for (const WorstPlace& w : report.map.worst) page.places.push_back({w.at, {signed_text(w.value)}});
  page.places_note =
      "The largest deviations, either way, at least a twentieth of the longest side of the scan apart.";
  if (report.table.rows.size() > 1) {
    page.tables_title = "By polygon";
    page.tables.push_back(area_table(report.table, facts.tolerance));
    page.drawings_title = "Where the polygons lie";
    page.drawings.push_back(area_sketch(facts.areas));
  }
  return page;
}

}  // namespace tessera
