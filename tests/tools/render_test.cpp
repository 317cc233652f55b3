#include <catch2/catch.hpp>

#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <png.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "kernels/picture/picture.h"
#include "octree/error.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/render/render.h"
#include "stream/render/render_scene.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::render_test {
namespace {

struct Mesh {
  std::vector<Double3> vertices;
  std::vector<MeshFace> faces;
};

/// Closed latitude-longitude sphere; `last_ring` < rings leaves a cap out.
Mesh sphere(std::uint64_t rings, std::uint64_t segments, std::uint64_t last_ring,
            const Double3& centre = {0, 0, 0}) {
  Mesh mesh;
  mesh.vertices.push_back({centre[0], centre[1], centre[2] + 1.0});
  const std::uint64_t rows = last_ring == rings ? rings - 1 : last_ring;
  for (std::uint64_t r = 1; r <= rows; ++r) {
    for (std::uint64_t s = 0; s < segments; ++s) {
      const double polar = M_PI * static_cast<double>(r) / static_cast<double>(rings);
      const double azimuth = 2.0 * M_PI * static_cast<double>(s) / static_cast<double>(segments);
      mesh.vertices.push_back({centre[0] + std::sin(polar) * std::cos(azimuth),
                               centre[1] + std::sin(polar) * std::sin(azimuth), centre[2] + std::cos(polar)});
    }
  }
  const auto at = [&](std::uint64_t r, std::uint64_t s) { return 1 + (r - 1) * segments + s % segments; };
  for (std::uint64_t s = 0; s < segments; ++s) mesh.faces.push_back({0, at(1, s), at(1, s + 1)});
  for (std::uint64_t r = 1; r < rows; ++r) {
    for (std::uint64_t s = 0; s < segments; ++s) {
      mesh.faces.push_back({at(r, s), at(r + 1, s), at(r + 1, s + 1)});
      mesh.faces.push_back({at(r, s), at(r + 1, s + 1), at(r, s + 1)});
    }
  }
  if (last_ring == rings) {
    mesh.vertices.push_back({centre[0], centre[1], centre[2] - 1.0});
    const std::uint64_t pole = mesh.vertices.size() - 1;
    for (std::uint64_t s = 0; s < segments; ++s) mesh.faces.push_back({pole, at(rows, s + 1), at(rows, s)});
  }
  return mesh;
}

std::filesystem::path write(const Mesh& mesh, const std::filesystem::path& path,
                            const std::vector<std::uint32_t>& rgba = {}) {
  MeshHeader header;
  header.vertices = mesh.vertices.size();
  header.faces = mesh.faces.size();
  header.colour = !rgba.empty();
  const auto file = create_mesh_file(path, header);
  file->vertices(mesh.vertices, rgba);
  file->faces(mesh.faces);
  file->finish();
  return path;
}

Image read_png(const std::filesystem::path& path) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  REQUIRE(png_image_begin_read_from_file(&png, path.c_str()) != 0);
  png.format = PNG_FORMAT_RGB;
  Image image;
  image.width = static_cast<int>(png.width);
  image.height = static_cast<int>(png.height);
  image.rgb.resize(PNG_IMAGE_SIZE(png));
  REQUIRE(png_image_finish_read(&png, nullptr, image.rgb.data(), 0, nullptr) != 0);
  return image;
}

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

RenderOptions one_view(const std::filesystem::path& input, const std::filesystem::path& output) {
  RenderOptions options;
  options.inputs = {input.string()};
  options.output = output;
  options.views = {"front"};
  options.width = 400;
  options.height = 300;
  options.samples = 2;
  options.captions = false;
  return options;
}

template <typename Predicate>
int count(const Image& image, const Predicate& is) {
  int n = 0;
  for (std::size_t i = 0; i < image.rgb.size(); i += 3) {
    n += is(image.rgb[i], image.rgb[i + 1], image.rgb[i + 2]) ? 1 : 0;
  }
  return n;
}
// The background is bluish, clay is warm.
bool covered(int r, int, int b) {
  return r > b;
}
bool orange(int r, int g, int b) {
  return r - b > 60 && g - b > 15;
}
bool red(int r, int g, int b) {
  return r > 150 && g < 110 && b < 110;
}
bool magenta(int r, int g, int b) {
  return r > 130 && b > 130 && g < 110;
}

