/// \file texture_image.h
/// Pictures of textures: PNG and JPEG, in a file of their own or within one.
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "stream/files/read_file.h"

namespace tessera {

struct TextureSize {
  std::uint32_t width = 0, height = 0;  ///< texels
};
/// By the header; nothing where the bytes are neither kind of picture.
std::optional<TextureSize> texture_size(const ReadFile& file, std::uint64_t offset, std::uint64_t bytes);

struct TextureImage {
  TextureSize size;
  std::vector<std::uint8_t> rgb;  ///< rows from the top
};
/// Memory of reading: the file's bytes, the picture, a decoder.
std::uint64_t texture_image_bytes(const TextureSize& size, std::uint64_t bytes);
/// \throws InputError for what is damaged, or neither kind of picture
TextureImage read_texture_image(const ReadFile& file, std::uint64_t offset, std::uint64_t bytes);

}  // namespace tessera
