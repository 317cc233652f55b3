#include "stream/page/page_figures.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>

#include <fmt/format.h>

#include "kernels/picture/caption.h"
#include "stream/files/json.h"
#include "stream/page/html.h"
#include "stream/page/report_value.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

using html::escape;
using Rows = std::vector<std::pair<std::string, std::string>>;

/// Bars of counts that are there, as shares of `all`.
std::string count_bars(const std::string& title, const std::vector<std::pair<std::string, Json>>& counts,
                       double all) {
  std::vector<html::Bar> rows;
  for (const auto& [name, count] : counts)
    if (count.is_number() && (count != 0 || rows.empty()))
      rows.push_back({name, count_text(count), all > 0.0 ? count.get<double>() / all : 0.0});
  return rows.empty() ? "" : html::bars(title, rows);
}

std::string dispositions(const Json& report) {
  const Json& disposition = value_at(stage_result(report, "survey"), "/points");
  if (!disposition.is_object()) return "";
  const auto of = [&](const char* key) { return value_at(disposition, key); };
  const Json& order = stage_result(report, "order");
  const Json& orient = stage_result(report, "orient");
  const Json& dropped = value_at(orient, "/vegetation/as");
  return count_bars("Fates of the points",
                    {{"read", of("/read")},
                     {"withheld by the scan", of("/withheld")},
                     {"empty (no return)", of("/empty")},
                     {"missing from the file", of("/missing")},
                     {"of other classes", of("/other_class")},
                     {"of other returns", of("/other_return")},
                     {"outside the region", of("/outside")},
                     {"thinned out", of("/thinned")},
                     {"not finite", of("/non_finite")},
                     {"too far away", of("/absurd")},
                     {"kept", of("/kept")},
                     {"of these: twice the same", value_at(order, "/duplicates")},
                     {"of these: thinned where too dense", value_at(order, "/thinned")},
                     {"of these: outliers left out", value_at(orient, "/outliers_dropped")},
                     {fmt::format("of these: strewn through space{}",
                                  dropped.is_string() ? ", " + dropped.get<std::string>() : ""),
                      value_at(orient, "/vegetation/points")}},
                    number_at(disposition, "/read") + number_at(disposition, "/withheld") +
                        number_at(disposition, "/empty") + number_at(disposition, "/missing"));
}

/// Area by distance: 32 bins up to the tolerance, then up to reach, then beyond (kernels/certify/certificate.h).
std::string deviation_histogram(const std::string& title, const Json& counts, double tolerance,
                                double proven) {
  if (!counts.is_array() || counts.size() < 3 || !(tolerance > 0.0)) return "";
  html::Histogram h;
  h.title = title;
  for (const Json& c : counts) h.counts.push_back(c.is_number() ? c.get<double>() : 0.0);
  const std::size_t bins = h.counts.size() - 2;
  // What lies over the tolerance is drawn only where something does.
  while (h.counts.size() > bins && h.counts.back() == 0.0) h.counts.pop_back();
  h.edges.assign(h.counts.size() + 1, "");
  for (std::size_t q = 0; q <= 4; ++q)
    h.edges[q * bins / 4] = number_text(tolerance * static_cast<double>(q) / 4.0);
  if (proven > 0.0 && proven <= tolerance)
    h.marks.push_back(
        {static_cast<double>(bins) * proven / tolerance, "proven: at most " + bound_text(proven, 6)});
  return html::histogram(h);
}

std::string direction(const Json& certificate, const char* key, const std::string& title) {
  const Json& d = value_at(certificate, key);
  return d.is_object()
             ? deviation_histogram(title, value_at(d, "/histogram"), number_at(certificate, "/tolerance"),
                                   number_at(d, "/certified_max"))
             : "";
}

std::string shares(const std::string& title, const std::vector<std::uint64_t>& counts,
                   const std::vector<std::string>& edges) {
  html::Histogram h;
  h.title = title;
  for (const std::uint64_t c : counts) h.counts.push_back(static_cast<double>(c));
  h.edges = edges;
  return html::histogram(h);
}

/// Points by signed deviation. \param bins  as to_json(DeviationTable) has them
std::string signed_histogram(const std::string& title, const Json& bins) {
  constexpr std::size_t kTicks = 8;
  if (!bins.is_array() || bins.size() < 3) return "";
  html::Histogram h;
  h.title = title;
  const std::size_t stride = std::max<std::size_t>(1, bins.size() / kTicks);
  for (const Json& bin : bins) {
    const Json& low = value_at(bin, "/low");
    h.edges.push_back(low.is_number() && h.counts.size() % stride == 0 ? number_text(low.get<double>()) : "");
    h.counts.push_back(number_at(bin, "/points"));
  }
  h.edges.emplace_back();
  return html::histogram(h);
}