bool green(int r, int g, int b) {
  return g > r + 60 && g > b + 60;
}

}  // namespace

TEST_CASE("render: a sphere covers what its size says", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  // Far from the origin, as georeferenced data is: precision must not depend on it.
  const Double3 centre = GENERATE(Double3{0, 0, 0}, Double3{500000.25, 5400000.5, 312.0});
  const auto mesh = write(sphere(64, 128, 64, {0, 0, 0}), folder / "origin.ply");
  MeshHeader header;
  const Mesh far = sphere(64, 128, 64, centre);
  header.vertices = far.vertices.size(), header.faces = far.faces.size(), header.double_positions = true;
  const auto file = create_mesh_file(folder / "sphere.ply", header);
  file->vertices(far.vertices, {});
  file->faces(far.faces);
  file->finish();
  const std::string view = GENERATE("front", "left", "top");
  RenderOptions options = one_view(folder / "sphere.ply", folder / "sphere.png");
  options.views = {view};
  const RenderReport report = render(options);
  CHECK(report.border_edges == 0);
  CHECK(report.non_manifold_edges == 0);
  CHECK(report.faces == far.faces.size());
  const Image image = read_png(folder / "sphere.png");
  REQUIRE(image.width == 400);
  REQUIRE(image.height == 300);
  // The fit leaves a margin of 10 % around the diameter.
  const double radius = 150.0 / 1.10;
  CHECK(count(image, covered) == Approx(M_PI * radius * radius).epsilon(0.01));
  CHECK(count(image, orange) == 0);
  CHECK(count(image, red) == 0);
}

TEST_CASE("render: flipped faces show the colour of back faces", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  Mesh mesh = sphere(32, 64, 32);
  for (MeshFace& f : mesh.faces) std::swap(f[1], f[2]);
  render(one_view(write(mesh, folder / "m.ply"), folder / "m.png"));
  const Image image = read_png(folder / "m.png");
  CHECK(count(image, orange) > 0.9 * count(image, covered));
}

TEST_CASE("render: borders are red, non-manifold edges magenta, and both are counted", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  const bool stl = GENERATE(false, true);  // without shared vertices the edges must be found all the same
  const std::string name = stl ? "m.stl" : "m.ply";
  SECTION("a bowl, open at the equator") {
    RenderOptions options = one_view(write(sphere(32, 64, 16), folder / name), folder / "m.png");
    const RenderReport report = render(options);
    CHECK(report.border_edges == 64);
    CHECK(report.non_manifold_edges == 0);
    const Image image = read_png(folder / "m.png");
    CHECK(count(image, red) > 200);
    CHECK(count(image, magenta) == 0);
    options.borders = "off";
    CHECK(render(options).border_edges == 0);
    CHECK(count(read_png(folder / "m.png"), red) == 0);
  }
  SECTION("three faces on one edge") {
    const Mesh fan = {{{0, 0, -1}, {0, 0, 1}, {1, 0, 0}, {-1, 0, 0}, {0, -1, 0}},
                      {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}};
    RenderOptions options = one_view(write(fan, folder / name), folder / "m.png");
    options.views = {"iso"};
    const RenderReport report = render(options);
    CHECK(report.non_manifold_edges == 1);
    CHECK(report.border_edges == 6);
    CHECK(count(read_png(folder / "m.png"), magenta) > 50);
  }
}

TEST_CASE("render: faces that cross are green where they are asked for", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  Mesh two = sphere(24, 48, 24);
  const Mesh other = sphere(24, 48, 24, {1.1, 0.03, 0.07});
  const std::uint64_t first = two.vertices.size();
  two.vertices.insert(two.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const MeshFace& f : other.faces) two.faces.push_back({first + f[0], first + f[1], first + f[2]});
  RenderOptions options = one_view(write(two, folder / "two.ply"), folder / "two.png");
  CHECK(render(options).crossing_faces == 0);
  CHECK(count(read_png(options.output), green) == 0);
  options.crossings = true;
  const RenderReport report = render(options);
  CHECK(report.crossing_faces > 60);
  CHECK(report.crossing_faces < 400);
  const int seen = count(read_png(options.output), green);
  CHECK(seen > 300);
  CHECK(seen < 20000);
  options.inputs = {write(sphere(24, 48, 24), folder / "one.ply").string()};
  CHECK(render(options).crossing_faces == 0);
  CHECK(count(read_png(options.output), green) == 0);
}

