/// \file texture_colours.h
/// Colours of new textures from those that a mesh file has: a point at every texel that a face shows.
#pragma once
#include <filesystem>
#include <memory>

#include "stream/stages/bake/bake_colours.h"

namespace tessera {

/// Whether the file has texture coordinates, and all pages that it names. \throws InputError as open_textures()
bool has_textures(const std::filesystem::path& mesh);

/// Vertices of the file are in memory while it is read, faces of one page after the other.
/// \throws InputError as open_textures(), for polygons, and for pages that are not there
std::unique_ptr<BakeColours> colours_of_textures(const std::filesystem::path& mesh, const JobState& state);

}  // namespace tessera
