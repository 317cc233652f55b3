#include "stream/survey/pages/area_sketch.h"

#include <algorithm>
#include <string>
#include <vector>

#include "kernels/picture/caption.h"
#include "stream/files/json.h"
#include "stream/points/clip_polygon.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxLabels = 60;  // more would hide each other

using Ring = std::vector<Double2>;

std::vector<std::vector<Ring>> read_rings(const std::filesystem::path& areas) {
  std::vector<std::vector<Ring>> polygons;
  const Json all = parse_json(ClipPolygon::text_of_file(areas));
  for (const Json& polygon : all) {
    polygons.emplace_back();
    for (const Json& ring : polygon) {
      polygons.back().emplace_back();
      for (const Json& c : ring) polygons.back().back().push_back({c[0].get<double>(), c[1].get<double>()});
    }
  }
  return polygons;
}

}  // namespace

PageDrawing area_sketch(const std::filesystem::path& areas) {
  const std::vector<std::vector<Ring>> polygons = read_rings(areas);
  Double2 low{}, high{};
  bool first = true;
  for (const auto& rings : polygons)
    for (const Ring& ring : rings)
      for (const Double2& p : ring) {
        for (std::size_t a = 0; a < 2; ++a)
          low[a] = first ? p[a] : std::min(low[a], p[a]), high[a] = first ? p[a] : std::max(high[a], p[a]);
        first = false;
      }
  PageDrawing out{
      "Polygons from above", {{"polygons", with_commas(polygons.size())}}, PlanDrawing(low, high, "x", "y")};
  const std::size_t every = (polygons.size() + kMaxLabels - 1) / kMaxLabels;
  for (std::size_t i = 0; i < polygons.size(); ++i) {
    for (const Ring& ring : polygons[i])
      out.drawing.add(ring, true, &ring == &polygons[i].front() ? DrawnLine::kArea : DrawnLine::kOutline);
    const Ring& outer = polygons[i].front();
    if (outer.empty() || i % every != 0) continue;
    Double2 min = outer.front(), max = min;
    for (const Double2& p : outer)
      for (std::size_t a = 0; a < 2; ++a) min[a] = std::min(min[a], p[a]), max[a] = std::max(max[a], p[a]);
    out.drawing.label({0.5 * (min[0] + max[0]), 0.5 * (min[1] + max[1])}, std::to_string(i + 1));
  }
  return out;
}

}  // namespace tessera
