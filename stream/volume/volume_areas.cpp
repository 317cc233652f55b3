#include "stream/volume/volume_areas.h"

#include <algorithm>

#include "stream/files/json.h"

namespace tessera {

double VolumeArea::plan_area() const {
  double sum = 0.0;
  for (const SignedTriangle& t : triangles) sum += t.sign * PlanPiece(t.corner).area();
  return sum;
}

std::vector<VolumeArea> read_areas(const std::filesystem::path& path, const Double2& origin) {
  std::vector<VolumeArea> areas;
  std::size_t n = 0;
  for (const Json& polygon : parse_json(ClipPolygon::text_of_file(path))) {
    VolumeArea area;
    area.name = std::to_string(++n);
    area.polygon = ClipPolygon::from_text(dump_json(Json::array({polygon})));
    for (const Json& ring : polygon) {
      std::vector<Double2>& to = area.rings.emplace_back();
      for (const Json& c : ring) {
        const Double2 at = {c[0].get<double>() - origin[0], c[1].get<double>() - origin[1]};
        if (to.empty() || to.back() != at) to.push_back(at);
      }
      while (to.size() > 1 && to.front() == to.back()) to.pop_back();
      for (std::size_t k = 0; k < to.size(); ++k) area.edges.push_back({to[k], to[(k + 1) % to.size()]});
      for (const Double2& p : to) area.box.add(p);
    }
    area.triangles = triangles_of_rings(area.rings);
    areas.push_back(std::move(area));
  }
  return areas;
}

AreaWindow::AreaWindow(const VolumeArea& area, const PlanBox& window, const Double3& origin)
    : area_(&area), origin_(origin) {
  if (!area.box.meets(window)) return;
  for (std::uint32_t e = 0; e < area.edges.size(); ++e)
    if (box_of(area.edges[e]).meets(window)) edges_.push_back(e);
}

FacePlace AreaWindow::place_of(const PlanFace& face) const {
  if (!area_->box.meets(face.box)) return FacePlace::kOutside;
  if (std::any_of(edges_.begin(), edges_.end(),
                  [&](std::uint32_t e) { return box_of(area_->edges[e]).meets(face.box); }))
    return FacePlace::kAcross;
  const Double2& at = face.triangle.shadow()[0];
  return area_->polygon->holds(at[0] + origin_[0], at[1] + origin_[1]) ? FacePlace::kInside
                                                                       : FacePlace::kOutside;
}

std::vector<AreaWindow> windows_of(const std::vector<VolumeArea>& areas, const std::vector<PlanFace>& faces,
                                   const Double3& origin) {
  PlanBox box;
  for (const PlanFace& f : faces) box.add(f.box.low), box.add(f.box.high);
  std::vector<AreaWindow> windows;
  windows.reserve(areas.size());
  for (const VolumeArea& area : areas) windows.emplace_back(area, box, origin);
  return windows;
}

}  // namespace tessera
