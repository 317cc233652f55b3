/// \file mesh_textures.h
/// What is true of the textures of a mesh file: coordinates within their page, none flipped, none over another, pages there.
/// Faces of one page at a time are in memory; the others wait on disk.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stream/files/json.h"

namespace tessera {

struct MeshTextures {
  std::uint64_t faces = 0;
  std::uint64_t bare = 0;         ///< without texture
  std::uint64_t outside = 0;      ///< with a corner beyond 0 or 1, or that is no number
  std::uint64_t flipped = 0;      ///< run clockwise, v up
  std::uint64_t overlapping = 0;  ///< lie over faces before them, on their page
  std::uint64_t lost = 0;         ///< on a page that the file does not name
  std::uint64_t pages = 0;
  std::vector<std::string> missing_pages;  ///< not there, or neither PNG nor JPEG
  double used_share = 0.0;                 ///< of the area of the pages that faces take; overlaps count again

  /// One sentence per kind of defect.
  std::vector<std::string> defects() const;
};

struct MeshTexturesOptions {
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  std::filesystem::path temp;
  std::function<void()> check_stop;  ///< may be empty
};

/// \returns nothing for a file without texture coordinates
/// \throws InputError as open_textures(); ResourceError where the cap does not hold the faces of a page
std::optional<MeshTextures> check_textures(const std::filesystem::path& mesh,
                                           const MeshTexturesOptions& options);

Json to_json(const MeshTextures& textures);
std::string describe(const MeshTextures& textures);  ///< a line for people

}  // namespace tessera
