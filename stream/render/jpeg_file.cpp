#include "stream/render/jpeg_file.h"

#include <cstdlib>
#include <memory>

#include "octree/error.h"
#include "stream/files/output_file.h"
#include "stream/formats/jpeg_leave.h"

namespace tessera {
namespace {

/// Only plain data lives in this frame, so that longjmp skips no destructor. False when libjpeg gave up.
/// \param bytes  malloc'ed by libjpeg
bool encode_jpeg(const Image& image, int quality, unsigned char** bytes, unsigned long* count) {
  jpeg_compress_struct jpeg;
  JpegLeave leave;
  jpeg.err = leave.manager();
  if (setjmp(leave.to) != 0) {
    jpeg_destroy_compress(&jpeg);
    return false;
  }
  jpeg_create_compress(&jpeg);
  jpeg_mem_dest(&jpeg, bytes, count);
  jpeg.image_width = static_cast<JDIMENSION>(image.width);
  jpeg.image_height = static_cast<JDIMENSION>(image.height);
  jpeg.input_components = 3;
  jpeg.in_color_space = JCS_RGB;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, quality, TRUE);
  jpeg.dct_method = JDCT_ISLOW;  // whole numbers: the same with any instruction set
  jpeg.optimize_coding = TRUE;
  for (int c = 0; c < 3; ++c) jpeg.comp_info[c].h_samp_factor = jpeg.comp_info[c].v_samp_factor = 1;
  jpeg_start_compress(&jpeg, TRUE);
  while (jpeg.next_scanline < jpeg.image_height) {
    // libjpeg reads rows through pointers that are not const.
    JSAMPROW row = const_cast<JSAMPROW>(image.pixel(0, static_cast<int>(jpeg.next_scanline)));
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  return true;
}

}  // namespace

void write_jpeg(const std::filesystem::path& path, const Image& image, int quality) {
  unsigned char* bytes = nullptr;
  unsigned long count = 0;
  const bool encoded = encode_jpeg(image, quality, &bytes, &count);
  const std::unique_ptr<unsigned char, decltype(&std::free)> owner(bytes, &std::free);
  if (!encoded) throw ResourceError(path.string() + ": the picture cannot be encoded as JPEG");
  OutputFile file(path);
  file.append(bytes, count);
  file.finish();
}

std::string jpeg_bytes(const Image& image, int quality) {
  unsigned char* bytes = nullptr;
  unsigned long count = 0;
  const bool encoded = encode_jpeg(image, quality, &bytes, &count);
  const std::unique_ptr<unsigned char, decltype(&std::free)> owner(bytes, &std::free);
  if (!encoded) throw ResourceError("a picture cannot be encoded as JPEG");
  return {reinterpret_cast<const char*>(bytes), count};
}

}  // namespace tessera
