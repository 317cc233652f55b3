// Pictures of textured meshes: colours of the page where they belong, means of what is finer than samples, every format, every cap.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include <png.h>

#include "octree/error.h"
#include "stream/formats/meshes/textured_mesh_writer.h"
#include "stream/render/png_file.h"
#include "stream/render/render.h"
#include "stream/runtime/memory_budget.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace render_pages_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;
using Rgb = std::array<int, 3>;

constexpr int kSquares = 8;  // of a side of the sheet

/// A page whose texel (x from the left, y from below) has this colour.
void write_page(const fs::path& path, int side, const std::function<Rgb(int, int)>& colour) {
  Image page{side, side, std::vector<std::uint8_t>(static_cast<std::size_t>(3 * side * side))};
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      for (std::size_t c = 0; c < 3; ++c)
        page.pixel(x, side - 1 - y)[c] = static_cast<std::uint8_t>(colour(x, y)[c]);
  write_png(path, page);
}

/// Red, green, blue and white: lower left, lower right, upper left, upper right.
Rgb quarter(int x, int y, int side) {
  const bool right = x >= side / 2, up = y >= side / 2;
  return up ? (right ? Rgb{230, 230, 230} : Rgb{20, 20, 230}) : (right ? Rgb{20, 230, 20} : Rgb{230, 20, 20});
}

struct Sheet {
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  std::vector<FaceTexture> textures;
};

/// Level, seen from above as its page is: of side 2 around the origin. \param pages  faces of the left, then of the right part
Sheet level_sheet(std::uint32_t pages = 1) {
  Sheet sheet;
  constexpr std::uint64_t kRow = kSquares + 1;
  for (int j = 0; j <= kSquares; ++j)
    for (int i = 0; i <= kSquares; ++i)
      sheet.points.push_back({2.0 * i / kSquares - 1.0, 2.0 * j / kSquares - 1.0, 0.0});
  for (std::uint64_t j = 0; j < kSquares; ++j)
    for (std::uint64_t i = 0; i < kSquares; ++i)
      for (const MeshFace& f : {MeshFace{j * kRow + i, j * kRow + i + 1, (j + 1) * kRow + i + 1},
                                MeshFace{j * kRow + i, (j + 1) * kRow + i + 1, (j + 1) * kRow + i}}) {
        FaceTexture texture;
        texture.page = pages == 1 ? 0 : static_cast<std::uint32_t>(i * pages / kSquares);
        for (std::size_t k = 0; k < 3; ++k)
          texture.uv[k] = {0.5 * (sheet.points[f[k]][0] + 1.0), 0.5 * (sheet.points[f[k]][1] + 1.0)};
        sheet.faces.push_back(f);
        sheet.textures.push_back(texture);
      }
  return sheet;
}

/// .ply or .obj, with its MTL. \param rgba  of all vertices, or none
fs::path write_sheet(const fs::path& path, const Sheet& sheet, const std::vector<std::string>& pages,
                     std::uint32_t rgba = 0) {
  MeshHeader header;
  header.vertices = sheet.points.size();
  header.faces = sheet.faces.size();
  header.colour = rgba != 0;
  std::size_t next = 0;
  const auto mesh = create_textured_mesh(path, header, pages, [&](std::size_t faces) {
    const auto from = sheet.textures.begin() + static_cast<std::ptrdiff_t>(next);
    next += faces;
    return std::vector<FaceTexture>(from, from + static_cast<std::ptrdiff_t>(faces));
  });
  mesh->vertices(sheet.points, rgba != 0 ? std::vector<std::uint32_t>(sheet.points.size(), rgba)
                                         : std::vector<std::uint32_t>());
  mesh->faces(sheet.faces);
  mesh->finish();
  if (path.extension() == ".obj") std::ofstream(material_path(path)) << material_text(pages);
  return path;
}

/// Two charts, left and right, whose vertices along the seam are there twice.
fs::path write_glb(const fs::path& path, const Sheet& sheet, const fs::path& page) {
  std::vector<Double3> points;
  std::vector<Double2> uv;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (const bool right : {false, true}) {
    const auto first = static_cast<std::uint32_t>(points.size());
    for (const Double3& p : sheet.points) {
      points.push_back(p);
      uv.push_back({0.5 * (p[0] + 1.0), 0.5 * (p[1] + 1.0)});
    }
    for (const MeshFace& f : sheet.faces) {
      const double middle = sheet.points[f[0]][0] + sheet.points[f[1]][0] + sheet.points[f[2]][0];
      if ((middle > 0.0) != right) continue;
      faces.push_back({});
      for (std::size_t k = 0; k < 3; ++k) faces.back()[k] = first + static_cast<std::uint32_t>(f[k]);
    }
  }
  TexturedGlb::Page of_all{points.size(), faces.size(), {}, {}, page, {}};
  of_all.min = of_all.max = TexturedGlb::file_position(points[0], {0, 0, 0});
  for (const Double3& p : points)
    for (std::size_t k = 0; k < 3; ++k) {
      const float x = TexturedGlb::file_position(p, {0, 0, 0})[k];
      of_all.min[k] = std::min(of_all.min[k], x), of_all.max[k] = std::max(of_all.max[k], x);
    }
  TexturedGlb glb(path, {}, {of_all});
  glb.vertices(points, uv);
  glb.faces(faces);
  glb.finish();
  return path;
}

