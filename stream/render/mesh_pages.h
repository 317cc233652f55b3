/// \file mesh_pages.h
/// Textures of a mesh in pictures: its faces wait by page, on disk where they are many, and one page at a time is in memory.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "kernels/picture/picture.h"
#include "stream/files/spill_buckets.h"
#include "stream/formats/meshes/texture_reader.h"

namespace tessera {

/// What pages of textures take in a picture of these meshes: the largest page, and faces of each that wait. 0 where there are none.
std::uint64_t mesh_pages_bytes(const std::vector<std::filesystem::path>& meshes);

/// Whether one of them names pages of textures, or cannot be asked.
bool may_have_pages(const std::vector<std::filesystem::path>& meshes);

class MeshPages {
 public:
  /// Reads the texture coordinates of all faces.
  /// \param temp  folder of the faces that wait \param memory_bytes  of coordinates while they are read
  /// \throws InputError and ResourceError as open_textures() and TextureReader::read()
  MeshPages(const std::filesystem::path& mesh, std::filesystem::path temp, std::uint64_t memory_bytes);

  /// Pages that are there; without any there is nothing to show.
  std::size_t pages() const;
  /// One sentence for each page that is not there, or neither PNG nor JPEG.
  const std::vector<std::string>& notices() const { return notices_; }

  /// Before the first face, of every band anew.
  void begin();
  /// Of the faces in their order: whether the next one is on a page that is there. Its corners are taken then.
  bool take(const std::array<PictureVertex, 3>& corners);
  /// The next face is drawn otherwise.
  void skip() { next(); }
  /// Draws what was taken, page by page.
  void draw(Picture& picture, float wire_pixels);

 private:
  using WaitingFace = std::array<PageVertex, 3>;
  struct Page {
    TexturePage file;
    bool there = false, repeats = false;
  };
  const FaceTexture& next();

  std::filesystem::path mesh_, temp_;
  std::vector<Page> pages_;
  std::vector<std::string> notices_;
  std::uint64_t faces_ = 0;
  SpillFile textures_;  ///< of all faces
  std::vector<FaceTexture> read_;
  std::uint64_t next_ = 0;
  std::unique_ptr<SpillPool> pool_;
  std::unique_ptr<SpillBuckets<WaitingFace>> waiting_;
};

}  // namespace tessera
