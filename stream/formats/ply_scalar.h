/// \file ply_scalar.h
/// A number that every vertex of a PLY file has beside what readers of points and meshes take, with its position.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "octree/vector.h"
#include "stream/files/read_file.h"
#include "stream/formats/ply_header.h"

namespace tessera {

class PlyScalar {
 public:
  /// None where the file is no binary PLY that begins with vertices of one size, or they have no such property.
  /// \throws InputError for a header that cannot be understood, or vertices that the file does not hold
  static std::optional<PlyScalar> open(const std::filesystem::path& path, std::string_view name);

  std::uint64_t count() const { return count_; }
  bool has_faces() const { return has_faces_; }
  /// All vertices in order, in batches. \throws InputError
  void read(const std::function<void(std::span<const Double3>, std::span<const double>)>& sink) const;

 private:
  struct Column {
    ScalarType type = ScalarType::kFloat32;
    std::size_t offset = 0;
  };
  explicit PlyScalar(ReadFile file) : file_(std::move(file)) {}

  ReadFile file_;
  std::uint64_t begin_ = 0, count_ = 0;
  std::size_t stride_ = 0;
  bool has_faces_ = false, big_endian_ = false;
  std::array<Column, 4> columns_;  ///< x, y, z and the number
};

}  // namespace tessera
