/// \file corner_file.h
/// The corners of all faces of a mesh in one temporary file, for meshes whose vertices do not fit in memory.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>

#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

/// Positions relative to the origin given to build().
struct Corner {
  float x = 0.0f, y = 0.0f, z = 0.0f;
  std::uint32_t rgba = 0;
};
static_assert(sizeof(Corner) == 16);

class CornerFile {
 public:
  /// Creates an unnamed file in `folder`: it is gone when the object is, or the process.
  /// \throws ResourceError when it cannot be created
  explicit CornerFile(const std::filesystem::path& folder);
  ~CornerFile();
  CornerFile(const CornerFile&) = delete;
  CornerFile& operator=(const CornerFile&) = delete;

  /// Gathers three corners per face, 48 bytes, in ceil(vertices * 16 / memory_bytes) passes over the mesh.
  /// \throws what the reader throws; ResourceError when the disk is full
  void build(const std::filesystem::path& mesh, std::uint64_t vertices, const Double3& origin,
             std::uint64_t memory_bytes);
  std::uint64_t faces() const { return faces_; }
  std::uint64_t bytes() const { return faces_ * 3 * sizeof(Corner); }
  /// All corners in face order, in batches of whole faces.
  void read(const std::function<void(std::span<const Corner>)>& sink) const;

 private:
  std::filesystem::path folder_;
  int fd_ = -1;
  std::uint64_t faces_ = 0;
};

}  // namespace tessera