TEST_CASE("render: a room is seen from inside, its near wall cut away", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  Mesh mesh = sphere(32, 64, 28);  // a small opening below
  for (MeshFace& f : mesh.faces) std::swap(f[1], f[2]);
  RenderOptions options = one_view(write(mesh, folder / "m.ply"), folder / "m.png");
  options.borders = "on";
  render(options);
  const Image inside = read_png(folder / "m.png");
  CHECK(count(inside, orange) == 0);
  CHECK(count(inside, covered) > 40000);
  options.backs = "show";
  render(options);
  const Image outside = read_png(folder / "m.png");
  CHECK(count(outside, orange) > 0.9 * count(outside, covered));
}

TEST_CASE("render: light tubes make stripes on what is round, highlights are brighter on lacquer",
          "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  // Jumps of brightness along the middle row, and the brightest pixel.
  const auto drawn = [&](const Mesh& mesh, const std::string& shade) {
    RenderOptions options = one_view(write(mesh, folder / "m.ply"), folder / "m.png");
    options.smooth = true;
    options.occlusion = 0.0;
    options.shade = shade;
    render(options);
    const Image image = read_png(folder / "m.png");
    // The sphere's middle: nothing of the background.
    const int left = image.width / 2 - 60, right = image.width / 2 + 60, middle = image.height / 2;
    int jumps = 0, brightest = 0;
    for (int x = left + 3; x < right; ++x)
      if (std::abs(image.pixel(x, middle)[1] - image.pixel(x - 3, middle)[1]) > 60) ++jumps;
    for (int y = middle - 60; y < middle + 60; ++y)
      for (int x = left; x < right; ++x) brightest = std::max(brightest, int{image.pixel(x, y)[1]});
    return std::pair(jumps, brightest);
  };
  const Mesh round = sphere(128, 256, 128);
  const auto [plain_jumps, plain_bright] = drawn(round, "plain");
  const auto [line_jumps, line_bright] = drawn(round, "lines");
  const auto [gloss_jumps, gloss_bright] = drawn(round, "gloss");
  CHECK(plain_jumps < 10);
  CHECK(line_jumps > plain_jumps + 20);
  CHECK(gloss_bright > plain_bright + 10);
  RenderOptions options = one_view(folder / "m.ply", folder / "m.png");
  options.shade = "matt";
  CHECK_THROWS_AS(render(options), UsageError);
}

TEST_CASE("render: borders of faces below a pixel tint instead of covering", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  // Strips one cell wide with gaps as wide between them: every face has a border edge.
  const auto strips = [&](int cells) {
    Mesh mesh;
    const double step = 2.0 / cells;
    for (int i = 0; i < cells; i += 2)
      for (int j = 0; j <= cells; ++j)
        for (int side = 0; side < 2; ++side)
          mesh.vertices.push_back({(i + side) * step, 0.2 * j * step, j * step});
    const auto row = static_cast<std::uint64_t>(2 * (cells + 1));
    for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(cells / 2); ++i)
      for (std::uint64_t j = 0; j < static_cast<std::uint64_t>(cells); ++j) {
        const std::uint64_t v = i * row + 2 * j;
        mesh.faces.push_back({v, v + 1, v + 3});
        mesh.faces.push_back({v, v + 3, v + 2});
      }
    return mesh;
  };
  const auto share_of_red = [&](int cells) {
    render(one_view(write(strips(cells), folder / "m.ply"), folder / "m.png"));
    const Image image = read_png(folder / "m.png");
    return count(image, red) / (300.0 / 1.1 * 300.0 / 1.1);
  };
  CHECK(share_of_red(20) > 0.1);  // cells of 14 pixels
  CHECK(share_of_red(20) < 0.5);
  CHECK(share_of_red(600) < 0.7);  // half a pixel: all red if lines kept their width
}

