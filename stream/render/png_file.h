/// \file png_file.h
/// Pictures to PNG. No time stamp: the same picture gives the same bytes.
#pragma once
#include <filesystem>

#include "kernels/picture/picture.h"

namespace tessera {

/// 8 bit RGB. The file bears its name only once it is complete.
/// \throws UsageError when it cannot be created; ResourceError when the disk is full
void write_png(const std::filesystem::path& path, const Image& image);

}  // namespace tessera
