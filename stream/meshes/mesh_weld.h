/// \file mesh_weld.h
/// A mesh with its vertices merged by exact position, for formats that store triangles without shared
/// vertices. Out of core: positions are sorted under a byte budget. Vertices come out in the order of their
/// coordinates.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>

#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/vertex_store.h"

namespace tessera {

struct WeldOptions {
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  std::filesystem::path temp;
  std::function<void()> check_stop;  ///< may be empty
};

class WeldedMesh : public MeshReader {
 public:
  /// Reads all vertices of `source`, which must outlive this. -0 and 0 are equal; colours are dropped.
  /// \throws ResourceError when faces share vertices and their numbers exceed a quarter of the budget (8
  /// bytes each)
  WeldedMesh(MeshReader& source, const WeldOptions& options);

  std::uint64_t source_vertices() const { return source_vertices_; }
  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return source_->format(); }
  void read_vertices(
      const std::function<void(std::span<const Double3>, std::span<const std::uint32_t>)>& sink) override;
  void read_faces(const std::function<void(std::span<const MeshFace>)>& sink) override;

 private:
  template <class Bits, class Index>
  void weld(const WeldOptions& options);
  std::uint64_t new_number(std::uint64_t vertex);

  MeshReader* source_;
  MeshHeader header_;
  std::uint64_t source_vertices_ = 0;
  VertexStore positions_;
  SpillFile numbers_;                ///< 8 bytes per source vertex: its number here
  std::vector<std::uint64_t> page_;  ///< the numbers at hand
  std::uint64_t page_begin_ = 0;
};

}  // namespace tessera