TEST_CASE("render: a border behind a body stays hidden in a close-up", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  RenderOptions options = one_view(write(sphere(64, 128, 50), folder / "m.ply"), folder / "m.png");
  options.views = {"iso"};  // the eye is so close that the rest of the scene reaches behind it
  options.focus = {0.52, -0.74, 0.42, 0.1};
  CHECK(render(options).border_edges == 128);
  const Image image = read_png(folder / "m.png");
  CHECK(count(image, covered) == image.width * image.height);
  CHECK(count(image, red) == 0);
}

TEST_CASE("render: the same picture gives the same bytes", "[property]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  const auto mesh = write(sphere(48, 96, 40), folder / "m.ply");
  RenderOptions options = one_view(mesh, folder / "a.png");
  options.views.clear();
  options.captions = true;
  options.wire = GENERATE(false, true);
  render(options);
  options.output = folder / "b.png";
  render(options);
  const std::string first = bytes_of(folder / "a.png");
  CHECK(first.size() > 1000);
  CHECK((first == bytes_of(folder / "b.png")));
  const std::string command = std::string(TESSERA_BINARY) + " render " + mesh.string() +
                              " --sheet -q -t 1 --size 400x300 --samples 2 " +
                              (options.wire ? "--wire " : "") + "-o " + (folder / "c.png").string();
  REQUIRE(std::system(command.c_str()) == 0);
  CHECK((first == bytes_of(folder / "c.png")));
}

TEST_CASE("render: vertices out of memory give the same picture", "[property]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  const Mesh mesh = sphere(300, 500, 280);  // 140,000 vertices: three ranges of the least size
  std::vector<std::uint32_t> rgba;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    rgba.push_back(0xff000000u | static_cast<std::uint32_t>(i * 97));
  const auto path = write(mesh, folder / "m.ply", rgba);
  RenderOptions options = one_view(path, folder / "m.png");
  options.borders = "on";
  const auto draw = [&](std::uint64_t memory, RenderReport& report) {
    PictureOptions picture_options;
    picture_options.width = 320;
    picture_options.height = 240;
    picture_options.supersample = 1;
    PictureView view;
    view.width = 320;
    view.height = 240;
    const std::vector<Float3> around = {{-1, -1, -1}, {1, 1, 1}};
    view.camera = fit_camera(parse_view("iso", {0, 0, 1}), around, 4.0 / 3.0, 1.0);
    set_depth_range(view.camera, {-1, -1, -1}, {1, 1, 1});
    const auto item = make_mesh_item(path, options, memory, report);
    Picture picture(picture_options, std::span(&view, 1));
    picture.begin(picture_bands(picture_options, std::span(&view, 1)));
    DrawContext context;
    context.options = &options;
    item->draw(picture, context);
    Image image = blank_picture(picture_options);
    picture.finish(image);
    return image.rgb;
  };
  RenderReport in_memory, on_disk;
  const auto want = draw(0, in_memory);
  const auto got = draw(1000, on_disk);
  CHECK(in_memory.temp_bytes == 0);
  CHECK(on_disk.temp_bytes == 48 * mesh.faces.size());
  CHECK(in_memory.border_edges == 500);
  CHECK(on_disk.border_edges == 500);
  CHECK((want == got));
}

TEST_CASE("render: points by colour, stray points aside", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  std::ofstream file(folder / "plane.ply");
  const int side = 150;
  file << "ply\nformat ascii 1.0\nelement vertex " << side * side + 1
       << "\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\nproperty uchar "
          "green\n"
          "property uchar blue\nend_header\n";
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) file << i * 0.01 << ' ' << j * 0.01 << " 0 20 200 30\n";
  }
  file << "1e7 1e7 1e7 20 200 30\n";
  file.close();
  RenderOptions options = one_view(folder / "plane.ply", folder / "plane.png");
  options.views = {"top"};
  options.width = options.height = 300;
  const RenderReport report = render(options);
  CHECK(report.points == side * side + 1);
  REQUIRE(report.notices.size() == 1);
  CHECK(report.notices[0].find("stray") != std::string::npos);
  // A square of 300 / 1.10 pixels, closed: no background shines through.
  const double edge = 300.0 / 1.10;
  CHECK(count(read_png(folder / "plane.png"), [](int r, int g, int) { return g > 2 * r; }) ==
        Approx(edge * edge).epsilon(0.03));
}

