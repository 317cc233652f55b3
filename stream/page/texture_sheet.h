/// \file texture_sheet.h
/// The pages of textures of a mesh file side by side, small.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

namespace tessera {

/// PNG of the first pages that are there, means of their texels, the pages in rows; empty for a file without textures.
/// \param scratch  folder for a file that goes again \param memory_bytes  pages that do not fit are left out
/// \throws InputError as open_textures()
std::string texture_sheet(const std::filesystem::path& mesh, const std::filesystem::path& scratch,
                          std::uint64_t memory_bytes);

}  // namespace tessera
