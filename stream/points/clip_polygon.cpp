#include "stream/points/clip_polygon.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <limits>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/formats/geojson.h"

namespace tessera {
namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{64} << 20;
constexpr std::size_t kMaxCorners = 200000;
constexpr std::size_t kMaxBands = std::size_t{1} << 16;

/// The polygons of an object, each a list of rings; what is no area has none.
Json polygons_of(const Json& object) {
  Json polygons = Json::array();
  const auto add = [&](const Json& polygon) {
    if (polygon.is_array() && !polygon.empty()) polygons.push_back(polygon);
  };
  for_geometries(object, [&](const std::string& type, const Json& coordinates) {
    if (type == "Polygon") add(coordinates);
    if (type == "MultiPolygon" && coordinates.is_array())
      for (const Json& polygon : coordinates) add(polygon);
  });
  return polygons;
}

}  // namespace

std::string ClipPolygon::text_of_file(const std::filesystem::path& path) {
  const std::string name = path.string();
  const ReadFile file(path);
  if (file.size() > kMaxBytes) throw InputError(name + ": is too large for a polygon to clip by");
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  file.read_at(0, text.data(), text.size());
  try {
    const Json root = try_parse_json(text);
    if (root.is_discarded()) throw InputError("is not JSON");
    Json polygons = polygons_of(root);
    if (polygons.empty()) throw InputError("holds no Polygon or MultiPolygon");
    // Two numbers a corner are kept, whatever else a corner says.
    for (Json& polygon : polygons)
      for (Json& ring : polygon) {
        if (!ring.is_array()) throw InputError("a ring is no list of corners");
        Json corners = Json::array();
        for (const Json& c : ring) corners.push_back(corner_of_geometry(c));
        ring = std::move(corners);
      }
    text = dump_json(polygons);
    from_text(text);
  } catch (const InputError& e) {
    throw InputError(name + ": " + e.what() + "; --clip wants GeoJSON in the coordinates of the scan");
  } catch (const JsonError&) {
    throw InputError(name + ": is no GeoJSON; --clip wants that, in the coordinates of the scan");
  }
  return text;
}

ClipPolygon ClipPolygon::from_text(const std::string& text) {
  const Json polygons = try_parse_json(text);
  if (!polygons.is_array()) throw InputError("the rings of a polygon are damaged");
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  ClipPolygon p;
  p.min_ = {kInfinite, kInfinite};
  p.max_ = {-kInfinite, -kInfinite};
  std::size_t corners = 0;
  std::uint32_t number = 0, ring_number = 0;
  for (const Json& polygon : polygons) {
    if (!polygon.is_array()) throw InputError("the rings of a polygon are damaged");
    bool hole = false;
    for (const Json& ring : polygon) {
      if (!ring.is_array() || ring.size() < 3) throw InputError("a ring has fewer than three corners");
      corners += ring.size();
      if (corners > kMaxCorners)
        throw InputError("has more than " + std::to_string(kMaxCorners) + " corners; simplify it");
      Corner before = corner_of_geometry(ring.back());
      for (const Json& c : ring) {
        const Corner at = corner_of_geometry(c);
        for (std::size_t a = 0; a < 2; ++a) {
          p.min_[a] = std::min(p.min_[a], at[a]);
          p.max_[a] = std::max(p.max_[a], at[a]);
        }
        if (before[1] < at[1]) p.edges_.push_back({before, at, number, ring_number, hole, 1});
        if (at[1] < before[1]) p.edges_.push_back({at, before, number, ring_number, hole, -1});
        before = at;
      }
      ++ring_number;
      hole = true;
    }
    ++number;
  }
  if (p.edges_.empty()) throw InputError("the polygon has no area");
  p.sort_into_bands();
  return p;
}

void ClipPolygon::sort_into_bands() {
  const std::size_t bands = std::min(edges_.size(), kMaxBands);
  first_.assign(bands + 1, 0);
  const auto for_bands = [&](const Edge& e, const auto& use) {
    for (std::size_t b = band(e.low[1]); b <= band(e.high[1]); ++b) use(b);
  };
  for (const Edge& e : edges_) for_bands(e, [&](std::size_t b) { ++first_[b + 1]; });
  for (std::size_t b = 0; b < bands; ++b) first_[b + 1] += first_[b];
  if (first_[bands] > std::size_t{64} * kMaxCorners) throw InputError("has too many long edges; simplify it");
  in_band_.resize(first_[bands]);
  std::vector<std::size_t> next = first_;
  for (std::uint32_t i = 0; i < edges_.size(); ++i)
    for_bands(edges_[i], [&](std::size_t b) { in_band_[next[b]++] = i; });
}

std::size_t ClipPolygon::band(double y) const {
  const std::size_t bands = first_.size() - 1;
  const double t = (y - min_[1]) / (max_[1] - min_[1]) * static_cast<double>(bands);
  return std::min(static_cast<std::size_t>(std::max(t, 0.0)), bands - 1);
}

bool ClipPolygon::holds(double x, double y) const {
  if (!(x >= min_[0] && x <= max_[0] && y >= min_[1] && y <= max_[1])) return false;
  bool inside = false;  // the polygon at hand, by its rings so far
  int winding = 0;      // of the ring at hand
  const Edge* last = nullptr;
  const auto end_ring = [&] {
    if (winding != 0) inside = !last->hole;
    winding = 0;
  };
  const std::size_t b = band(y);
  for (std::size_t k = first_[b]; k < first_[b + 1]; ++k) {
    const Edge& e = edges_[in_band_[k]];
    // Half open, so that a ray through a corner crosses one of the two edges there.
    if (y < e.low[1] || y >= e.high[1]) continue;
    if (last != nullptr && last->ring != e.ring) {
      end_ring();
      if (last->polygon != e.polygon) {
        if (inside) return true;
        inside = false;
      }
    }
    last = &e;
    const double at = e.low[0] + (y - e.low[1]) / (e.high[1] - e.low[1]) * (e.high[0] - e.low[0]);
    if (x < at) winding += e.direction;
  }
  if (last != nullptr) end_ring();
  return inside;
}

}  // namespace tessera
