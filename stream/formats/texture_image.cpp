#include "stream/formats/texture_image.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>

#include <png.h>

#include "octree/error.h"
#include "stream/formats/jpeg_leave.h"

namespace tessera {
namespace {

constexpr std::array<unsigned char, 8> kPngSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::uint64_t kMaxJpegMarkers = 4096;
constexpr std::uint64_t kDecoderBytes = std::uint64_t{4} << 20;

std::uint32_t big_endian(const unsigned char* p, std::size_t bytes) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < bytes; ++i) value = value << 8 | p[i];
  return value;
}

/// Markers up to the one that tells the size (SOF0 to SOF15).
std::optional<TextureSize> jpeg_size(const ReadFile& file, std::uint64_t offset, std::uint64_t bytes) {
  std::uint64_t at = 2;
  for (std::uint64_t marker = 0; marker < kMaxJpegMarkers && at + 9 <= bytes; ++marker) {
    std::array<unsigned char, 9> head{};
    file.read_at(offset + at, head.data(), head.size());
    if (head[0] != 0xff) return std::nullopt;
    const unsigned char kind = head[1];
    if (kind >= 0xc0 && kind <= 0xcf && kind != 0xc4 && kind != 0xc8 && kind != 0xcc)
      return TextureSize{big_endian(&head[7], 2), big_endian(&head[5], 2)};
    at += 2 + (kind == 0xff ? 0 : big_endian(&head[2], 2));
    if (kind == 0xff) --at;
  }
  return std::nullopt;
}

bool decode_png(const std::vector<unsigned char>& bytes, TextureImage& image) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()) == 0) return false;
  png.format = PNG_FORMAT_RGB;
  if (png.width != image.size.width || png.height != image.size.height) {
    png_image_free(&png);
    return false;
  }
  const png_color black{0, 0, 0};  // what transparent texels lie on
  image.rgb.resize(PNG_IMAGE_SIZE(png));
  return png_image_finish_read(&png, &black, image.rgb.data(), 0, nullptr) != 0;
}

/// Only plain data lives in this frame, so that longjmp skips no destructor. False when libjpeg gave up.
bool decode_jpeg(const unsigned char* bytes, unsigned long count, const TextureSize& size,
                 unsigned char* rgb) {
  jpeg_decompress_struct jpeg;
  JpegLeave leave;
  jpeg.err = leave.manager();
  if (setjmp(leave.to) != 0) {
    jpeg_destroy_decompress(&jpeg);
    return false;
  }
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, bytes, count);
  jpeg_read_header(&jpeg, TRUE);
  jpeg.out_color_space = JCS_RGB;
  jpeg.dct_method = JDCT_ISLOW;
  jpeg_start_decompress(&jpeg);
  const bool fits =
      jpeg.output_width == size.width && jpeg.output_height == size.height && jpeg.output_components == 3;
  while (fits && jpeg.output_scanline < jpeg.output_height) {
    JSAMPROW row = rgb + std::size_t{3} * size.width * jpeg.output_scanline;
    jpeg_read_scanlines(&jpeg, &row, 1);
  }
  if (fits) jpeg_finish_decompress(&jpeg);
  jpeg_destroy_decompress(&jpeg);
  return fits;
}

}  // namespace

std::optional<TextureSize> texture_size(const ReadFile& file, std::uint64_t offset, std::uint64_t bytes) {
  std::array<unsigned char, 24> head{};
  if (bytes < head.size() || offset + bytes > file.size()) return std::nullopt;
  file.read_at(offset, head.data(), head.size());
  std::optional<TextureSize> size;
  if (std::equal(kPngSignature.begin(), kPngSignature.end(), head.begin()))
    size = TextureSize{big_endian(&head[16], 4), big_endian(&head[20], 4)};
  if (head[0] == 0xff && head[1] == 0xd8) size = jpeg_size(file, offset, bytes);
  if (size && (size->width == 0 || size->height == 0)) return std::nullopt;
  return size;
}

std::uint64_t texture_image_bytes(const TextureSize& size, std::uint64_t bytes) {
  return bytes + std::uint64_t{size.width} * size.height * 4 + kDecoderBytes;
}

TextureImage read_texture_image(const ReadFile& file, std::uint64_t offset, std::uint64_t bytes) {
  const std::optional<TextureSize> size = texture_size(file, offset, bytes);
  const std::string where = file.path().string() + ": byte " + std::to_string(offset);
  if (!size) throw InputError(where + ": the picture of a texture is neither PNG nor JPEG");
  std::vector<unsigned char> packed(bytes);
  file.read_at(offset, packed.data(), bytes);
  TextureImage image{*size, {}};
  const bool is_png = packed[0] == kPngSignature[0];
  if (!is_png) image.rgb.resize(std::size_t{3} * size->width * size->height);
  const bool good =
      is_png ? decode_png(packed, image) : decode_jpeg(packed.data(), packed.size(), *size, image.rgb.data());
  if (!good) throw InputError(where + ": the picture of a texture is damaged");
  return image;
}

}  // namespace tessera