TEST_CASE("render: two meshes side by side have the same camera", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  const auto mesh = write(sphere(32, 64, 24), folder / "a.ply");
  RenderOptions options = one_view(mesh, folder / "pair.png");
  options.width = 402;
  options.compare = {mesh.string()};
  CHECK(render(options).faces == 2 * sphere(32, 64, 24).faces.size());
  const Image image = read_png(folder / "pair.png");
  int different = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < 200; ++x) {
      different += std::equal(image.pixel(x, y), image.pixel(x, y) + 3, image.pixel(x + 202, y)) ? 0 : 1;
    }
  }
  CHECK(different == 0);
  CHECK(count(image, covered) > 20000);
}

TEST_CASE("render: deviation shows in the colours of the scale", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  Mesh moved = sphere(64, 128, 64);
  for (Double3& p : moved.vertices)
    for (double& c : p) c *= 1.04;
  const std::filesystem::path reference = write(sphere(64, 128, 64), folder / "reference.ply");
  RenderOptions options = one_view(write(moved, folder / "larger.ply"), folder / "out.png");
  options.deviation = reference;
  const auto drawn = [&](double tolerance, bool with_sign) {
    options.tolerance = tolerance;
    options.with_sign = with_sign;
    render(options);
    return read_png(options.output);
  };
  // Beyond the scale: magenta all over. Within, in front of the reference: towards red, else green to yellow.
  const int all = count(drawn(0.02, false), magenta);
  CHECK(all > 20000);
  const Image inside = drawn(0.06, false);
  CHECK(count(inside, magenta) == 0);
  CHECK(count(inside, [](int r, int g, int b) { return g > b + 15 && g >= r; }) > all * 8 / 10);
  const Image outside = drawn(0.05, true);
  CHECK(count(outside, [](int r, int g, int b) { return r > g + 40 && r > b + 40; }) > all * 8 / 10);
  // Without a tolerance the scale ends near the 99th percentile: nothing much lies beyond.
  CHECK(count(drawn(0.0, false), magenta) < all / 20);
}

TEST_CASE("render: what a mesh leaves out of a scan is magenta", "[pipeline]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  // A sheet of points, the mesh under its left half.
  const int side = 200;
  std::ofstream file(folder / "scan.xyz");
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j) file << i * 0.01 << ' ' << j * 0.01 << " 0.005\n";
  file.close();
  Mesh half;
  half.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 2, 0}, {0, 2, 0}};
  half.faces = {{0, 1, 2}, {0, 2, 3}};
  RenderOptions options = one_view(write(half, folder / "half.ply"), folder / "out.png");
  options.views = {"top"};
  options.borders = "off";
  CHECK(render(options).measured_points == 0);
  CHECK(count(read_png(options.output), magenta) == 0);

  options.missing = folder / "scan.xyz";
  options.missing_distance = 0.02;
  const RenderReport report = render(options);
  CHECK(report.missing_distance == 0.02);
  CHECK(report.measured_points == side * side);
  // Columns 102 to 199: those up to 1.01 lie within 0.02 of the edge of the mesh.
  CHECK(report.missing_points == 98 * side);
  CHECK(count(read_png(options.output), magenta) > 2000);
  CHECK(report.points == 0);  // the scan itself is not drawn

  // By default two spacings, which are estimated from the area that the scan covers.
  options.missing_distance = 0.0;
  const RenderReport estimated = render(options);
  CHECK(estimated.missing_distance > 0.012);
  CHECK(estimated.missing_distance < 0.03);
}

