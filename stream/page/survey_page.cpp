#include "stream/page/survey_page.h"

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/render/render_scene.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

using html::escape;

std::string css_colour(std::uint32_t rgba) {
  return fmt::format("#{:02x}{:02x}{:02x}", rgba & 255u, rgba >> 8 & 255u, rgba >> 16 & 255u);
}

std::string rows_text(const PageRows& rows) {
  PageRows safe;
  for (const auto& [name, value] : rows) safe.emplace_back(name, escape(value));
  return rows.empty() ? "" : html::table(safe);
}

std::string verdict_text(const PageVerdict& verdict) {
  return fmt::format("<p class=\"verdict {}\"><b>{}</b> <span>{}</span></p>\n",
                     verdict.passed ? "good" : "bad", verdict.passed ? "PASSED" : "NOT PASSED",
                     escape(verdict.text));
}

std::string table_text(const PageTable& table) {
  std::string text = "<table class=\"wide\">\n";
  if (!table.title.empty()) text += "<caption>" + escape(table.title) + "</caption>\n";
  text += "<thead><tr>";
  for (const std::string& column : table.columns) text += "<th scope=\"col\">" + escape(column) + "</th>";
  text += "</tr></thead>\n<tbody>\n";
  for (const std::vector<std::string>& row : table.rows) {
    text += "<tr>";
    for (std::size_t k = 0; k < row.size(); ++k)
      text += k == 0 ? "<th scope=\"row\">" + escape(row[k]) + "</th>" : "<td>" + escape(row[k]) + "</td>";
    text += "</tr>\n";
  }
  text += "</tbody></table>\n";
  return table.note.empty() ? text : text + html::paragraph(table.note, "note");
}

/// A bar of small steps, numbers below, and what other colours mean.
std::string scale_text(const PageScale& scale) {
  constexpr int kSteps = 64, kTicks = 4;
  constexpr double kWidth = 480.0, kBar = 18.0;
  const bool with_sign = scale.low < 0.0;
  std::string text = fmt::format(
      "<figure class=\"scale\"><figcaption>{0}</figcaption>\n<svg viewBox=\"-30 0 {1} 42\" role=\"img\" "
      "aria-label=\"{0}\">\n",
      escape(scale.title + ", " + scale.unit), kWidth + 60.0);
  for (int i = 0; i < kSteps; ++i) {
    const double value = scale.low + (scale.high - scale.low) * (i + 0.5) / kSteps;
    text += fmt::format("<rect style=\"fill:{}\" x=\"{:.2f}\" y=\"0\" width=\"{:.2f}\" height=\"{}\"/>",
                        css_colour(deviation_colour(value, scale.high, with_sign)), kWidth * i / kSteps,
                        kWidth / kSteps + 0.5, kBar);
  }
  text += "\n";
  for (int i = 0; i <= kTicks; ++i) {
    const double share = static_cast<double>(i) / kTicks, x = kWidth * share;
    const double value = scale.low + (scale.high - scale.low) * share;
    text += fmt::format(
        "<line x1=\"{0:.2f}\" x2=\"{0:.2f}\" y1=\"{1}\" y2=\"{2}\"/><text x=\"{0:.2f}\" y=\"{3}\" "
        "text-anchor=\"middle\">{4}{5}</text>\n",
        x, kBar, kBar + 5.0, kBar + 19.0, with_sign && value > 0.0 ? "+" : "", number_text(value));
  }
  text += "</svg>\n";
  for (const auto& [colour, meaning] : scale.others)
    text += fmt::format("<p class=\"key\"><span style=\"background:{}\"></span> {}</p>\n", escape(colour),
                        escape(meaning));
  return text + "</figure>\n";
}

std::string pictures_text(const SurveyPage& page) {
  std::string body;
  if (!page.pictures.empty() && page.scale) body += scale_text(*page.scale);
  for (const PagePicture& p : page.pictures) body += html::picture(p.png, p.alternative, p.caption);
  if (!page.pictures_note.empty()) body += html::paragraph(page.pictures_note, "note");
  return body.empty() ? "" : html::section("pictures", "Pictures", body);
}

std::string places_text(const SurveyPage& page) {
  if (page.places.empty()) return "";
  PageTable table{"", {"number", "x", "y", "z"}, {}, page.places_note};
  table.columns.insert(table.columns.end(), page.place_columns.begin(), page.place_columns.end());
  for (std::size_t i = 0; i < page.places.size(); ++i) {
    std::vector<std::string> row = {std::to_string(i + 1)};
    for (const double c : page.places[i].at) row.push_back(fmt::format("{:.10g}", c));
    row.insert(row.end(), page.places[i].values.begin(), page.places[i].values.end());
    table.rows.push_back(row);
  }
  return html::section("places", "Worst places", table_text(table));
}

std::string drawings_text(const SurveyPage& page) {
  if (page.drawings.empty()) return "";
  std::string body = page.drawings_note.empty() ? "" : html::paragraph(page.drawings_note, "note");
  for (const PageDrawing& d : page.drawings) {
    std::string facts;
    for (const auto& [name, value] : d.facts)
      facts += fmt::format("{}{} <b>{}</b>", facts.empty() ? "" : ", ", escape(name), escape(value));
    body += fmt::format(
        "<figure class=\"drawing\"><figcaption><b>{}</b>{}{} ({})</figcaption>\n{}</figure>\n",
        escape(d.title), facts.empty() ? "" : ": ", facts, escape(d.drawing.scale_text()), d.drawing.svg());
  }
  return html::section("drawings", page.drawings_title, body);
}

}  // namespace

std::string survey_page_text(const SurveyPage& page) {
  std::string text = html::head("tessera " + page.command, page.title + ": " + page.subject, false);
  text +=
      fmt::format("<header>\n<h1>{}</h1>\n<p><bdi>{}</bdi></p>\n<p>tessera {} {}</p>\n</header>\n<main>\n",
                  escape(page.title), escape(page.subject), escape(page.command), TESSERA_VERSION);
  if (page.verdict) text += verdict_text(*page.verdict);
  std::string tiles;
  for (const auto& [what, value] : page.headlines) tiles += html::tile(value, what);
  if (!tiles.empty()) text += "<div class=\"tiles\">\n" + tiles + "</div>\n";
  std::string notices;
  for (const std::string& notice : page.notices) notices += "<li>" + escape(notice) + "</li>\n";
  if (!notices.empty())
    text += html::section("notices", "Notices", "<ul class=\"warn\">\n" + notices + "</ul>\n");
  if (!page.inputs.empty()) text += html::section("inputs", "What was measured", rows_text(page.inputs));
  std::string figures = rows_text(page.figures);
  if (page.histogram) figures += html::histogram(*page.histogram);
  if (!figures.empty()) text += html::section("figures", "Figures", figures);
  text += pictures_text(page) + places_text(page);
  std::string tables;
  for (const PageTable& table : page.tables) tables += table_text(table);
  if (!tables.empty()) text += html::section("tables", page.tables_title, tables);
  text += drawings_text(page);
  return text +
         "<footer class=\"sign\"><span>Place, date</span><span>Name, signature</span></footer>\n</main>\n"
         "</body>\n</html>\n";
}

std::string place_text(const Double3& p) {
  return fmt::format("{:.10g} {:.10g} {:.10g}", p[0], p[1], p[2]);
}

void require_page_name(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  if (!path.empty() && extension != ".html" && extension != ".htm")
    throw UsageError("--page " + path.string() + ": a page is HTML: end its name in .html");
}

}  // namespace tessera
