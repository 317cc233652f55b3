// Pictures drawn band by band: the same bytes under every cap, and no border between bands.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <string>
#include <vector>

#include "kernels/picture/picture.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "stream/render/render.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/temp_folder.h"

namespace render_bands_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("render: bands drawn one by one under a small cap have the bytes of all at once", "[property]") {
  const TempFolder temp;
  const std::filesystem::path& folder = temp.path();
  write_whole(folder / "m.ply", made_open_body(4));
  RenderOptions options;
  options.inputs = {(folder / "m.ply").string()};
  options.output = folder / "whole.png";
  options.views = {"front"};
  options.width = 1000;
  options.height = 1300;
  options.samples = 3;
  SECTION("a view of several bands") {}
  SECTION("in perspective, from near by") {
    options.views.clear();
    options.eye = Double3{1.5, -1.2, 0.8};
    options.target = Double3{0, 0, 0};
  }
  SECTION("a sheet of four views, edges and lines") {
    options.views.clear();
    options.wire = true;
  }
  SECTION("two meshes side by side") {
    write_whole(folder / "n.ply", made_bracket(4));
    options.compare = {(folder / "n.ply").string()};
    options.height = 2000;
  }
  render(options);
  const std::string whole = file_bytes(folder / "whole.png");
  options.output = folder / "bands.png";
  // The least cap that is not refused holds one band at a time.
  options.memory_bytes = 1;
  std::string refused;
  try {
    render(options);
  } catch (const ResourceError& e) {
    refused = e.what();
  }
  const std::size_t at = refused.find("needs --memory ");
  REQUIRE(at != std::string::npos);
  options.memory_bytes = (std::stoull(refused.substr(at + 15)) + 8) << 20;  // what is held here wavers
  render(options);
  CHECK(whole.size() > 10000);
  CHECK((whole == file_bytes(folder / "bands.png")));
}

TEST_CASE("picture: the border between bands does not show", "[property]") {
  PictureOptions options;
  options.width = 300;
  options.height = 240;
  options.supersample = 2;
  PictureView view;
  view.width = 300;
  view.height = 240;
  // A heap of balls, dark where they touch.
  std::vector<PictureVertex> corners;
  for (const Double3& centre :
       {Double3{0, 0, 0}, Double3{0.9, 0.3, 0.2}, Double3{-0.7, 0.5, 0.9}, Double3{0.2, -0.8, 0.7}}) {
    const Icosphere ball = icosphere(4);
    for (const auto& f : ball.faces)
      for (const std::uint32_t v : f) {
        PictureVertex p;
        const Double3& n = ball.positions[v];
        const Double3 at = centre + n;
        p.x = static_cast<float>(at[0]), p.y = static_cast<float>(at[1]), p.z = static_cast<float>(at[2]);
        set_normal(p, static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2]));
        corners.push_back(p);
      }
  }
  const std::vector<Float3> around = {{-2, -2, -2}, {2, 2, 2}};
  view.camera = fit_camera(parse_view("iso", {0, 0, 1}), around, 300.0 / 240.0, 1.6);
  set_depth_range(view.camera, {-2, -2, -2}, {2, 2, 2});
  const std::vector<PictureBand> whole = picture_bands(options, std::span(&view, 1));
  REQUIRE(whole.size() == 1);
  std::vector<PictureBand> parts;
  const int margin = 20;  // pixels: more than occlusion looks at, 0.035 of 300 and four
  for (int low = 0; low < 240; low += 48)
    parts.push_back({0, low, low + 48, std::max(low - margin, 0), std::min(low + 48 + margin, 240)});
  const auto draw = [&](const std::vector<PictureBand>& bands, std::size_t at_once) {
    Picture picture(options, std::span(&view, 1));
    Image image = blank_picture(options);
    for (std::size_t i = 0; i < bands.size(); i += at_once) {
      picture.begin(std::span(bands).subspan(i, std::min(at_once, bands.size() - i)));
      picture.triangles(corners);
      picture.finish(image);
    }
    return image.rgb;
  };
  const auto want = draw(whole, 1), got = draw(parts, 2);
  CHECK((got == draw(parts, 1)));
  CHECK((got == draw(parts, 5)));
  // Floats round otherwise where the screen begins elsewhere: a step of a byte, and samples on an outline.
  std::size_t other = 0, far = 0;
  for (std::size_t i = 0; i < want.size(); ++i) {
    const int off = std::abs(int{want[i]} - int{got[i]});
    other += off > 1, far += off > 24;
  }
  CHECK(other < want.size() / 1000);
  CHECK(far == 0);
}

}  // namespace render_bands_test
