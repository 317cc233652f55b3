// What people and programs read of a comparison.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "stream/check/mesh_compare.h"
#include "stream/files/json.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

std::string position_text(const Double3& p) {
  char text[120];
  std::snprintf(text, sizeof text, "(%.9g, %.9g, %.9g)", p[0], p[1], p[2]);
  return text;
}

std::string percent(double share) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3g %%", 100.0 * share);
  return text;
}

/// Share of the area in the bins above the tolerance.
double share_exceeding(const DeviationReport& r) {
  double exceeding = 0.0, all = 0.0;
  for (std::size_t i = 0; i < r.histogram.size(); ++i) {
    all += static_cast<double>(r.histogram[i]);
    if (i >= kDeviationBins) exceeding += static_cast<double>(r.histogram[i]);
  }
  return all > 0.0 ? exceeding / all : 0.0;
}

Json directed_json(const DeviationReport& r) {
  const bool finite = std::isfinite(r.upper);
  return {{"certified_max", finite ? Json(r.upper) : Json()},
          {"found_max", r.lower},
          {"witness", r.witness},
          {"rms", r.beyond ? Json() : Json(r.rms())},
          {"samples", r.samples},
          {"beyond_reach", r.beyond},
          {"measure", r.area},
          {"histogram", r.histogram},
          {"pieces", r.pieces},
          {"queries", r.queries}};
}

/// What both kinds of answer tell.
Json common_json(const MeshComparison& c) {
  return {{"tolerance", c.tolerance},
          {"reach", c.max_distance},
          {"diagonal", c.diagonal},
          {"faces", c.faces[0]},
          {"reference_faces", c.faces[1]},
          {"proven", c.proven()},
          {"borders_proven", c.borders_proven()},
          {"histogram_bins", kDeviationBins},
          {"border_to_reference", directed_json(c.there.border)},
          {"reference_to_border", directed_json(c.back.border)},
          {"cells", c.cells},
          {"import_seconds", c.import_seconds},
          {"seconds", c.seconds}};
}

/// What yes or no leaves to say: where a direction fails its distances, which are those of the cells that fail.
void add_failed(Json& json, const char* name, const DeviationReport& r, double tolerance) {
  if (r.upper <= tolerance) return;
  Json all = directed_json(r);
  for (const char* key : {"certified_max", "found_max", "witness", "beyond_reach"})
    json[name][key] = std::move(all[key]);
}

std::string microseconds(double us) {
  return fmt::format("{:.2f} us a face", us);
}

/// Which way yes or no went, and why.
std::string method_text(const CompareSpeed& s) {
  std::string text = s.by_raster ? "raster" : "exact";
  if (s.exact_us > 0.0)
    text += ": on the fullest cell the raster took " + microseconds(s.raster_us) + ", the certificate " +
            microseconds(s.exact_us);
  if (s.by_raster) text += "; " + percent(s.searched) + " of the faces were left to the search";
  return text;
}

std::string time_text(const MeshComparison& c) {
  return fmt::format("{:.1f} s to read both, {:.1f} s to compare {:.3g} M faces in {} cells",
                     c.import_seconds, c.seconds, 1e-6 * static_cast<double>(c.faces[0] + c.faces[1]),
                     c.cells);
}

std::string direction(const DeviationReport& r, double tolerance, double max_distance) {
  if (r.area == 0.0 && !r.beyond) return "nothing there";
  std::string text;
  if (r.beyond)
    text = "beyond " + number_text(max_distance) + " at " + position_text(r.witness);
  else
    text = "at most " + bound_text(r.upper, 6) + " (found " + number_text(r.lower) + " at " +
           position_text(r.witness) + ")";
  if (!r.beyond) text += ", rms " + number_text(r.rms());
  const double exceeding = share_exceeding(r);
  if (exceeding > 0.0) text += ", " + percent(exceeding) + " of it beyond " + number_text(tolerance);
  return text;
}

/// Both histograms, in eighths of the tolerance.
std::string bars_text(const MeshComparison& c) {
  std::string bars;
  for (const DeviationReport* r : {&c.there.surface, &c.back.surface}) {
    double all = 0.0;
    for (const std::uint64_t n : r->histogram) all += static_cast<double>(n);
    bars += bars.empty() ? "" : " |";
    for (std::size_t eighth = 0; eighth < 8 && all > 0.0; ++eighth) {
      double sum = 0.0;
      for (std::size_t i = 0; i < kDeviationBins / 8; ++i)
        sum += static_cast<double>(r->histogram[eighth * kDeviationBins / 8 + i]);
      bars += fmt::format(" {:.1f}%", 100.0 * sum / all);
    }
  }
  return bars.empty() ? bars : bars.substr(1);
}