/// Of a mesh that was brought onto a scan: how far the scan was from it, and is.
std::string onto_figures(const Json& report, Rows& rows) {
  const Json& onto = value_at(report, "/onto");
  if (!value_at(onto, "/after").is_object()) return "";
  std::string text;
  for (const auto& [key, name] : {std::pair{"/before", "as given"}, {"/after", "as written"}}) {
    const Json& all = value_at(onto, std::string(key) + "/areas/0");
    rows.emplace_back(
        fmt::format("points of the scan from the mesh {}", name),
        fmt::format("root mean square {}, mean {}, nine in ten from {} to {}; {} points, {} of them too far",
                    number_text(number_at(all, "/rms")), number_text(number_at(all, "/mean")),
                    number_text(number_at(all, "/percentiles/5")),
                    number_text(number_at(all, "/percentiles/95")),
                    escape(count_text(value_at(all, "/points"))), escape(count_text(value_at(all, "/far")))));
    text += signed_histogram(fmt::format("Points of the scan by signed distance to the mesh {}", name),
                             value_at(onto, std::string(key) + "/histogram"));
  }
  rows.emplace_back("shortest waves of the displacement", number_text(number_at(onto, "/fit/wavelength")));
  return text;
}

std::string spacing(const Json& report) {
  const Json& s = stage_result(report, "spacing");
  if (!value_at(s, "/spacing").is_number()) return "";
  const std::pair<const char*, const char*> kRows[] = {{"densest part", "/spacing_dense"},
                                                       {"half of the surface", "/spacing_middle"},
                                                       {"wide part", "/spacing_wide"},
                                                       {"90 % of the surface", "/spacing"},
                                                       {"gaps", "/gap"},
                                                       {"noise", "/noise"}};
  double maximum = 0.0;
  for (const auto& [name, key] : kRows) maximum = std::max(maximum, number_at(s, key));
  std::vector<html::Bar> rows;
  for (const auto& [name, key] : kRows)
    if (value_at(s, key).is_number())
      rows.push_back(
          {name, number_text(number_at(s, key)), maximum > 0.0 ? number_at(s, key) / maximum : 0.0});
  return html::bars("Spacing of the points, units of the scan", rows);
}

void append_bytes(std::string& to, const void* data, std::size_t bytes) {
  to.append(static_cast<const char*>(data), bytes);
}

}  // namespace

std::string input_figures(const Json& report) {
  std::string text = dispositions(report);
  Rows rows;
  if (const Json& h = value_at(report, "/resolution/h"); h.is_number())
    rows.emplace_back("resolution h", fmt::format("{}: {}", number_text(h.get<double>()),
                                                  escape(text_at(report, "/resolution/reason"))));
  if (const std::string crs = text_at(report, "/coordinate_system/name"); !crs.empty()) {
    const std::string code = text_at(report, "/coordinate_system/epsg");
    rows.emplace_back(
        "coordinate system",
        escape(crs + (code.empty() || crs.find(code) != std::string::npos ? "" : ", EPSG:" + code)));
  }
  const Json& input = value_at(report, "/input");
  if (input.is_object()) {
    rows.emplace_back("format", escape(text_at(input, "/format")));
    rows.emplace_back("vertices", escape(count_text(value_at(input, "/vertices"))));
    rows.emplace_back("faces", escape(count_text(value_at(input, "/faces"))));
    const Json& repair = value_at(input, "/repair");
    if (repair.is_object())
      for (const auto& [key, count] : repair.items())
        if (key != "faces" && count.is_number() && count != 0) {
          std::string name = key;
          std::replace(name.begin(), name.end(), '_', ' ');
          rows.emplace_back(name, escape(count_text(count)));
        }
  }
  return text + html::table(rows) + spacing(report);
}