TEST_CASE("render: what cannot be drawn is refused in one sentence", "[fault]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  const auto mesh = write(sphere(8, 16, 8), folder / "m.ply");
  RenderOptions options = one_view(mesh, folder / "m.png");
  const auto message = [&] {
    try {
      render(options);
    } catch (const Error& e) {
      return std::to_string(static_cast<int>(e.code())) + " " + e.what();
    }
    return std::string("0 drawn");
  };
  CHECK(message() == "0 drawn");
  std::filesystem::remove(folder / "m.png");
  const auto refused = [&](const std::string& code, const std::string& words) {
    const std::string text = message();
    CAPTURE(text);
    CHECK(text.rfind(code, 0) == 0);
    CHECK(text.find(words) != std::string::npos);
    CHECK_FALSE(std::filesystem::exists(folder / "m.png"));
  };
  SECTION("cap too small") {
    options.memory_bytes = std::uint64_t{64} << 20;
    refused("4 ", "needs --memory");
  }
  SECTION("a distance to a scan that is not given") {
    options.missing_distance = 0.1;
    refused("2 ", "needs --missing");
  }
  SECTION("a scan beside no mesh") {
    std::ofstream(folder / "m.xyz") << "0 0 0\n1 0 0\n0 1 0\n";
    options.inputs = {(folder / "m.xyz").string()};
    options.missing = folder / "m.xyz";
    refused("2 ", "--missing needs a mesh");
  }
  SECTION("unknown view") {
    options.views = {"sideways"};
    refused("2 ", "unknown view");
  }
  SECTION("turn without a number") {
    options.views = {"turn:"};
    refused("2 ", "turn:DEGREES");
  }
  SECTION("not a PNG") {
    options.output = folder / "m.jpg";
    refused("2 ", "PNG");
  }
  SECTION("too large for the rasterizer") {
    options.width = 8000;
    options.samples = 4;
    options.smooth = true;  // asks for OpenGL
    refused("2 ", "limit of the rasterizer");
  }
  SECTION("samples out of range") {
    options.samples = 9;
    refused("2 ", "from 1 to 4");
  }
  SECTION("no such file") {
    options.inputs = {(folder / "none.ply").string()};
    refused("3 ", "none.ply");
  }
  SECTION("no such folder for the picture") {
    options.output = folder / "none" / "m.png";
    refused("2 ", "none");
  }
  SECTION("a face names a vertex that is not there") {
    const std::string text =
        GENERATE("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "v 0 0 0\nv 1 0 0\nf -1 -2 -3\n");
    options.inputs = {temp.write("bad.obj", text).string()};
    refused("3 ", "bad.obj");
  }
  SECTION("nothing finite") {
    const double nan = std::nan("");
    options.inputs = {
        write({{{nan, 0, 0}, {nan, 0, 0}, {nan, 0, 0}}, {{0, 1, 2}}}, folder / "nan.ply").string()};
    refused("5 ", "nothing to draw");
  }
  SECTION("faces by height without heights still draw") {
    options.inputs = {write({{{0, 0, 0}, {1, 0, 0}, {0, 0, 0}}, {{0, 1, 2}}}, folder / "flat.ply").string()};
    options.colour = "height";
    CHECK(message() == "0 drawn");
  }
}

TEST_CASE("render: stays under its cap, and other commands do not load the rasterizer", "[memory]") {
  const test::TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  const auto mesh = write(sphere(400, 800, 380), folder / "m.ply");
  const auto peak_kb = [](const std::vector<std::string>& words) {
    std::vector<char*> arguments;
    for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    const pid_t child = ::fork();
    if (child == 0) {
      if (std::freopen("/dev/null", "w", stdout) == nullptr) ::_exit(126);
      ::execv(arguments[0], arguments.data());
      ::_exit(127);
    }
    int status = 0;
    struct rusage usage {};
    REQUIRE(::wait4(child, &status, 0, &usage) == child);
    REQUIRE(status == 0);
    return usage.ru_maxrss;
  };
  // Loaded at run time by render alone. (The peak of a small child cannot be told from this process's own.)
  CHECK(std::system("ldd " TESSERA_BINARY " | grep -q -i -E 'osmesa|llvm'") != 0);
  CHECK(std::system("ldd " TESSERA_BINARY " | grep -q libpng") == 0);
  const long cap_mb = 240;
  CHECK(peak_kb({TESSERA_BINARY, "render", mesh.string(), "-o", (folder / "m.png").string(), "--size",
                 "800x600", "--memory", std::to_string(cap_mb) + "M"}) < cap_mb * 1024);
}

}  // namespace tessera::render_test
