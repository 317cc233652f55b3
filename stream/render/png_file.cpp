#include "stream/render/png_file.h"

#include <csetjmp>
#include <exception>

#include <png.h>
#include <zlib.h>

#include "octree/error.h"
#include "stream/files/output_file.h"

namespace tessera {
namespace {

/// libpng leaves by longjmp, which must not cross our frames: exceptions of the file are carried around it.
struct Sink {
  OutputFile* file = nullptr;
  std::exception_ptr failure;
};

void write_bytes(png_structp png, png_bytep data, png_size_t bytes) {
  auto* sink = static_cast<Sink*>(png_get_io_ptr(png));
  if (sink->failure != nullptr) return;
  try {
    sink->file->append(data, bytes);
  } catch (...) {
    sink->failure = std::current_exception();
  }
}
void flush_bytes(png_structp /*png*/) {}

/// Only plain data lives in this frame, so that longjmp skips no destructor. False when libpng gave up.
bool encode(png_structp png, png_infop info, const Image& image, PngContent content) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height), 8,
               PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_compression_level(png, 4);  // 7 takes four times as long for a twentieth less
  if (content == PngContent::kShades) {
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_PAETH);
    png_set_compression_strategy(png, Z_RLE);
  }
  png_write_info(png, info);
  for (int y = 0; y < image.height; ++y) png_write_row(png, image.pixel(0, y));
  png_write_end(png, info);
  return true;
}

}  // namespace

void write_png(const std::filesystem::path& path, const Image& image, PngContent content) {
  OutputFile file(path);
  Sink sink{&file, nullptr};
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  if (info == nullptr) {
    png_destroy_write_struct(&png, nullptr);
    throw ResourceError(path.string() + ": no memory to encode the picture");
  }
  png_set_write_fn(png, &sink, write_bytes, flush_bytes);
  const bool encoded = encode(png, info, image, content);
  png_destroy_write_struct(&png, &info);
  if (sink.failure != nullptr) std::rethrow_exception(sink.failure);
  if (!encoded) throw ResourceError(path.string() + ": the picture cannot be encoded as PNG");
  file.finish();
}

}  // namespace tessera