std::string topology_figures(const PageParts& parts) {
  if (!parts.check) return parts.check_note.empty() ? "" : html::paragraph(parts.check_note, "note");
  const MeshCheck& c = *parts.check;
  Rows rows;
  rows.emplace_back("components", fmt::format("{}, {} of them closed and sound", with_commas(c.components),
                                              with_commas(c.solid_components)));
  if (c.solid_components > 0)
    rows.emplace_back("genus, all closed parts together", std::to_string(c.total_genus));
  std::string borders = fmt::format("{} edges", with_commas(c.boundary_edges));
  if (c.boundary_edges > 0) {
    borders += fmt::format(" in {} loops", with_commas(c.boundary_loops));
    if (c.open_loops > 0) borders += fmt::format(", {} of them not closed", with_commas(c.open_loops));
    borders += "; longest:";
    for (std::size_t i = 0; i < std::min<std::size_t>(c.largest_loops.size(), 8); ++i)
      borders += " " + with_commas(c.largest_loops[i].edges);
  }
  rows.emplace_back("holes and outer borders", borders);
  const std::vector<std::string> defects = c.defects();
  std::string list;
  for (const std::string& d : defects) list += (list.empty() ? "" : ", ") + d;
  rows.emplace_back("defects", list.empty() ? "none" : escape(list));
  const auto vector = [](const Double3& v) {
    return fmt::format("{:.10g} {:.10g} {:.10g}", v[0], v[1], v[2]);
  };
  rows.emplace_back("bounds", vector(c.min) + " to " + vector(c.max));
  if (c.has_shape) rows.emplace_back("area", number_text(c.area));
  if (c.has_shape && c.solid())
    rows.emplace_back("volume",
                      number_text(c.volume) +
                          (c.volume < 0.0 ? ": inside out, the faces look inwards as the normals did" : ""));
  return html::table(rows);
}

std::string deviation_figures(const Json& report) {
  std::string text;
  Rows rows;
  const Json& certificate = value_at(report, "/certificate");
  if (const Json& maximum = value_at(certificate, "/certified_max"); maximum.is_number()) {
    rows.emplace_back("largest distance, proven both ways", bound_text(maximum.get<double>(), 6));
    if (const double rounding = number_at(certificate, "/rounding"); rounding > 0.0)
      rows.emplace_back("of it by rounding to floats in the file", bound_text(rounding, 6));
    rows.emplace_back("tolerance", number_text(number_at(certificate, "/tolerance")));
    rows.emplace_back("root mean square, result to reference",
                      number_text(number_at(certificate, "/mesh_to_reference/rms")));
    rows.emplace_back("root mean square, reference to result",
                      number_text(number_at(certificate, "/reference_to_mesh/rms")));
    rows.emplace_back("borders within the tolerance too",
                      value_at(certificate, "/borders_proven") == true ? "proven" : "not proven");
  }
  text += direction(certificate, "/mesh_to_reference", "Area of the result by distance to the reference");
  text += direction(certificate, "/reference_to_mesh", "Area of the reference by distance to the result");
  for (const auto& [key, name] :
       {std::pair{"/samples", "result"}, {"/points_to_surface", "full resolution"}}) {
    const Json& samples = value_at(report, key);
    if (!value_at(samples, "/certified_max").is_number()) continue;
    rows.emplace_back(fmt::format("farthest point from the {}", name),
                      number_text(number_at(samples, "/certified_max")));
    text += deviation_histogram(fmt::format("Points by distance to the {}", name),
                                value_at(samples, "/histogram"), tolerance_of_job(report),
                                number_at(samples, "/certified_max"));
  }
  text += onto_figures(report, rows);
  // Of smoothing: a job of its own, or before decimation.
  for (const auto& [key, name] : {std::pair{"/mesh/largest_move", "farthest move of a vertex"},
                                  {"/mesh/rms_move", "moves, root mean square"},
                                  {"/smoothing/noise/before", "noise along the normal, before smoothing"},
                                  {"/smoothing/noise/after", "noise left by smoothing"},
                                  {"/smoothing/largest_move", "farthest move of a vertex by smoothing"},
                                  {"/smoothing/rms_move", "moves by smoothing, root mean square"}})
    if (const Json& figure = value_at(report, key); figure.is_number())
      rows.emplace_back(name, number_text(figure.get<double>()));
  return (rows.empty() ? "" : html::table(rows)) + text;
}

