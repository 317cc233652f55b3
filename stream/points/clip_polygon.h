/// \file clip_polygon.h
/// Polygons as seen from above, in the coordinates of the scan, e.g. the limits of a site. A point is inside when a ray
/// from it crosses the rings an odd number of times: holes and islands in them need no order.
/// Source: RFC 7946 (GeoJSON), of which coordinates are taken as they are.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tessera {

class ClipPolygon {
 public:
  /// Rings of a GeoJSON file: Polygon, MultiPolygon, or a Feature, FeatureCollection or GeometryCollection of these, as
  /// the text that from_text() reads. \throws InputError naming the file and what is wrong
  static std::string text_of_file(const std::filesystem::path& path);
  /// \throws InputError when it is not such a text
  static ClipPolygon from_text(const std::string& rings);

  bool holds(double x, double y) const;
  const std::array<double, 2>& min() const { return min_; }
  const std::array<double, 2>& max() const { return max_; }

 private:
  using Corner = std::array<double, 2>;
  struct Edge {
    Corner low, high;  ///< low[1] < high[1]
  };
  std::size_t band(double y) const;

  std::array<double, 2> min_{}, max_{};
  std::vector<Edge> edges_;
  std::vector<std::uint32_t> in_band_;  ///< edges, band by band: of even height, as many as edges
  std::vector<std::size_t> first_;      ///< per band, in in_band_; one more at the end
};

}  // namespace tessera
