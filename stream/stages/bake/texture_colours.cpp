#include "stream/stages/bake/texture_colours.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/files/external_sort.h"
#include "stream/files/spill_file.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/texture_reader.h"
#include "stream/formats/texture_image.h"
#include "stream/import/import_needs.h"
#include "stream/meshes/store_write_stage.h"

namespace tessera {
namespace {

constexpr std::uint64_t kTextureLookBytes = std::uint64_t{64}
                                            << 20;  ///< of coordinates, to see whether there are any
constexpr double kMaxFaceTexels = 0x1p24;  ///< a face with more repeats its page: its middle alone is sampled

std::optional<TextureSize> size_of(const TexturePage& page) {
  if (page.bytes == 0) return std::nullopt;
  return texture_size(ReadFile(page.file), page.offset, page.bytes);
}

struct TexturedFace {
  std::uint32_t page, pad;
  std::uint64_t face;
  std::array<Double2, 3> uv;
  std::array<Double3, 3> corner;
};
struct TexturedFaceLess {
  bool operator()(const TexturedFace& a, const TexturedFace& b) const {
    return std::tie(a.page, a.face) < std::tie(b.page, b.face);
  }
};

std::uint32_t texel_at(const TextureImage& image, double x, double y) {
  const auto wrapped = [](double at, std::uint32_t count) {
    const double turns = std::floor(at / count);
    return std::min(count - 1, static_cast<std::uint32_t>(std::max(0.0, at - turns * count)));
  };
  const std::size_t at =
      std::size_t{wrapped(y, image.size.height)} * image.size.width + wrapped(x, image.size.width);
  return image.rgb[3 * at] | static_cast<std::uint32_t>(image.rgb[3 * at + 1]) << 8 |
         static_cast<std::uint32_t>(image.rgb[3 * at + 2]) << 16;
}

/// Every texel with its centre in the face; of one that has none, the middle.
void sample_face(const TexturedFace& face, const TextureImage& image, const TexturePointSink& sink) {
  const Double3 normal = unit_or_zero(triangle_normal(face.corner[0], face.corner[1], face.corner[2]));
  std::array<Double2, 3> at{};  // texels, y down
  for (std::size_t k = 0; k < 3; ++k) {
    at[k] = {face.uv[k][0] * image.size.width, (1.0 - face.uv[k][1]) * image.size.height};
    if (!std::isfinite(at[k][0]) || !std::isfinite(at[k][1])) return;
  }
  const auto area = [](const Double2& a, const Double2& b, const Double2& c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  };
  const auto give = [&](double x, double y, const Double3& weights) {
    sink(face.corner[0] * weights[0] + face.corner[1] * weights[1] + face.corner[2] * weights[2],
         texel_at(image, x, y), normal);
  };
  const double whole = area(at[0], at[1], at[2]);
  std::array<double, 2> low{}, high{};
  for (std::size_t a = 0; a < 2; ++a) {
    low[a] = std::floor(std::min({at[0][a], at[1][a], at[2][a]}));
    high[a] = std::ceil(std::max({at[0][a], at[1][a], at[2][a]}));
  }
  std::uint64_t given = 0;
  if (whole != 0.0 && (high[0] - low[0]) * (high[1] - low[1]) <= kMaxFaceTexels)
    for (double y = low[1] + 0.5; y < high[1]; y += 1.0)
      for (double x = low[0] + 0.5; x < high[0]; x += 1.0) {
        const Double2 p = {x, y};
        const Double3 w = {area(at[1], at[2], p) / whole, area(at[2], at[0], p) / whole,
                           area(at[0], at[1], p) / whole};
        if (w[0] < 0.0 || w[1] < 0.0 || w[2] < 0.0) continue;
        give(x, y, w);
        ++given;
      }
  if (given > 0) return;
  constexpr double kThird = 1.0 / 3.0;
  give((at[0][0] + at[1][0] + at[2][0]) * kThird, (at[0][1] + at[1][1] + at[2][1]) * kThird,
       {kThird, kThird, kThird});
}

class TextureColours : public BakeColours {
 public:
  TextureColours(std::filesystem::path mesh, const JobState& state)
      : path_(std::move(mesh)), temp_(state.work), sort_(sort_bytes(state.run)) {
    textures_ = open_textures(path_, sort_);
    if (!textures_) throw InputError(path_.string() + ": has no texture coordinates");
    for (const TexturePage& page : textures_->pages()) {
      if (!size_of(page))
        throw InputError(path_.string() + ": its page " + page.name +
                         " is not there, or neither PNG nor JPEG; put it beside the mesh");
    }
    const MeshSize size = claimed_mesh_size(path_);
    faces_ = size.faces;
    bytes_ = texture_colours_bytes(size.vertices, state.run, size_of_pages(path_));
  }

