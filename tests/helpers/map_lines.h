/// \file map_lines.h
/// Whether the lines of a map are as a map's should be: none crosses another one or itself, none dangles.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "kernels/mesh/orientation_sign.h"
#include "stream/files/json.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::test {

struct MapLine {
  double level = 0.0;
  bool closed = false;  ///< then the first point is not repeated
  std::vector<Double2> points;
};

/// Of a GeoJSON file with a line in every text line of its own, as GDAL writes it: read one by one, for files of any size.
inline std::vector<MapLine> read_map_lines(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<MapLine> lines;
  for (std::string text; std::getline(file, text);) {
    if (text.find("\"LineString\"") == std::string::npos) continue;
    if (text.back() == ',') text.pop_back();
    const Json feature = parse_json(text);
    MapLine line;
    line.level = feature.at("properties").at("elevation").get<double>();
    line.closed = feature.at("properties").at("closed") == 1;
    for (const Json& p : feature.at("geometry").at("coordinates"))
      line.points.push_back({p[0].get<double>(), p[1].get<double>()});
    if (line.closed) line.points.pop_back();
    lines.push_back(std::move(line));
  }
  return lines;
}

/// Pairs of segments that have a point in common, but for neighbours in one line that share theirs; exact.
/// \param same_level_touches  out: those of one level that touch in a vertex of both, which a mesh with a vertex at the level has
inline std::uint64_t crossing_pairs(const std::vector<MapLine>& lines, std::uint64_t& same_level_touches) {
  struct Segment {
    std::size_t line, at;
    Double2 a, b;
  };
  std::vector<Segment> all;
  Double2 low = {1e300, 1e300}, high = {-1e300, -1e300};
  double length = 0.0;
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const auto& p = lines[l].points;
    for (std::size_t k = 0; k + (lines[l].closed ? 0 : 1) < p.size(); ++k) {
      all.push_back({l, k, p[k], p[(k + 1) % p.size()]});
      for (std::size_t c = 0; c < 2; ++c) {
        low[c] = std::min(low[c], p[k][c]), high[c] = std::max(high[c], p[k][c]);
        length += std::abs(all.back().a[c] - all.back().b[c]);
      }
    }
  }
  const double cell =
      std::max(2.0 * length / static_cast<double>(std::max<std::size_t>(1, all.size())), 1e-12);
  struct Entry {
    std::int64_t cell;
    std::uint32_t segment;
  };
  std::vector<Entry> entries;
  const auto index = [&](double x, std::size_t c) { return static_cast<std::int64_t>((x - low[c]) / cell); };
  for (std::uint32_t s = 0; s < all.size(); ++s)
    for (auto y = index(std::min(all[s].a[1], all[s].b[1]), 1);
         y <= index(std::max(all[s].a[1], all[s].b[1]), 1); ++y)
      for (auto x = index(std::min(all[s].a[0], all[s].b[0]), 0);
           x <= index(std::max(all[s].a[0], all[s].b[0]), 0); ++x)
        entries.push_back({y * (std::int64_t{1} << 31) + x, s});
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
    return a.cell != b.cell ? a.cell < b.cell : a.segment < b.segment;
  });
  std::uint64_t pairs = 0;
  same_level_touches = 0;
  for (std::size_t i = 0; i < entries.size(); ++i)
    for (std::size_t j = i + 1; j < entries.size() && entries[j].cell == entries[i].cell; ++j) {
      const Segment &s = all[entries[i].segment], &t = all[entries[j].segment];
      if (std::max(s.a[0], s.b[0]) < std::min(t.a[0], t.b[0]) ||
          std::max(t.a[0], t.b[0]) < std::min(s.a[0], s.b[0]) ||
          std::max(s.a[1], s.b[1]) < std::min(t.a[1], t.b[1]) ||
          std::max(t.a[1], t.b[1]) < std::min(s.a[1], s.b[1]))
        continue;
      if (orient2d_sign(s.a, s.b, t.a) * orient2d_sign(s.a, s.b, t.b) > 0 ||
          orient2d_sign(t.a, t.b, s.a) * orient2d_sign(t.a, t.b, s.b) > 0)
        continue;
      const std::size_t n = lines[s.line].points.size();
      const bool neighbours = s.line == t.line && ((s.at + 1) % n == t.at || (t.at + 1) % n == s.at);
      if (neighbours) continue;
      const bool vertex = s.a == t.a || s.a == t.b || s.b == t.a || s.b == t.b;
      if (vertex && lines[s.line].level == lines[t.line].level)
        ++same_level_touches;
      else
        ++pairs;
    }
  return pairs;
}

}  // namespace tessera::test
