/// \file ply_ranges.h
/// Where vertices and triangles of a binary PLY file lie, if all vertices are of one size and all triangles are: then any of them
/// can be read without those before.
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "stream/files/read_file.h"
#include "stream/formats/mesh_parts.h"
#include "stream/formats/ply_header.h"

namespace tessera {

class PlyRanges {
 public:
  /// \param vertex, faces     elements of the header
  /// \param indices           list of the faces: corners
  /// \param synthetic         property of the faces; -1 = none
  /// \returns none for text, for lists before or beside those of corners, and for a file too short for its vertices
  static std::optional<PlyRanges> find(const PlyHeader& header, const ReadFile& file, std::size_t vertex,
                                       std::size_t faces, std::size_t indices, int synthetic);

  /// The records of vertices [begin, end). \throws InputError
  void read_vertices(const ReadFile& file, std::uint64_t begin, std::uint64_t end,
                     std::vector<char>& bytes) const;
  /// As MeshRanges::read_face_range(). \throws InputError
  std::uint64_t read_triangles(const ReadFile& file, std::uint64_t begin, std::uint64_t end,
                               MeshFacePart& part) const;
  std::size_t triangle_bytes() const { return triangle_bytes_; }

 private:
  std::uint64_t vertex_begin_ = 0, face_begin_ = 0;  ///< bytes of the file
  std::size_t vertex_bytes_ = 0, triangle_bytes_ = 0;
  std::size_t list_at_ = 0, synthetic_at_ = 0;  ///< bytes of a triangle
  ScalarType count_type_ = ScalarType::kUint8, index_type_ = ScalarType::kUint32;
  std::optional<ScalarType> synthetic_type_;
  bool big_endian_ = false;
};

}  // namespace tessera