  void read(const Double3& shift, TaskContext& context, const TexturePointSink& sink) override {
    SpillFile spill(temp_);
    std::uint64_t faces = 0;
    textures_->read([&](std::span<const FaceTexture> batch) {
      context.check_stop();
      spill.append(batch.data(), batch.size_bytes());
      faces += batch.size();
      context.advance(batch.size());
    });
    const auto mesh = open_mesh_file(path_);
    std::vector<Double3> position;
    mesh->read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
      context.check_stop();
      position.insert(position.end(), batch.begin(), batch.end());
    });
    const Double3 by = mesh->header().shift - shift;
    ExternalSort<TexturedFace, TexturedFaceLess> sort(temp_, sort_);
    std::vector<FaceTexture> textures;
    std::uint64_t at = 0;
    mesh->read_faces([&](std::span<const MeshFace> batch) {
      context.check_stop();
      if (at + batch.size() > faces)
        throw InputError(path_.string() + ": has faces of more than three corners; triangulate it first");
      textures.resize(batch.size());
      spill.read_at(at * sizeof(FaceTexture), textures.data(), batch.size() * sizeof(FaceTexture));
      for (std::size_t f = 0; f < batch.size(); ++f) {
        if (textures[f].page >= textures_->pages().size()) {
          ++bare_;
          continue;
        }
        TexturedFace face{textures[f].page, 0, at + f, textures[f].uv, {}};
        for (std::size_t k = 0; k < 3; ++k) face.corner[k] = position[batch[f][k]] + by;
        sort.add(face);
      }
      at += batch.size();
      context.advance(batch.size());
    });
    std::vector<Double3>().swap(position);
    TextureImage image;
    std::uint32_t open = TextureReader::kNoPage;
    sort.drain([&](std::span<const TexturedFace> batch) {
      for (const TexturedFace& face : batch) {
        context.check_stop();
        context.advance(1);
        if (face.page != open) {
          open = face.page;
          const TexturePage& page = textures_->pages()[open];
          image = {};
          image = read_texture_image(ReadFile(page.file), page.offset, page.bytes);
          context.count_read(page.bytes);
        }
        sample_face(face, image, sink);
      }
    });
  }
  std::uint64_t units() const override { return 3 * faces_; }  // textures, corners, texels
  std::uint64_t bytes() const override { return bytes_; }
  bool has_normals() const override { return true; }
  std::vector<std::string> notices() const override {
    if (bare_ == 0) return {};
    return {std::to_string(bare_) + " faces of the input have no texture, and give none"};
  }

 private:
  std::filesystem::path path_, temp_;
  std::uint64_t sort_;
  std::unique_ptr<TextureReader> textures_;
  std::uint64_t bytes_ = 0, bare_ = 0, faces_ = 0;
};

}  // namespace

bool has_textures(const std::filesystem::path& mesh) {
  const std::unique_ptr<TextureReader> textures = open_textures(mesh, kTextureLookBytes);
  return textures != nullptr && !textures->pages().empty();
}

PagesSize size_of_pages(const std::filesystem::path& mesh) {
  PagesSize all;
  for (const TexturePage& page : texture_pages(mesh)) {
    const auto size = size_of(page);
    if (!size) continue;
    all.texels += std::uint64_t{size->width} * size->height;
    all.image_bytes = std::max(all.image_bytes, texture_image_bytes(*size, page.bytes));
  }
  return all;
}

std::uint64_t texture_colours_bytes(std::uint64_t vertices, const RunOptions& run, const PagesSize& pages) {
  return 2 * vertices * sizeof(Double3) + 2 * sort_bytes(run) + pages.image_bytes;
}

std::unique_ptr<BakeColours> colours_of_textures(const std::filesystem::path& mesh, const JobState& state) {
  return std::make_unique<TextureColours>(mesh, state);
}

}  // namespace tessera