namespace {

/// Of remeshing.
std::string quality_figures(const Json& quality) {
  Rows rows;
  for (const auto& [key, name] :
       {std::pair{"/mean_angle_deviation_deg", "angles, mean distance from 60 degrees"},
        {"/smallest_angle_deg", "smallest angle, degrees"},
        {"/share_below_25_deg", "share of faces with an angle below 25 degrees"},
        {"/mean_edge_deviation", "edges, mean deviation from the length asked for"},
        {"/valence_six_share", "share of inner vertices with six neighbours"},
        {"/mean_voronoi_area_deviation",
         "Voronoi cells of inner vertices, mean deviation from their mean area"}})
    if (const Json& figure = value_at(quality, key); figure.is_number())
      rows.emplace_back(name, number_text(figure.get<double>()));
  if (rows.empty()) return "";
  std::string text = html::table(rows);
  if (const Json& cells = value_at(quality, "/voronoi_areas_by_100th_of_hexagon"); cells.is_array()) {
    constexpr std::size_t kTogether = 5, kMarks = 5;  // bins of 0.05, a mark at every quarter
    std::vector<std::uint64_t> counts((cells.size() + kTogether - 1) / kTogether, 0);
    for (std::size_t i = 0; i < cells.size(); ++i)
      if (cells[i].is_number_unsigned()) counts[i / kTogether] += cells[i].get<std::uint64_t>();
    std::vector<std::string> edges(counts.size() + 1);
    for (std::size_t i = 0; i < counts.size(); i += kMarks)
      edges[i] = number_text(0.01 * static_cast<double>(i * kTogether));
    text +=
        shares("Inner vertices by the area of their Voronoi cell (1 = of triangles of the length asked for)",
               counts, edges);
  }
  return text;
}

/// A table of the figures that are there. \param rows  where they stand, and what they are
std::string figures_there(const Json& from, std::initializer_list<std::pair<const char*, const char*>> rows) {
  Rows there;
  for (const auto& [key, name] : rows)
    if (const Json& figure = value_at(from, key); figure.is_number())
      there.emplace_back(name, number_text(figure.get<double>()));
  return there.empty() ? "" : html::table(there);
}

/// Of remeshing with --adaptive.
std::string length_ratio_figures(const Json& ratios) {
  return figures_there(ratios, {{"/asked", "largest ratio of the mean edges of neighbours that is aimed at"},
                                {"/beyond_before", "edges beyond it before lengths were evened"},
                                {"/beyond", "edges beyond it"},
                                {"/at_lines", "of them between vertices on creases or borders"},
                                {"/at_tolerance", "of them where the tolerance locks them"},
                                {"/held", "of them beside faces of the input, kept for the proof"}});
}

/// Of remeshing with --min-angle.
std::string small_angle_figures(const Json& angles) {
  return figures_there(angles,
                       {{"/asked_deg", "smallest angle asked for, degrees"},
                        {"/below_before", "faces below it before angles were raised"},
                        {"/below", "faces below it"},
                        {"/between_lines", "of them between creases or borders that meet at a smaller angle"},
                        {"/at_tolerance", "of them where the tolerance locks them"},
                        {"/held", "of them of the input, kept for the proof"}});
}

}  // namespace

std::string shape_figures(const Json& report, const PageParts& parts) {
  std::string text = quality_figures(value_at(report, "/quality")) +
                     length_ratio_figures(value_at(report, "/length_ratios")) +
                     small_angle_figures(value_at(report, "/small_angles"));
  if (parts.preview) {
    const PreviewMesh& p = *parts.preview;
    std::vector<std::string> degrees;
    for (int d = 0; d <= 60; d += 5) degrees.push_back(std::to_string(d) + "\u00b0");
    text +=
        shares("Faces by their smallest angle", {p.smallest_angle.begin(), p.smallest_angle.end()}, degrees);
    std::vector<std::string> lengths(p.edge_length.size() + 1);
    const std::size_t stride = p.edge_length.size() / 8 + 1;
    for (std::size_t i = 0; i < lengths.size(); i += stride) {
      const double octaves =
          std::ldexp(1.0, static_cast<int>(i / 2)) * (i % 2 == 1 ? 1.4142135623730951 : 1.0);
      lengths[i] = fmt::format("{:.3g}", p.shortest_edge_bin * octaves);
    }
    text += shares("Sides of faces by length, units of the mesh", p.edge_length, lengths);
  }
  if (parts.check && parts.check->has_shape) {
    std::vector<std::string> bounds = {"1"};
    for (const double b : kAspectBounds) bounds.push_back(number_text(b));
    bounds.emplace_back("");
    text += shares("Faces by aspect (longest side over height, 1 = equilateral)",
                   {parts.check->aspect_histogram.begin(), parts.check->aspect_histogram.end()}, bounds);
  }
  return text;
}

