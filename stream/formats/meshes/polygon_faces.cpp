#include "stream/formats/meshes/polygon_faces.h"

#include <algorithm>

#include "kernels/mesh/polygon_triangulation.h"

namespace tessera {

void PolygonFaces::read_all() {
  read_ = true;
  std::vector<Double3> filling;
  std::uint64_t next = 0;
  bool spilled = false;
  const auto close_page = [&] {
    if (next == kPages) {  // what was kept so far is not kept for long
      for (const Page& page : pages_)
        file_.append(page.position.data(), page.position.size() * sizeof(Double3));
      spilled = true;
    }
    filling.resize(kPageVertices);
    if (spilled) {
      file_.append(filling.data(), filling.size() * sizeof(Double3));
    } else {
      pages_.push_back({next, filling});
    }
    filling.clear();
    ++next;
  };
  vertices_([&](std::span<const Double3> positions, std::span<const std::uint32_t>) {
    for (const Double3& p : positions) {
      filling.push_back(p);
      if (filling.size() == kPageVertices) close_page();
    }
  });
  if (!filling.empty()) close_page();
}

const Double3& PolygonFaces::at(std::uint64_t vertex) {
  const std::uint64_t number = vertex / kPageVertices;
  Page& page = pages_[number % kPages];
  if (page.number != number) {
    file_.read_at(number * kPageVertices * sizeof(Double3), page.position.data(),
                  kPageVertices * sizeof(Double3));
    page.number = number;
  }
  return page.position[vertex % kPageVertices];
}

void PolygonFaces::triangulate(std::span<const std::uint64_t> corners,
                               std::vector<std::array<std::uint64_t, 3>>& triangles) {
  if (!read_) read_all();
  polygon_.clear();
  for (const std::uint64_t v : corners) polygon_.push_back(at(v));
  triangles_.clear();
  if (!triangulate_polygon(polygon_, triangles_)) ++folded_;
  for (const auto& t : triangles_) {
    const std::array<std::uint64_t, 3> face = {corners[t[0]], corners[t[1]], corners[t[2]]};
    // There and back along one edge (a bridge that leads nowhere): no neighbour shares that.
    if (face[0] != face[1] && face[1] != face[2] && face[2] != face[0]) triangles.push_back(face);
  }
}

std::string PolygonFaces::warning() const {
  if (folded_ == 0) return {};
  return std::to_string(folded_) +
         (folded_ == 1 ? " face crosses itself, seen along its normal: its triangles overlap"
                       : " faces cross themselves, seen along their normals: their triangles overlap");
}

}  // namespace tessera
