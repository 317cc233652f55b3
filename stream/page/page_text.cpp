#include "stream/page/page_text.h"

#include <algorithm>
#include <array>
#include <fstream>

#include <fmt/format.h>

#include "kernels/picture/caption.h"
#include "stream/files/json.h"
#include "stream/page/html.h"
#include "stream/page/page_figures.h"
#include "stream/page/page_script.h"
#include "stream/page/report_value.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

using html::escape;
using html::tile;
using Rows = std::vector<std::pair<std::string, std::string>>;

constexpr const char* kGenerator = "tessera report";
constexpr std::size_t kOtherBytes = std::size_t{64} << 10;  // about what stands behind the long sections

std::string name_of(const std::string& path) {
  return path.substr(path.find_last_of('/') + 1);
}

std::string summary(const Json& report, const PageParts& parts) {
  std::string tiles;
  if (const Json& points = value_at(report, "/points"); points.is_number())
    tiles += tile(count_text(points), "points in");
  if (const Json& faces = value_at(report, "/input/faces"); faces.is_number())
    tiles += tile(count_text(faces), "faces in");
  if (const Json& faces = value_at(report, "/mesh/faces"); faces.is_number())
    tiles += tile(count_text(faces), "faces out");
  if (parts.check)
    tiles += tile(parts.check->boundary_edges == 0 ? "closed" : with_commas(parts.check->boundary_loops),
                  parts.check->boundary_edges == 0 ? "no border edge" : "holes and outer borders");
  if (const Json& maximum = value_at(report, "/certificate/certified_max"); maximum.is_number())
    tiles += tile(bound_text(maximum.get<double>(), 6), "largest distance, proven both ways");
  if (const Json& confirmed = value_at(report, "/coverage/confirmed"); confirmed.is_number()) {
    const std::string text = coverage_text(report);
    tiles += tile(text.substr(0, text.find('%') + 1), "of what was seen is in the mesh");
  }
  if (const Json& time = value_at(report, "/wall_s"); time.is_number())
    tiles += tile(time_text(time.get<double>()), "from start to end");
  if (const Json& peak = value_at(report, "/peak_bytes"); peak.is_number())
    tiles += tile(bytes_text(peak), "peak memory of " + bytes_text(value_at(report, "/memory_cap_bytes")));
  return "<div class=\"tiles\">\n" + tiles + "</div>\n";
}

std::string warnings(const Json& report) {
  std::string list;
  if (const Json& all = value_at(report, "/warnings"); all.is_array())
    for (const Json& w : all)
      if (w.is_string()) list += "<li>" + escape(w.get<std::string>()) + "</li>\n";
  return list.empty() ? ""
                      : html::section("warnings", "Warnings", "<ul class=\"warn\">\n" + list + "</ul>\n");
}

std::string refusal(const Json& report) {
  const Json& refused = value_at(report, "/refused");
  if (!refused.is_object()) return "";
  std::string body = html::paragraph(text_at(refused, "/message"), "refused");
  body += html::paragraph(
      fmt::format("Exit code {}: {}. There is no result; what was done so far is kept in the work directory.",
                  text_at(refused, "/code"), text_at(refused, "/meaning")));
  return html::section("refused", "Refused", body);
}

std::string went_in(const Json& report) {
  Rows rows;
  if (const Json& inputs = value_at(report, "/inputs"); inputs.is_array())
    for (const Json& input : inputs)
      rows.emplace_back("input", fmt::format("<bdi>{}</bdi>, {}", escape(text_at(input, "/path")),
                                             bytes_text(value_at(input, "/bytes"))));
  return html::section("in", "What went in", html::table(rows) + input_figures(report));
}

std::string came_out(const Json& report, const PageParts& parts) {
  const Json& mesh = value_at(report, "/mesh");
  if (!mesh.is_object()) return "";
  Rows rows;
  rows.emplace_back("mesh", fmt::format("<bdi>{}</bdi>, {}", escape(text_at(report, "/output/path")),
                                        bytes_text(value_at(report, "/output/bytes"))));
  const auto count = [&](const char* name, const char* key) {
    if (const Json& value = value_at(mesh, key); value.is_number())
      rows.emplace_back(name, escape(count_text(value)));
  };
  count("vertices", "/vertices");
  count("faces", "/faces");
  if (const Json& filled = value_at(mesh, "/synthetic_faces"); filled.is_number() && filled != 0)
    rows.emplace_back("faces that close holes", escape(count_text(filled)) + ", marked in the file (PLY)");
  count("holes filled", "/holes/filled");
  if (const Json& dropped = value_at(mesh, "/islands_dropped"); dropped.is_number() && dropped != 0)
    rows.emplace_back("small islands left out",
                      fmt::format("{}, of {} faces together", escape(count_text(dropped)),
                                  escape(count_text(value_at(mesh, "/island_faces_dropped")))));
  if (const Json& kept = value_at(report, "/colours/vertices_kept"); kept.is_number())
    rows.emplace_back("vertices kept for their colours alone",
                      fmt::format("{}, about two faces each (--colour-tolerance)", escape(count_text(kept))));
  if (!parts.check) count("components", "/components");
  if (const std::string site = text_at(report, "/tiles/path"); !site.empty())
    rows.emplace_back("3D Tiles of it", fmt::format("<bdi>{}</bdi>", escape(site)));
  return html::section("out", "What came out", html::table(rows) + topology_figures(parts));
}