Image read_png(const fs::path& path) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  REQUIRE(png_image_begin_read_from_file(&png, path.c_str()) != 0);
  png.format = PNG_FORMAT_RGB;
  Image image{static_cast<int>(png.width), static_cast<int>(png.height), {}};
  image.rgb.resize(PNG_IMAGE_SIZE(png));
  REQUIRE(png_image_finish_read(&png, nullptr, image.rgb.data(), 0, nullptr) != 0);
  return image;
}

RenderOptions from_above(const fs::path& mesh, const fs::path& picture) {
  RenderOptions options;
  options.inputs = {mesh.string()};
  options.output = picture;
  options.views = {"top"};
  options.width = options.height = 400;
  options.samples = 2;
  options.occlusion = 0.0;
  options.captions = false;
  options.borders = "off";
  return options;
}

/// At a share of the picture, from the left and from below.
Rgb at(const Image& image, double x, double y) {
  const std::uint8_t* p =
      image.pixel(static_cast<int>(x * image.width), static_cast<int>((1.0 - y) * image.height));
  return {p[0], p[1], p[2]};
}

/// Which channels are bright.
std::string hue(const Rgb& c) {
  std::string name;
  for (std::size_t k = 0; k < 3; ++k) name += c[k] > 150 ? "rgb"[k] : '-';
  return name;
}

void check_quarters(const Image& image) {
  CHECK(hue(at(image, 0.3, 0.3)) == "r--");
  CHECK(hue(at(image, 0.7, 0.3)) == "-g-");
  CHECK(hue(at(image, 0.3, 0.7)) == "--b");
  CHECK(hue(at(image, 0.7, 0.7)) == "rgb");
}

}  // namespace

TEST_CASE("render: a page of textures lies where the faces say, of PLY, OBJ and GLB", "[pipeline]") {
  const TempFolder temp;
  const fs::path& folder = temp.path();
  write_page(folder / "page.png", 64, [](int x, int y) { return quarter(x, y, 64); });
  const Sheet sheet = level_sheet();
  const std::string extension = GENERATE(".ply", ".obj", ".glb");
  const fs::path mesh = extension == ".glb" ? write_glb(folder / "m.glb", sheet, folder / "page.png")
                                            : write_sheet(folder / ("m" + extension), sheet, {"page.png"});
  RenderOptions options = from_above(mesh, folder / "p.png");
  options.colour = GENERATE("auto", "texture");
  options.borders = "on";
  const RenderReport report = render(options);
  CHECK(report.pages == 1);
  CHECK(report.notices.empty());
  CHECK(report.border_edges == 4 * kSquares);  // a seam between charts is no border
  check_quarters(read_png(folder / "p.png"));
}

TEST_CASE("render: texels finer than samples show their mean, coarser ones are bilinear", "[pipeline]") {
  const TempFolder temp;
  const fs::path& folder = temp.path();
  const Sheet sheet = level_sheet();
  const fs::path mesh = write_sheet(folder / "m.ply", sheet, {"page.png"});
  const auto drawn = [&](int side, const std::function<Rgb(int, int)>& colour) {
    write_page(folder / "page.png", side, colour);
    render(from_above(mesh, folder / "p.png"));
    return read_png(folder / "p.png");
  };
  // Black and white by turns, six texels a pixel: one grey, the one of a page that has it all over.
  const Image chequers = drawn(2048, [](int x, int y) {
    return (x + y) % 2 == 0 ? Rgb{0, 0, 0} : Rgb{255, 255, 255};
  });
  const Image grey = drawn(4, [](int, int) { return Rgb{180, 180, 180}; });
  for (const double x : {0.25, 0.4, 0.5, 0.62, 0.75})
    for (const double y : {0.3, 0.5, 0.7}) CHECK(std::abs(at(chequers, x, y)[0] - at(grey, x, y)[0]) <= 2);
  // Four columns of texels, 0, 80, 160 and 240: no step between them.
  const Image ramp = drawn(4, [](int x, int) { return Rgb{80 * x, 80 * x, 80 * x}; });
  int largest = 0;
  for (int x = 121; x < 280; ++x)
    largest = std::max(largest, std::abs(ramp.pixel(x, 200)[0] - ramp.pixel(x - 1, 200)[0]));
  CHECK(at(ramp, 0.68, 0.5)[0] > at(ramp, 0.32, 0.5)[0] + 100);
  CHECK(largest <= 3);
}

