/// \file mesh_parts.h
/// Meshes on disk in parts: what readers and writers of records of one size can do beside mesh_io.h, on any threads at once. Who
/// has a reader or a writer asks for it by dynamic_cast.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

using MeshFace = std::array<std::uint64_t, 3>;  // of mesh_io.h

/// Vertices on their way from a file or to one: as the mesh has them, and as the file does.
struct MeshVertexPart {
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;  ///< as many, if the header says colour
  std::vector<char> bytes;
  Double3 moved = {0, 0,
                   0};  ///< how far along each axis the file's numbers lie from them at most; of encode()
};
struct MeshFacePart {
  std::vector<MeshFace> faces;
  std::vector<std::uint8_t> synthetic;  ///< as many, if the header says so
  std::vector<char> bytes;
  std::size_t beyond = ~std::size_t{0};  ///< the first that names no vertex of the header; of encode()
};

/// Of a MeshReader (binary PLY and STL).
class MeshRanges {
 public:
  virtual ~MeshRanges() = default;
  /// Whether this file can be read in ranges; the counts of its header are true then. What is below has it as precondition.
  virtual bool has_ranges() const = 0;
  /// Vertices [begin, end).
  virtual void read_vertex_range(std::uint64_t begin, std::uint64_t end, MeshVertexPart& part) const = 0;
  /// Faces [begin, end) up to the first that is no triangle; returns its number, or `end`. Indices are those of the file,
  /// unchecked. Where one before `begin` is no triangle, what comes is of no use.
  virtual std::uint64_t read_face_range(std::uint64_t begin, std::uint64_t end, MeshFacePart& part) const = 0;
  /// MeshReader::read_flagged_faces() from one on. \pre all before it are triangles
  virtual void read_faces_from(
      std::uint64_t first,
      const std::function<void(std::span<const MeshFace>, std::span<const std::uint8_t>)>& sink) = 0;
};

/// Of a MeshWriter (PLY).
class MeshPartWriter {
 public:
  virtual ~MeshPartWriter() = default;
  /// Makes the bytes of a part and looks for what append() refuses, on any thread.
  virtual void encode(MeshVertexPart& part) const = 0;
  virtual void encode(MeshFacePart& part) const = 0;
  /// As vertices() and faces() of the writer, of a part that was encoded, in order; then digest() in the same order, from any one
  /// thread, beside append() of later parts. \pre of whatever else is called: all of them have gone through digest()
  virtual void append(const MeshVertexPart& part) = 0;
  virtual void append(const MeshFacePart& part) = 0;
  virtual void digest(std::span<const char> bytes) = 0;
};

}  // namespace tessera
