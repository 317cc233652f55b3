#include "stream/render/mesh_pages.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "octree/error.h"
#include "stream/formats/texture_image.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::uint64_t kWaitBytes = std::uint64_t{16} << 20;  // of faces in memory
constexpr std::size_t kReadTextures = 4096;                    // faces at a time
constexpr std::size_t kMinWaitChunk = 1 << 10, kMaxWaitChunk = 1 << 18;
/// Coordinates are floats, some a bit beyond the page's border.
constexpr double kBeyondPage = 0x1p-16;

std::optional<TextureSize> size_of(const TexturePage& page) {
  return page.bytes > 0 ? texture_size(ReadFile(page.file), page.offset, page.bytes) : std::nullopt;
}

}  // namespace

std::uint64_t mesh_pages_bytes(const std::vector<std::filesystem::path>& meshes) {
  std::uint64_t largest = 0, waiting = 0;
  for (const std::filesystem::path& mesh : meshes) {
    bool any = false;
    for (const TexturePage& page : texture_pages(mesh)) {
      const std::optional<TextureSize> size = size_of(page);
      if (!size) continue;
      any = true;
      largest = std::max(largest, texture_image_bytes(*size, page.bytes) +
                                      page_bytes(std::uint64_t{size->width} * size->height));
    }
    if (any) waiting += kWaitBytes;
  }
  return largest + waiting;
}

bool may_have_pages(const std::vector<std::filesystem::path>& meshes) {
  return std::any_of(meshes.begin(), meshes.end(), [](const std::filesystem::path& mesh) {
    try {
      return !texture_pages(mesh).empty();
    } catch (const Error&) {  // who draws it will say so
      return true;
    }
  });
}

MeshPages::MeshPages(const std::filesystem::path& mesh, std::filesystem::path temp,
                     std::uint64_t memory_bytes)
    : mesh_(mesh), temp_(std::move(temp)), textures_(temp_) {
  for (TexturePage& file : texture_pages(mesh_)) {
    const bool there = size_of(file).has_value();
    if (!there)
      notices_.push_back(mesh_.string() + ": its page " + file.name +
                         " is not there, or neither PNG nor JPEG; its faces are drawn without");
    pages_.push_back({std::move(file), there, false});
  }
  if (pages() == 0) return;
  const std::unique_ptr<TextureReader> reader = open_textures(mesh_, memory_bytes);
  if (!reader) {  // pages, but no face that is on one
    pages_.clear();
    return;
  }
  reader->read([&](std::span<const FaceTexture> batch) {
    throw_if_stopped();
    for (const FaceTexture& face : batch) {
      if (face.page >= pages_.size()) continue;
      for (const Double2& at : face.uv)
        for (const double x : at)
          if (x < -kBeyondPage || x > 1.0 + kBeyondPage) pages_[face.page].repeats = true;
    }
    textures_.append(batch.data(), batch.size_bytes());
    faces_ += batch.size();
  });
}

std::size_t MeshPages::pages() const {
  return static_cast<std::size_t>(
      std::count_if(pages_.begin(), pages_.end(), [](const Page& page) { return page.there; }));
}

void MeshPages::begin() {
  next_ = 0;
  waiting_.reset();
  pool_ = std::make_unique<SpillPool>(temp_, kWaitBytes / 2);
  const std::size_t chunk = std::size_t{kWaitBytes / 2} / std::max<std::size_t>(pages_.size(), 1);
  waiting_ = std::make_unique<SpillBuckets<WaitingFace>>(*pool_, pages_.size(),
                                                         std::clamp(chunk, kMinWaitChunk, kMaxWaitChunk));
}

const FaceTexture& MeshPages::next() {
  if (next_ == faces_)
    throw InputError(mesh_.string() + ": has other faces than texture coordinates; triangulate it first");
  const std::size_t at = next_ % kReadTextures;
  if (at == 0) {
    read_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kReadTextures, faces_ - next_)));
    textures_.read_at(next_ * sizeof(FaceTexture), read_.data(), read_.size() * sizeof(FaceTexture));
  }
  ++next_;
  return read_[at];
}

bool MeshPages::take(const std::array<PictureVertex, 3>& corners) {
  const FaceTexture& face = next();
  if (face.page >= pages_.size() || !pages_[face.page].there) return false;
  WaitingFace waiting;
  for (std::size_t k = 0; k < 3; ++k) {
    if (!std::isfinite(face.uv[k][0] + face.uv[k][1])) return false;
    waiting[k] = {corners[k], static_cast<float>(face.uv[k][0]), static_cast<float>(face.uv[k][1])};
  }
  waiting_->add(face.page, waiting);
  return true;
}

void MeshPages::draw(Picture& picture, float wire_pixels) {
  for (std::size_t p = 0; p < pages_.size(); ++p) {
    if (waiting_->count(p) == 0) continue;
    const TexturePage& file = pages_[p].file;
    TextureImage image = read_texture_image(ReadFile(file.file), file.offset, file.bytes);
    picture.set_page(
        {static_cast<int>(image.size.width), static_cast<int>(image.size.height), std::move(image.rgb)},
        pages_[p].repeats);
    waiting_->for_each(p, [&](std::span<const WaitingFace> faces) {
      throw_if_stopped();
      picture.page_triangles({faces.front().data(), 3 * faces.size()}, wire_pixels);
    });
  }
}

}  // namespace tessera
