/// \file polygon_faces.h
/// What a reader needs to cut polygons into triangles: positions of vertices by their number, in bounded memory, and a
/// count of the polygons that have no triangulation.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/files/spill_file.h"

namespace tessera {

class PolygonFaces {
 public:
  /// Hands out all vertices in order, in batches.
  using Source = std::function<void(
      const std::function<void(std::span<const Double3>, std::span<const std::uint32_t>)>& sink)>;

  /// \param vertices  is read at the first polygon that is no triangle, once
  /// \param temp      folder for positions beyond kMemoryBytes; empty = the system's
  PolygonFaces(Source vertices, const std::filesystem::path& temp)
      : vertices_(std::move(vertices)), file_(temp) {}

  static constexpr std::uint64_t kMemoryBytes = std::uint64_t{8} << 20;

  /// Begins a reading of the faces: counts start anew.
  void begin() { folded_ = 0; }
  /// Appends the triangles of a polygon, by number of vertex: n - 2, less those that name a vertex twice.
  /// \pre every corner is a vertex; 4 <= corners.size() <= kMaxPolygonCorners
  void triangulate(std::span<const std::uint64_t> corners,
                   std::vector<std::array<std::uint64_t, 3>>& triangles);
  /// One sentence about polygons that cross themselves, empty where there was none.
  std::string warning() const;

 private:
  static constexpr std::uint64_t kPageVertices = 1024;
  static constexpr std::uint64_t kPages = kMemoryBytes / (kPageVertices * sizeof(Double3));
  struct Page {
    std::uint64_t number = ~std::uint64_t{0};
    std::vector<Double3> position;
  };

  void read_all();
  const Double3& at(std::uint64_t vertex);

  Source vertices_;
  SpillFile file_;
  std::vector<Page> pages_;  ///< page n in slot n % kPages
  bool read_ = false;
  std::uint64_t folded_ = 0;
  std::vector<Double3> polygon_;                         ///< scratch
  std::vector<std::array<std::uint32_t, 3>> triangles_;  ///< scratch
};

}  // namespace tessera
