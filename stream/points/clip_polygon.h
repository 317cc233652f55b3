/// \file clip_polygon.h
/// Polygons as seen from above, in the coordinates of the scan, e.g. the limits of a site. A point is inside when any of
/// them holds it: within its first ring and in none of the others, its holes. A ring holds what it winds around, either
/// way and however often (nonzero rule), so both halves of a bowtie are inside, and where a ring overlaps itself too.
/// Source: RFC 7946 (GeoJSON), of which coordinates are taken as they are; for rings that cross themselves, which it does
/// not know, the nonzero rule makes of one what the union makes of several.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tessera {

class ClipPolygon {
 public:
  /// Rings, polygon by polygon, of a GeoJSON file: Polygon, MultiPolygon, or a Feature, FeatureCollection or GeometryCollection of these, as
  /// the text that from_text() reads. \throws InputError naming the file and what is wrong
  static std::string text_of_file(const std::filesystem::path& path);
  /// \throws InputError when it is not such a text
  static ClipPolygon from_text(const std::string& polygons);

  bool holds(double x, double y) const;
  const std::array<double, 2>& min() const { return min_; }
  const std::array<double, 2>& max() const { return max_; }

 private:
  using Corner = std::array<double, 2>;
  struct Edge {
    Corner low, high;       ///< low[1] < high[1]
    std::uint32_t polygon;  ///< ascending over the edges
    std::uint32_t ring;     ///< of all polygons; ascending too
    bool hole;
    std::int8_t direction;  ///< of the ring along it: 1 upwards, -1 downwards
  };
  std::size_t band(double y) const;
  void sort_into_bands();

  std::array<double, 2> min_{}, max_{};
  std::vector<Edge> edges_;
  std::vector<std::uint32_t> in_band_;  ///< edges, ascending, band by band: of even height, as many as edges
  std::vector<std::size_t> first_;      ///< per band, in in_band_; one more at the end
};

}  // namespace tessera