std::string textures(const Json& report, const PageParts& parts) {
  const Json& texture = value_at(report, "/texture");
  if (!texture.is_object()) return "";
  std::string body;
  const std::string psnr =
      value_at(texture, "/texels/psnr_db").is_number()
          ? fmt::format("; colours at points: {:.1f} dB (PSNR)", number_at(texture, "/texels/psnr_db"))
          : std::string();
  const std::string told = fmt::format(
      "{} pages, {} texels {} wide on {} charts, stretch (L2) {:.3f}, {:.0f} % of the pages used{}",
      count_text(value_at(texture, "/pages/pages")), count_text(value_at(texture, "/texels/texels")),
      number_text(number_at(texture, "/scale/texel")), count_text(value_at(texture, "/charts/charts")),
      number_at(texture, "/charts/stretch_l2"), 100.0 * number_at(texture, "/pack/used_share"), psnr);
  if (!parts.textures.empty())
    body = html::picture(parts.textures, "Pages of textures, small", told);
  else
    body = html::paragraph(told + (parts.textures_note.empty() ? "" : ". " + parts.textures_note), "note");
  return html::section("textures", "Textures", body);
}

std::string pictures(const PageParts& parts) {
  std::string body;
  if (!parts.pictures.empty())
    body = html::picture(
        parts.pictures, "The result from four sides: twice from above a corner, from the front, from the top",
        parts.pictures_note);
  else if (!parts.pictures_note.empty())
    body += html::paragraph(parts.pictures_note, "note");
  return body.empty() ? "" : html::section("pictures", "From four sides", body);
}

std::string deviation(const Json& report, const PageParts& parts) {
  std::string body = deviation_figures(report);
  if (!parts.deviation.empty())
    body += html::picture(parts.deviation, "The result in colours of its distance to what it was made from",
                          "Distance to the reference. " + parts.deviation_note);
  else if (!parts.deviation_note.empty())
    body += html::paragraph(parts.deviation_note, "note");
  return body.empty() ? "" : html::section("deviation", "Deviation", body);
}

std::string completeness(const Json& report, const PageParts& parts) {
  const Json& coverage = value_at(report, "/coverage");
  const std::string said = coverage_text(report);
  if (said.empty()) return "";
  const auto missing = [&](const char* part, const char* all) {
    return fmt::format("{} of {}", escape(count_text(value_at(coverage, part))),
                       escape(count_text(value_at(coverage, all))));
  };
  Rows rows;
  rows.emplace_back(
      "points on a surface beyond doubt",
      fmt::format(
          "{} lie farther than {} from the mesh; {} looked at", missing("/points_missing", "/points"),
          number_text(number_at(coverage, "/distance")),
          value_at(coverage, "/one_in") == 1
              ? "all points were"
              : "one in " + escape(count_text(value_at(coverage, "/one_in"))) + " of all points was"));
  rows.emplace_back(
      "columns seen from above",
      fmt::format("{}, squares of {} that hold at least four points, have no mesh",
                  missing("/columns_missing", "/columns"), number_text(number_at(coverage, "/column_edge"))));
  std::string body = html::paragraph(said + ".");
  if (const std::string ground = ground_text(report); !ground.empty()) body += html::paragraph(ground + ".");
  body += html::table(rows);
  if (!parts.missing.empty())
    body += html::picture(
        parts.missing, "The scan from above, in magenta where its mesh lacks what was seen",
        "From above: grey where the mesh holds what was seen, magenta where something is missing. "
        "Leaves, spray and noise are not counted.");
  return html::section("completeness", "Completeness", body);
}

