/// \file volume_areas.h
/// The areas that volumes are asked of: polygons seen from above, relative to an origin, and which faces lie in them.
#pragma once
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "kernels/mesh/prism_volume.h"
#include "stream/points/clip_polygon.h"
#include "stream/volume/plan_faces.h"

namespace tessera {

struct VolumeArea {
  std::string name;                         ///< its number in the file, from 1
  std::vector<std::vector<Double2>> rings;  ///< open, the outline first, no corner twice in a row
  std::vector<SignedTriangle> triangles;
  std::vector<std::array<Double2, 2>> edges;  ///< of all rings, in order
  std::optional<ClipPolygon> polygon;         ///< in the coordinates of the mesh
  PlanBox box;
  double plan_area() const;
};

/// Polygons of a GeoJSON file. \throws InputError
std::vector<VolumeArea> read_areas(const std::filesystem::path& path, const Double2& origin);

enum class FacePlace : std::uint8_t { kOutside, kInside, kAcross };

/// An area as faces of one window see it.
class AreaWindow {
 public:
  AreaWindow(const VolumeArea& area, const PlanBox& window, const Double3& origin);
  /// Of a face of the window. By boxes of edges: some faces that come near an edge count as across.
  FacePlace place_of(const PlanFace& face) const;
  const VolumeArea& area() const { return *area_; }
  /// Edges of the area that may meet the window, by position.
  const std::vector<std::uint32_t>& edges() const { return edges_; }

 private:
  const VolumeArea* area_;
  Double3 origin_;
  std::vector<std::uint32_t> edges_;
};
std::vector<AreaWindow> windows_of(const std::vector<VolumeArea>& areas, const std::vector<PlanFace>& faces,
                                   const Double3& origin);

}  // namespace tessera
