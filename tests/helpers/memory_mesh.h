/// \file memory_mesh.h
/// Small meshes in memory behind the reader interface, and shapes whose topology is known.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/random.h"

namespace tessera::test {

class MemoryMesh : public MeshReader {
 public:
  MemoryMesh(std::vector<Double3> points, std::vector<MeshFace> faces, bool shared = true)
      : points_(std::move(points)), faces_(std::move(faces)), shared_(shared) {
    header_.vertices = points_.size();
    header_.faces = faces_.size();
    header_.double_positions = true;
  }
  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }
  bool shared_vertices() const override { return shared_; }
  void read_vertices(
      const std::function<void(std::span<const Double3>, std::span<const std::uint32_t>)>& sink) override {
    if (!points_.empty()) sink(points_, {});
  }
  void read_faces(const std::function<void(std::span<const MeshFace>)>& sink) override {
    if (!faces_.empty()) sink(faces_);
  }
  const std::vector<Double3>& points() const { return points_; }
  const std::vector<MeshFace>& faces() const { return faces_; }

 private:
  std::vector<Double3> points_;
  std::vector<MeshFace> faces_;
  bool shared_;
  MeshHeader header_;
  std::string format_ = "memory";
};

inline MemoryMesh tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
}

/// A torus of n x m vertices; `skip` faces are left out at the end.
inline MemoryMesh torus(std::uint64_t n, std::uint64_t m, std::size_t skip = 0) {
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  for (std::uint64_t i = 0; i < n; ++i) {
    for (std::uint64_t j = 0; j < m; ++j) {
      const double a = 6.283185307179586 * static_cast<double>(i) / static_cast<double>(n);
      const double b = 6.283185307179586 * static_cast<double>(j) / static_cast<double>(m);
      const double r = 3.0 + std::cos(b);
      points.push_back({r * std::cos(a), r * std::sin(a), std::sin(b)});
      const auto at = [&](std::uint64_t k, std::uint64_t l) { return (k % n) * m + l % m; };
      faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  faces.resize(faces.size() - skip);
  return {points, faces};
}

/// Every face with three vertices of its own.
inline MemoryMesh soup(const MemoryMesh& mesh) {
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  for (const MeshFace& face : mesh.faces()) {
    for (const std::uint64_t v : face) points.push_back(mesh.points()[v]);
    faces.push_back({points.size() - 3, points.size() - 2, points.size() - 1});
  }
  return {points, faces, false};
}

}  // namespace tessera::test