std::string sentence(const DeviationReport& r, const std::string& from, const std::string& to,
                     double tolerance, double max_distance) {
  const std::string where = from + " at " + position_text(r.witness);
  if (r.beyond) return where + " is farther than " + number_text(max_distance) + " from the " + to;
  // More digits where six would say that the tolerance is kept.
  const auto beyond = [&](double value) {
    return number_text(value) == number_text(tolerance) ? fmt::format("{:.17g}", value) : number_text(value);
  };
  if (r.lower > tolerance) return where + " is " + beyond(r.lower) + " from the " + to;
  return from + " is proven to stay within " + beyond(r.upper) + " of the " + to + " only";
}

}  // namespace

double MeshComparison::upper() const {
  return std::max(there.surface.upper, back.surface.upper);
}

bool MeshComparison::proven() const {
  return upper() <= tolerance;
}

bool MeshComparison::borders_proven() const {
  return std::max(there.border.upper, back.border.upper) <= tolerance;
}

std::string MeshComparison::complaint(bool with_borders) const {
  const std::string start = "not proven within " + number_text(tolerance) + ": ";
  const bool none = cells_proven == 0 && there.surface.beyond && back.surface.beyond &&
                    share_exceeding(there.surface) == 1.0 && share_exceeding(back.surface) == 1.0;
  if (none)
    return start + "no part of the mesh is near the reference, is it of another place or in another unit?";
  if (!(there.surface.upper <= tolerance))
    return start + sentence(there.surface, "the mesh", "reference", tolerance, max_distance);
  if (!(back.surface.upper <= tolerance))
    return start + sentence(back.surface, "the reference", "mesh", tolerance, max_distance);
  if (with_borders && !(there.border.upper <= tolerance))
    return start + sentence(there.border, "the border of the mesh", "border of the reference", tolerance,
                            max_distance);
  if (with_borders && !(back.border.upper <= tolerance))
    return start + sentence(back.border, "the border of the reference", "border of the mesh", tolerance,
                            max_distance);
  return "";
}

Json to_json(const MeshComparison& c) {
  Json json = common_json(c);
  if (c.yes_or_no) {
    add_failed(json, "mesh_to_reference", c.there.surface, c.tolerance);
    add_failed(json, "reference_to_mesh", c.back.surface, c.tolerance);
    return json;
  }
  json["certified_max"] = std::isfinite(c.upper()) ? Json(c.upper()) : Json();
  json["mesh_to_reference"] = directed_json(c.there.surface);
  json["reference_to_mesh"] = directed_json(c.back.surface);
  return json;
}

std::string describe(const MeshComparison& c) {
  std::string text;
  const auto line = [&](const std::string& name, const std::string& value) {
    text += name + std::string(name.size() < 14 ? 14 - name.size() : 1, ' ') + value + "\n";
  };
  if (c.yes_or_no) {
    line("method", method_text(c.speed));
  } else {
    line("deviation", "mesh to reference: " + direction(c.there.surface, c.tolerance, c.max_distance));
    line("", "reference to mesh: " + direction(c.back.surface, c.tolerance, c.max_distance));
  }
  if (c.there.border.area > 0.0 || c.back.border.area > 0.0) {
    line("borders", "mesh to reference: " + direction(c.there.border, c.tolerance, c.max_distance));
    line("", "reference to mesh: " + direction(c.back.border, c.tolerance, c.max_distance));
  }
  if (!c.yes_or_no) {
    line("histogram", "share of area by distance in eighths of the tolerance, mesh to reference | back");
    line("", bars_text(c));
  }
  line("time", time_text(c));
  const std::string why = c.complaint(false);
  line("certificate", !why.empty() ? why
                      : c.yes_or_no
                          ? "proven: two-sided distance at most the tolerance, " + number_text(c.tolerance)
                          : "proven: two-sided distance at most " + bound_text(c.upper(), 6) +
                                ", tolerance " + number_text(c.tolerance));
  if (why.empty() && !c.borders_proven()) line("", c.complaint(true));
  return text;
}

}  // namespace tessera