TEST_CASE("render: faces of several pages, repeated pages, and pages that are not there", "[pipeline]") {
  const TempFolder temp;
  const fs::path& folder = temp.path();
  write_page(folder / "a.png", 16, [](int, int) { return Rgb{230, 20, 20}; });
  write_page(folder / "b.png", 16, [](int, int) { return Rgb{20, 20, 230}; });
  SECTION("by page, in any order of the faces") {
    Sheet sheet = level_sheet(2);
    write_sheet(folder / "m.ply", sheet, {"a.png", "b.png"});
    const RenderReport report = render(from_above(folder / "m.ply", folder / "p.png"));
    CHECK(report.pages == 2);
    const Image image = read_png(folder / "p.png");
    CHECK(hue(at(image, 0.3, 0.5)) == "r--");
    CHECK(hue(at(image, 0.7, 0.5)) == "--b");
  }
  SECTION("coordinates beyond 1 begin the page anew") {
    write_page(folder / "page.png", 64, [](int x, int y) { return quarter(x, y, 64); });
    std::ofstream(folder / "m.mtl") << material_text({"page.png"});
    std::ifstream made(write_sheet(folder / "whole.obj", level_sheet(), {"page.png"}));
    std::ofstream far(folder / "m.obj");
    for (std::string line; std::getline(made, line);) {
      std::istringstream words(line.starts_with("vt ") ? line.substr(3) : "");
      double u = 0.0, v = 0.0;
      if (words >> u >> v)
        far << "vt " << u + 3.0 << " " << v - 2.0 << "\n";
      else
        far << (line.starts_with("mtllib") ? "mtllib m.mtl" : line) << "\n";
    }
    far.close();
    render(from_above(folder / "m.obj", folder / "p.png"));
    check_quarters(read_png(folder / "p.png"));
  }
  SECTION("one that is not there is told, its faces have the colours of their vertices") {
    write_sheet(folder / "m.ply", level_sheet(2), {"a.png", "lost.png"}, 0xff14e614u);
    const RenderReport report = render(from_above(folder / "m.ply", folder / "p.png"));
    CHECK(report.pages == 1);
    REQUIRE(report.notices.size() == 1);
    CHECK(report.notices[0].find("lost.png is not there") != std::string::npos);
    const Image image = read_png(folder / "p.png");
    CHECK(hue(at(image, 0.3, 0.5)) == "r--");
    CHECK(hue(at(image, 0.7, 0.5)) == "-g-");
  }
  SECTION("--colour vertex shows none, and --colour texture says where there are none") {
    write_sheet(folder / "m.ply", level_sheet(), {"a.png"}, 0xff14e614u);
    RenderOptions options = from_above(folder / "m.ply", folder / "p.png");
    options.colour = "vertex";
    CHECK(render(options).pages == 0);
    CHECK(hue(at(read_png(folder / "p.png"), 0.5, 0.5)) == "-g-");
    fs::remove(folder / "a.png");
    options.colour = "texture";
    const RenderReport report = render(options);
    REQUIRE(report.notices.size() == 2);
    CHECK(report.notices[1].find("drawn without textures") != std::string::npos);
    CHECK(hue(at(read_png(folder / "p.png"), 0.5, 0.5)) == "-g-");
  }
}

TEST_CASE("render: textures under a small cap have the bytes of no cap, or are refused by name",
          "[property]") {
  const TempFolder temp;
  const fs::path& folder = temp.path();
  write_page(folder / "a.png", 1024, [](int x, int y) { return Rgb{x / 4, y / 4, (x * y) % 256}; });
  write_page(folder / "b.png", 512, [](int x, int y) { return Rgb{(x ^ y) % 256, y / 2, 0}; });
  write_sheet(folder / "m.ply", level_sheet(2), {"a.png", "b.png"});
  RenderOptions options = from_above(folder / "m.ply", folder / "whole.png");
  options.colour = "texture";
  options.views.clear();
  options.width = 1000, options.height = 1600, options.samples = 3;
  render(options);
  const std::string whole = file_bytes(folder / "whole.png");

  options.output = folder / "other.png";
  // The figure of the refusal and what this process holds now and then, MiB.
  const auto named_cap = [&](std::uint64_t cap, const std::string& what) {
    trim_allocator();
    options.memory_bytes = cap;
    std::string refused;
    try {
      render(options);
    } catch (const ResourceError& e) {
      refused = e.what();
    }
    INFO(refused);
    CHECK(refused.find(what) != std::string::npos);
    const std::size_t at = refused.find("needs --memory ");
    REQUIRE(at != std::string::npos);
    return (std::stoull(refused.substr(at + 15)) + 16) << 20;
  };
  // auto does without, and says so.
  const std::uint64_t short_cap = named_cap(1, "a picture of 1000x1600");
  options.memory_bytes = short_cap, options.colour = "auto";
  const RenderReport report = render(options);
  CHECK(report.pages == 0);
  CHECK(std::any_of(report.notices.begin(), report.notices.end(), [](const std::string& notice) {
    return notice.find("drawn without textures") != std::string::npos;
  }));
  CHECK((file_bytes(folder / "other.png") != whole));

  options.colour = "texture";
  const std::uint64_t bare_cap = named_cap(1, "a picture of 1000x1600");
  options.memory_bytes = named_cap(bare_cap, "with the pages of textures");
  trim_allocator();
  CHECK(render(options).pages == 2);
  CHECK((file_bytes(folder / "other.png") == whole));
}

}  // namespace render_pages_test