std::string run_figures(const Json& report) {
  std::string text;
  const Json& stages = value_at(report, "/stages");
  double longest = 0.0, written = 0.0, read = 0.0;
  std::vector<html::Bar> rows;
  std::string table =
      "<table class=\"wide\">\n<tr><th scope=\"col\">stage</th><th scope=\"col\">tasks</th><th "
      "scope=\"col\">time</th>"
      "<th scope=\"col\">processor</th><th scope=\"col\">peak memory</th><th scope=\"col\">read</th><th "
      "scope=\"col\">written</th></tr>\n";
  if (stages.is_array()) {
    for (const Json& s : stages) longest = std::max(longest, number_at(s, "/wall_s"));
    for (const Json& s : stages) {
      if (number_at(s, "/tasks") == 0.0 && number_at(s, "/units") == 0.0) continue;  // had nothing to do
      const double wall = number_at(s, "/wall_s");
      rows.push_back({text_at(s, "/name"), time_text(wall), longest > 0.0 ? wall / longest : 0.0});
      written += number_at(s, "/bytes_written");
      read += number_at(s, "/bytes_read");
      table += fmt::format(
          "<tr><th "
          "scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
          escape(text_at(s, "/name")), escape(count_text(value_at(s, "/tasks"))), time_text(wall),
          time_text(number_at(s, "/cpu_s")), bytes_text(value_at(s, "/peak_bytes")),
          bytes_text(value_at(s, "/bytes_read")), bytes_text(value_at(s, "/bytes_written")));
    }
  }
  if (!rows.empty()) text += html::bars("Time by stage", rows);
  const double cap = number_at(report, "/memory_cap_bytes"), peak = number_at(report, "/peak_bytes");
  if (cap > 0.0)
    text += html::bars("Memory", {{"peak", bytes_text(value_at(report, "/peak_bytes")), peak / cap},
                                  {"cap", bytes_text(value_at(report, "/memory_cap_bytes")), 1.0}});
  Rows more;
  if (const std::string cap_text = text_at(report, "/run/memory_cap"); !cap_text.empty())
    more.emplace_back("memory cap", escape(cap_text));
  more.emplace_back("time", time_text(number_at(report, "/wall_s")) + ", of processors " +
                                time_text(number_at(report, "/cpu_s")));
  more.emplace_back("threads", escape(text_at(report, "/run/threads")));
  const auto size = [](double bytes) { return bytes_text(static_cast<std::uint64_t>(bytes)); };
  if (read >= 0.0 && written >= 0.0 && read + written < 1e18)
    more.emplace_back("disk",
                      fmt::format("{} read, {} written by all stages together", size(read), size(written)));
  if (const Json& disk = value_at(stage_result(report, "forecast"), "/peak_disk_bytes"); disk.is_number())
    more.emplace_back("disk at one time, forecast", bytes_text(disk));
  if (const Json& seconds = value_at(report, "/page/seconds"); seconds.is_number())
    more.emplace_back("this page", time_text(seconds.get<double>()) + " of the time, " +
                                       time_text(number_at(report, "/page/cpu_s")) + " of processors");
  text += html::table(more);
  return text + "<details><summary>all stages</summary>\n" + table + "</table></details>\n";
}

void add_preview_data(std::string& text, const PreviewMesh& mesh) {
  Float3 low = mesh.position.front(), high = low;
  for (const Float3& p : mesh.position)
    for (std::size_t a = 0; a < 3; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
  const double size =
      std::max({double{high[0]} - low[0], double{high[1]} - low[1], double{high[2]} - low[2], 1e-300});
  std::vector<std::uint16_t> position;
  position.reserve(3 * mesh.position.size());
  for (const Float3& p : mesh.position)
    for (std::size_t a = 0; a < 3; ++a)
      position.push_back(static_cast<std::uint16_t>(65535.0 * ((double{p[a]} - low[a]) / size)));
  std::string colour;
  colour.reserve(3 * mesh.rgba.size());
  for (const std::uint32_t c : mesh.rgba) append_bytes(colour, &c, 3);
  text += fmt::format("<div id=\"view-box\" hidden data-size=\"{:.6g},{:.6g},{:.6g}\"></div>\n",
                      (double{high[0]} - low[0]) / size, (double{high[1]} - low[1]) / size,
                      (double{high[2]} - low[2]) / size);
  const auto bytes_of = [](const auto& values) {
    return std::string_view(reinterpret_cast<const char*>(values.data()),
                            values.size() * sizeof(values.front()));
  };
  constexpr std::size_t kTags = 1024;
  text.reserve(text.size() + kTags + html::base64_size(bytes_of(position).size()) +
               html::base64_size(bytes_of(mesh.faces).size()) + html::base64_size(colour.size()));
  const auto block = [&](const char* id, std::string_view bytes) {
    text += fmt::format("<script type=\"application/octet-stream\" id=\"{}\">", id);
    html::append_base64(text, bytes);
    text += "</script>\n";
  };
  block("view-positions", bytes_of(position));
  block("view-faces", bytes_of(mesh.faces));
  if (!colour.empty()) block("view-colours", colour);
}

}  // namespace tessera
