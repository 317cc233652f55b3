#include "stream/check/mesh_textures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <tuple>

#include "kernels/texture/chart_overlap.h"
#include "octree/error.h"
#include "stream/files/external_sort.h"
#include "stream/formats/meshes/texture_reader.h"
#include "stream/formats/texture_image.h"

namespace tessera {
namespace {

/// Coordinates are floats: of the size of a page.
constexpr double kUvRounding = 0x1p-22;
constexpr std::uint64_t kPageFaceBytes = 240;  ///< of a face, its copy in cells included

struct PageFace {
  std::uint32_t page, face_low;
  std::uint32_t face_high, pad;
  std::array<float, 6> uv;
};
struct PageFaceLess {
  bool operator()(const PageFace& a, const PageFace& b) const {
    return std::tie(a.page, a.face_high, a.face_low) < std::tie(b.page, b.face_high, b.face_low);
  }
};

double twice_uv_area(const std::array<float, 6>& t) {
  const double ax = t[0], ay = t[1];
  return (t[2] - ax) * (t[5] - ay) - (t[3] - ay) * (t[4] - ax);
}
double longest_uv_edge(const std::array<float, 6>& t) {
  double longest = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t l = (k + 1) % 3;
    const double dx = double{t[2 * l]} - t[2 * k], dy = double{t[2 * l + 1]} - t[2 * k + 1];
    longest = std::max(longest, std::sqrt(dx * dx + dy * dy));
  }
  return longest;
}

/// Faces of one page, those within it.
class PageOfFaces {
 public:
  void add(const PageFace& face) {
    const auto first = static_cast<std::uint32_t>(uv_.size());
    for (std::size_t k = 0; k < 3; ++k) uv_.push_back({face.uv[2 * k], face.uv[2 * k + 1]});
    faces_.push_back({first, first + 1, first + 2});
  }
  std::size_t size() const { return faces_.size(); }
  std::uint64_t take_overlapping() {
    const std::uint64_t count = overlapping_faces(uv_, faces_, kUvRounding).size();
    uv_.clear(), faces_.clear();
    return count;
  }

 private:
  std::vector<Double2> uv_;
  std::vector<std::array<std::uint32_t, 3>> faces_;
};

}  // namespace

std::optional<MeshTextures> check_textures(const std::filesystem::path& mesh,
                                           const MeshTexturesOptions& options) {
  const std::unique_ptr<TextureReader> reader = open_textures(mesh, options.memory_bytes / 4);
  if (!reader) return std::nullopt;
  const auto stop = [&] {
    if (options.check_stop) options.check_stop();
  };
  MeshTextures found;
  found.pages = reader->pages().size();
  std::vector<double> texels(reader->pages().size(), 0.0), used(reader->pages().size(), 0.0);
  for (std::size_t p = 0; p < reader->pages().size(); ++p) {
    const TexturePage& page = reader->pages()[p];
    const auto size =
        page.bytes > 0 ? texture_size(ReadFile(page.file), page.offset, page.bytes) : std::nullopt;
    if (!size) found.missing_pages.push_back(page.name);
    if (size) texels[p] = static_cast<double>(size->width) * size->height;
  }
  ExternalSort<PageFace, PageFaceLess> sort(options.temp, options.memory_bytes / 4);
  reader->read([&](std::span<const FaceTexture> faces) {
    stop();
    for (const FaceTexture& face : faces) {
      const std::uint64_t number = found.faces++;
      if (face.page == TextureReader::kNoPage) {
        ++found.bare;
        continue;
      }
      if (face.page >= found.pages) {
        ++found.lost;
        continue;
      }
      PageFace record{
          face.page, static_cast<std::uint32_t>(number), static_cast<std::uint32_t>(number >> 32), 0, {}};
      bool inside = true;
      for (std::size_t k = 0; k < 6; ++k) {
        const double x = face.uv[k / 2][k % 2];
        inside = inside && x >= 0.0 && x <= 1.0;
        record.uv[k] = static_cast<float>(x);
      }
      if (!inside) {
        ++found.outside;
        continue;
      }
      const double area = twice_uv_area(record.uv);
      if (area < -kUvRounding * longest_uv_edge(record.uv)) ++found.flipped;
      used[face.page] += 0.5 * std::fabs(area);
      sort.add(record);
    }
  });
  PageOfFaces page;
  std::uint32_t open = 0;
  sort.drain([&](std::span<const PageFace> faces) {
    stop();
    for (const PageFace& face : faces) {
      if (face.page != open) found.overlapping += page.take_overlapping();
      open = face.page;
      if (page.size() * kPageFaceBytes > options.memory_bytes / 2)
        throw ResourceError(mesh.string() + ": the faces of page " + std::to_string(open) +
                            " take more than " + std::to_string(options.memory_bytes >> 21) +
                            " MiB: give more --memory");
      page.add(face);
    }
  });
  found.overlapping += page.take_overlapping();
  double all = 0.0, taken = 0.0;
  for (std::size_t p = 0; p < texels.size(); ++p) all += texels[p], taken += used[p] * texels[p];
  found.used_share = all > 0.0 ? taken / all : 0.0;
  return found;
}

std::vector<std::string> MeshTextures::defects() const {
  std::vector<std::string> all;
  const auto add = [&](std::uint64_t count, const std::string& what) {
    if (count > 0) all.push_back(std::to_string(count) + " " + what);
  };
  add(missing_pages.size(), "pages of textures that are not there");
  add(lost, "faces on pages that the file does not name");
  add(outside, "faces beyond their page");
  add(flipped, "faces flipped on their page");
  add(overlapping, "faces over others on their page");
  return all;
}

Json to_json(const MeshTextures& t) {
  return {{"faces", t.faces},
          {"without_texture", t.bare},
          {"pages", t.pages},
          {"missing_pages", t.missing_pages},
          {"unnamed_page_faces", t.lost},
          {"outside_faces", t.outside},
          {"flipped_faces", t.flipped},
          {"overlapping_faces", t.overlapping},
          {"used_share", t.used_share}};
}

std::string describe(const MeshTextures& t) {
  std::string text = "textures: " + std::to_string(t.faces - t.bare) + " of " + std::to_string(t.faces) +
                     " faces on " + std::to_string(t.pages) + " pages, " +
                     std::to_string(static_cast<int>(std::floor(1000.0 * t.used_share + 0.5)) / 10) +
                     " % of them used";
  const std::vector<std::string> wrong = t.defects();
  for (const std::string& defect : wrong) text += ", " + defect;
  if (wrong.empty()) text += ", none flipped, over another or beyond its page";
  for (const std::string& page : t.missing_pages) text += "\n  not there, or no PNG or JPEG: " + page;
  return text + "\n";
}

}  // namespace tessera
