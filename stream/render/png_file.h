/// \file png_file.h
/// Pictures to PNG. No time stamp: the same picture gives the same bytes.
#pragma once
#include <filesystem>

#include "kernels/picture/picture.h"

namespace tessera {

/// What a picture holds decides how it is packed: shades without grain in runs of what Paeth's filter leaves, in a third of the time and
/// as small; anything by what is found twice in it.
enum class PngContent { kAnything, kShades };

/// 8 bit RGB. The file bears its name only once it is complete.
/// \throws UsageError when it cannot be created; ResourceError when the disk is full
void write_png(const std::filesystem::path& path, const Image& image,
               PngContent content = PngContent::kAnything);

}  // namespace tessera