std::string uncertainty(const Json& report, const PageParts& parts) {
  const Json& orient = stage_result(report, "orient");
  const Json& share = value_at(orient, "/uncertain_fraction");
  if (!share.is_number() && parts.uncertain.empty()) return "";
  Rows rows;
  if (share.is_number())
    rows.emplace_back("points whose side is in doubt",
                      fmt::format("{} %, {} points", number_text(100.0 * share.get<double>()),
                                  escape(count_text(value_at(orient, "/uncertain_points")))));
  if (const Json& strewn = value_at(orient, "/uncertain_strewn_fraction"); strewn.is_number())
    rows.emplace_back("strewn points whose side is in doubt",
                      fmt::format("{} %, {} points", number_text(100.0 * strewn.get<double>()),
                                  escape(count_text(value_at(orient, "/uncertain_strewn_points")))));
  if (const std::string scene = text_at(orient, "/scene"); !scene.empty())
    rows.emplace_back("told as a scan", escape(scene));
  std::string body = html::table(rows);
  if (!parts.uncertain.empty())
    body += html::picture(parts.uncertain, "Where the sides of points are in doubt, in red",
                          "Red: the side on which the scanner stood is in doubt.");
  return html::section("uncertainty", "Uncertainty", body);
}

std::string options(const Json& report) {
  Rows rows;
  if (const Json& all = value_at(report, "/options"); all.is_object())
    for (const auto& [key, value] : all.items())
      if (!value.is_null() && !(value.is_array() && value.empty()))
        rows.emplace_back("--" + key,
                          escape(value.is_string() ? value.get<std::string>() : dump_json(value)));
  return html::section(
      "options", "Options",
      "<details><summary>all that decide the result</summary>\n" + html::table(rows) + "</details>\n");
}

std::string preview(const PageParts& parts) {
  if (!parts.preview || parts.preview->faces.empty())
    return parts.preview_note.empty()
               ? ""
               : html::section("preview", "Preview", html::paragraph(parts.preview_note, "note"));
  const PreviewMesh& mesh = *parts.preview;
  std::string said = with_commas(mesh.faces.size()) + " faces";
  said += mesh.cell > 0.0
              ? " instead of " + with_commas(mesh.mesh_faces) +
                    ": a copy for looking at, by clustering of vertices in cells of " +
                    number_text(round_up_2_digits(mesh.cell)) + "; it proves nothing about the mesh."
              : ", the mesh itself.";
  std::string text = html::section_begin("preview", "Preview");
  text +=
      "<div class=\"stage\"><canvas id=\"view\" tabindex=\"0\" role=\"img\" aria-label=\"The result in three "
      "dimensions; drag or use the arrow keys to turn it, plus and minus to come closer\"></canvas></div>\n"
      "<p class=\"note\" id=\"view-note\">Turning it needs scripts and WebGL 2; the pictures above show the "
      "same.</p>\n"
      "<p><button type=\"button\" id=\"view-home\">Back to the start</button> <label><input "
      "type=\"checkbox\" "
      "id=\"view-wire\"> edges</label> Drag turns, Shift and drag moves, the wheel or + and - come closer, "
      "arrow keys turn.</p>\n";
  text += html::paragraph(said);
  add_preview_data(text, mesh);
  text += html::kSectionEnd;
  return text;
}

}  // namespace

std::string page_text(const Json& report, const PageParts& parts) {
  const bool refused = value_at(report, "/refused").is_object();
  const std::string output = text_at(report, "/output/path");
  std::string text = html::head(kGenerator, name_of(output) + ": report of Tessera", true);
  text += fmt::format(
      "<header>\n<h1><bdi>{}</bdi> <span class=\"state "
      "{}\">{}</span></h1>\n<p><code><bdi>{}</bdi></code></p>\n"
      "<p>{}, Tessera {}, {} ({}, {} cores)</p>\n</header>\n<main>\n",
      escape(name_of(output)), refused ? "bad" : "good", refused ? "refused" : "done",
      escape(text_at(report, "/command")), escape(text_at(report, "/finished")),
      escape(text_at(report, "/version")), escape(text_at(report, "/machine/host")),
      escape(text_at(report, "/machine/processor")), escape(text_at(report, "/machine/cores")));
  const std::array sections = {refusal(report),           summary(report, parts),
                               warnings(report),          went_in(report),
                               came_out(report, parts),   pictures(parts),
                               textures(report, parts),   preview(parts),
                               deviation(report, parts),  completeness(report, parts),
                               uncertainty(report, parts)};
  std::size_t size = text.size() + kOtherBytes;
  for (const std::string& section : sections) size += section.size();
  text.reserve(size);  // it grows in one place
  for (const std::string& section : sections) text += section;
  if (const std::string shape = shape_figures(report, parts); !shape.empty())
    text += html::section("shape", "Shape", shape);
  text += html::section("run", "How it ran", run_figures(report)) + options(report);
  text += "</main>\n";
  if (parts.preview && !parts.preview->faces.empty())
    text += fmt::format("<script>{}</script>\n", kPreviewScript);
  text += "</body>\n</html>\n";
  return text;
}

bool is_page(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string begin = html::begin(kGenerator);
  std::string start(begin.size(), '\0');
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  return file.gcount() == static_cast<std::streamsize>(start.size()) && start == begin;
}

}  // namespace tessera
