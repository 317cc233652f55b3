/// \file texture_colours.h
/// Colours of new textures from those that a mesh file has: a point at every texel that a face shows.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>

#include "stream/stages/bake/bake_colours.h"

namespace tessera {

/// Whether the file has texture coordinates, and all pages that it names. \throws InputError as open_textures()
bool has_textures(const std::filesystem::path& mesh);

/// What the pages that a file names hold, by their headers; zeros where it has none, or they are not there.
struct PagesSize {
  std::uint64_t texels = 0;       ///< of all
  std::uint64_t image_bytes = 0;  ///< of memory, while the largest is read
};
/// \throws InputError as open_textures()
PagesSize size_of_pages(const std::filesystem::path& mesh);

/// What colours_of_textures() holds at most. \param vertices  of the mesh
std::uint64_t texture_colours_bytes(std::uint64_t vertices, const RunOptions& run, const PagesSize& pages);

/// Vertices of the file are in memory while it is read, faces of one page after the other.
/// \throws InputError as open_textures(), for polygons, and for pages that are not there
std::unique_ptr<BakeColours> colours_of_textures(const std::filesystem::path& mesh, const JobState& state);

}  // namespace tessera
