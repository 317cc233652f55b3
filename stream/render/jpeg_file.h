/// \file jpeg_file.h
/// Pictures to JPEG. The same picture gives the same bytes on any machine: whole-number transforms, no time stamp.
#pragma once
#include <filesystem>
#include <string>

#include "kernels/picture/picture.h"

namespace tessera {

/// Baseline JPEG (JFIF), colours not subsampled, Huffman tables made for the picture. The file bears its name only once it
/// is complete. \param quality  1 to 100, of the Independent JPEG Group's tables
/// \throws UsageError when it cannot be created; ResourceError when the disk is full
void write_jpeg(const std::filesystem::path& path, const Image& image, int quality);

/// The same in memory. \throws ResourceError when it cannot be encoded
std::string jpeg_bytes(const Image& image, int quality);

}  // namespace tessera
