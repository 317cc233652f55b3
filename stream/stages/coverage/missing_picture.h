/// \file missing_picture.h
/// What of a scan is missing in its mesh, seen from above: grey where the mesh is, magenta where it should be.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "kernels/picture/picture.h"

namespace tessera {

/// OUTPUT.missing.png
std::filesystem::path missing_picture_path(const std::filesystem::path& output);

/// Collects what was seen and what of it is missing, by pixel.
class MissingPicture {
 public:
  /// \param low, high  of columns, both ends inside
  MissingPicture(std::uint32_t low_u, std::uint32_t low_v, std::uint32_t high_u, std::uint32_t high_v);
  /// One column that was seen, or one point of the sample in it.
  void add(std::uint32_t u, std::uint32_t v, bool missing);
  Image image() const;

  static constexpr std::uint64_t kBytes = std::uint64_t{640} * 640 * (8 + 3);

 private:
  struct Pixel {
    std::uint32_t seen = 0, missing = 0;
  };
  std::uint32_t low_u_, low_v_, per_pixel_;
  int width_, height_;
  std::vector<Pixel> pixels_;
};

}  // namespace tessera
