// tessera bake as a user runs it: the same bytes whatever must not matter, colours of the scan, textures that others can read.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "octree/error.h"
#include "octree/portable_math.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/texture_image.h"
#include "stream/import/import_mesh.h"
#include "stream/import/import_stages.h"
#include "stream/stages/bake/bake_colours.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/bake/texture_colours.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/serial_job.h"
#include "tests/helpers/shell.h"

namespace bake_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

constexpr int kSide = 40;

double height(double x, double y) {
  return 2.0 * std::sin(0.15 * x) * std::cos(0.1 * y);
}

/// Hills of coarse faces, without colours.
fs::path write_hills(const fs::path& path, bool backwards = false) {
  write_sheet(
      path, kSide,
      [](int i, int j) -> Double3 {
        return {static_cast<double>(i), static_cast<double>(j),
                static_cast<double>(static_cast<float>(height(i, j)))};
      },
      backwards);
  return path;
}

/// Sixteen points a square on the hills, as a table: red along x, green along y, a blue border amid.
fs::path write_points(const fs::path& path, bool backwards = false) {
  constexpr int kFine = 4 * kSide;
  std::string text = "x y z r g b\n";
  const int count = (kFine + 1) * (kFine + 1);
  for (int n = 0; n < count; ++n) {
    const int at = backwards ? count - 1 - n : n;
    const double x = 0.25 * (at % (kFine + 1)), y = 0.25 * (at / (kFine + 1));
    text += std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(height(x, y)) + " " +
            std::to_string(static_cast<int>(6 * x)) + " " + std::to_string(static_cast<int>(6 * y)) + " " +
            (x < 20.1 ? "20" : "220") + "\n";
  }
  std::ofstream(path) << text;
  return path;
}

std::vector<std::string> words(const fs::path& mesh, const fs::path& from, const fs::path& out,
                               const std::vector<std::string>& more = {}) {
  std::vector<std::string> w = {"bake",       mesh.string(), "--from", from.string(), "-o",
                                out.string(), "--progress",  "none",   "-q"};
  w.insert(w.end(), more.begin(), more.end());
  return w;
}

Json texture_of(const fs::path& out) {
  return parse_json(file_bytes(out.string() + ".report.json")).at("texture");
}

}  // namespace

TEST_CASE("bake: same bytes over threads, memory, order of the inputs and kills", "[property]") {
  const TempFolder folder;
  const fs::path mesh = write_hills(folder.path() / "in.ply"), from = write_points(folder.path() / "in.xyz");
  const auto run = [&](const fs::path& m, const fs::path& f, const std::vector<std::string>& more) {
    const fs::path out = folder.path() / "out.glb";
    fs::remove(out);
    const CommandResult r = tessera_command(words(m, f, out, more));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    CHECK_FALSE(fs::exists(out.string() + ".tessera"));
    return file_bytes(out);
  };
  const std::string want = run(mesh, from, {"--threads", "1"});
  CHECK(run(mesh, from, {"--threads", "2", "--memory", "200M"}) == want);
  CHECK(run(write_hills(folder.path() / "back.ply", true), write_points(folder.path() / "back.xyz", true),
            {}) == want);
  const fs::path killed = folder.path() / "killed.glb";
  const CommandResult r = resumed_after_kills(words(mesh, from, killed));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(file_bytes(killed) == want);
}

TEST_CASE("bake: colours of the points are on the texture, pages are used, nothing is flipped",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = write_hills(folder.path() / "in.ply"), from = write_points(folder.path() / "in.xyz");
  const fs::path out = folder.path() / "out.obj";
  const CommandResult r = tessera_command(words(mesh, from, out));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const Json texture = texture_of(out);
  CHECK(texture.at("texels").at("psnr_db").get<double>() > 32.0);
  CHECK(texture.at("texels").at("without_points").get<int>() == 0);
  CHECK(texture.at("charts").at("flipped").get<int>() == 0);
  CHECK(texture.at("charts").at("overlapping").get<int>() == 0);
  CHECK(texture.at("charts").at("stretch_l2").get<double>() < 1.3);
  CHECK(texture.at("scale").at("spacing").get<double>() == Approx(0.25).epsilon(0.05));
  // The page for people has the pages of the textures.
  const std::string page = file_bytes(out.string() + ".report.html");
  CHECK(page.find("alt=\"Pages of textures, small\" src=\"data:image/png;base64,") != std::string::npos);
  CHECK(page.find("of the pages used; colours at points:") != std::string::npos);
  // The files beside, and what the OBJ says of them.
  CHECK(fs::exists(folder.path() / "out.mtl"));
  CHECK(fs::exists(folder.path() / "out_0.png"));
  const std::string text = file_bytes(out);
  CHECK(text.find("mtllib out.mtl") != std::string::npos);
  CHECK(text.find("usemtl page_0") != std::string::npos);
  CHECK(file_bytes(folder.path() / "out.mtl").find("map_Kd out_0.png") != std::string::npos);
}

TEST_CASE("bake: all three formats hold the same mesh", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = write_hills(folder.path() / "in.ply"), from = write_points(folder.path() / "in.xyz");
  for (const char* name : {"a.ply", "b.obj", "c.glb"}) {
    const fs::path out = folder.path() / name;
    const CommandResult r = tessera_command(words(mesh, from, out));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    std::uint64_t faces = 0;
    open_mesh_file(out)->read_faces([&](std::span<const MeshFace> batch) { faces += batch.size(); });
    CHECK(faces == 2 * kSide * kSide);
  }
  const std::string header = file_bytes(folder.path() / "a.ply").substr(0, 600);
  CHECK(header.find("comment TextureFile a_0.png") != std::string::npos);
  CHECK(header.find("property list uchar float texcoord") != std::string::npos);
}

TEST_CASE("bake: pages as JPEG have the same bytes every time, and are near to those of PNG", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = write_hills(folder.path() / "in.ply"), from = write_points(folder.path() / "in.xyz");
  const auto run = [&](const std::string& name, const std::vector<std::string>& more) {
    const fs::path out = folder.path() / name;
    const CommandResult r = tessera_command(words(mesh, from, out, more));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return out;
  };
  const fs::path png = run("a.obj", {}), jpeg = run("b.obj", {"--page-format", "jpeg", "--threads", "2"}),
                 again = run("c.obj", {"--page-format", "jpeg", "--threads", "1"}),
                 coarse = run("d.obj", {"--page-format", "jpeg", "--quality", "50"});
  CHECK_FALSE(fs::exists(folder.path() / "b_0.png"));
  const std::string bytes = file_bytes(folder.path() / "b_0.jpg");
  CHECK(bytes == file_bytes(folder.path() / "c_0.jpg"));
  CHECK(fs::file_size(folder.path() / "d_0.jpg") < bytes.size());
  CHECK(file_bytes(folder.path() / "b.mtl").find("map_Kd b_0.jpg") != std::string::npos);
  const auto image = [&](const char* name) {
    const ReadFile file(folder.path() / name);
    return read_texture_image(file, 0, file.size());
  };
  const TextureImage exact = image("a_0.png"), packed = image("b_0.jpg");
  REQUIRE(exact.rgb.size() == packed.rgb.size());
  double squares = 0.0;
  for (std::size_t i = 0; i < exact.rgb.size(); ++i) {
    const double d = static_cast<double>(exact.rgb[i]) - packed.rgb[i];
    squares += d * d;
  }
  CHECK(std::sqrt(squares / static_cast<double>(exact.rgb.size())) < 3.0);
  const fs::path glb = run("e.glb", {"--page-format", "jpeg"});
  CHECK(file_bytes(glb).find("image/jpeg") != std::string::npos);
  CHECK(tessera_command({"check", glb.string(), "--textures"}).code == 0);
  // Damage is told.
  std::ofstream(folder.path() / "bad.jpg", std::ios::binary) << bytes.substr(0, 30);
  CHECK_THROWS_AS(image("bad.jpg"), InputError);
}

namespace {

/// Ripples on a plate, by their slopes.
double ripple(double x, double y) {
  return 0.15 * std::sin(1.1 * x) + 0.1 * std::cos(0.9 * y);
}
Double3 ripple_normal(double x, double y) {
  const Double3 n = {-0.165 * std::cos(1.1 * x), 0.09 * std::sin(0.9 * y), 1.0};
  return n / norm(n);
}

}  // namespace

TEST_CASE("bake: a normal map shows the ripples that a flat plate has lost", "[pipeline]") {
  const TempFolder folder;
  const fs::path plate = folder.path() / "plate.ply", fine = folder.path() / "fine.ply";
  write_sheet(plate, 4, [](int i, int j) -> Double3 { return {5.0 * i, 5.0 * j, 0.0}; });
  write_sheet(fine, 200, [](int i, int j) -> Double3 {
    const double x = 0.1 * i, y = 0.1 * j;
    Double3 p = {x, y, ripple(x, y)};
    for (double& c : p) c = static_cast<double>(static_cast<float>(c));
    return p;
  });
  const fs::path out = folder.path() / "out.glb";
  const CommandResult r = tessera_command(words(plate, fine, out, {"--normal-map", "--threads", "1"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const std::string glb = file_bytes(out);
  const auto word = [&](std::size_t at) {
    std::uint32_t w = 0;
    std::memcpy(&w, glb.data() + at, 4);
    return w;
  };
  const std::size_t bin = 28 + word(12);
  const Json all = parse_json(glb.substr(20, word(12)));
  CHECK_FALSE(all.contains("extensionsUsed"));  // lit: an unlit surface would not show them
  const Json& primitive = all.at("meshes")[0].at("primitives")[0];
  const auto floats = [&](const char* name, std::size_t vertex, std::size_t count) {
    const Json& accessor = all.at("accessors")[primitive.at("attributes").at(name).get<std::size_t>()];
    std::array<float, 4> v{};
    std::memcpy(v.data(), glb.data() + bin + accessor.at("byteOffset").get<std::size_t>() + 48 * vertex,
                4 * count);
    return v;
  };
  const Json& material = all.at("materials")[0];
  const auto texture = material.at("normalTexture").at("index").get<std::size_t>();
  const Json& image = all.at("images")[all.at("textures")[texture].at("source").get<std::size_t>()];
  const Json& view = all.at("bufferViews")[image.at("bufferView").get<std::size_t>()];
  const TextureImage map = read_texture_image(ReadFile(out), bin + view.at("byteOffset").get<std::uint64_t>(),
                                              view.at("byteLength").get<std::uint64_t>());
  const auto count = all.at("accessors")[0].at("count").get<std::size_t>();
  std::size_t seen = 0, off = 0;
  for (std::size_t v = 0; v < count; ++v) {
    const auto p = floats("POSITION", v, 3), n = floats("NORMAL", v, 3), t = floats("TANGENT", v, 4),
               uv = floats("TEXCOORD_0", v, 2);
    CHECK(n[1] == Approx(1.0));  // y is up
    CHECK(t[3] == 1.0f);
    const double x = p[0], y = -p[2];
    if (x < 1.0 || x > 19.0 || y < 1.0 || y > 19.0) continue;
    const auto column = static_cast<std::size_t>(uv[0] * static_cast<float>(map.size.width)),
               row = static_cast<std::size_t>(uv[1] * static_cast<float>(map.size.height));
    const std::uint8_t* c = &map.rgb[3 * (row * map.size.width + column)];
    const Double3 normal = {n[0], n[1], n[2]}, tangent = {t[0], t[1], t[2]};
    const Double3 decoded = tangent * (c[0] / 127.5 - 1.0) + cross(normal, tangent) * (c[1] / 127.5 - 1.0) +
                            normal * (c[2] / 127.5 - 1.0);
    const Double3 want = ripple_normal(x, y);
    ++seen;
    off += dot(unit_or_zero(decoded), Double3{want[0], want[2], -want[1]}) < cosine_of_degrees(3.0);
  }
  REQUIRE(seen >= 9);
  CHECK(off == 0);
  // The same bytes on all threads; OBJ has the map beside it and says so, PLY cannot hold it.
  const fs::path again = folder.path() / "again.glb";
  REQUIRE(tessera_command(words(plate, fine, again, {"--normal-map"})).code == 0);
  const fs::path told = folder.path() / "told.json";
  REQUIRE(tessera_command({"check", again.string(), "--textures", "--json", told.string()}).code == 0);
  CHECK(parse_json(file_bytes(told)).at("textures").at("pages") ==
        1);  // the map lies on the page, it is none
  CHECK(file_bytes(again) == glb);
  REQUIRE(tessera_command(words(plate, fine, folder.path() / "o.obj", {"--normal-map"})).code == 0);
  CHECK(fs::exists(folder.path() / "o_0_normal.png"));
  CHECK(file_bytes(folder.path() / "o.mtl").find("norm o_0_normal.png") != std::string::npos);
  CHECK(file_bytes(folder.path() / "o.obj").find("vn 0 0 1") != std::string::npos);
  const CommandResult ply = tessera_command(words(plate, fine, folder.path() / "o.ply", {"--normal-map"}));
  CHECK(ply.code == 2);
  CHECK(ply.errors.find("PLY has no normal maps") != std::string::npos);
}

TEST_CASE("bake: one page is full, with the finest texels that fit, whatever memory and kills",
          "[property]") {
  const TempFolder folder;
  const fs::path mesh = write_hills(folder.path() / "in.ply"), from = write_points(folder.path() / "in.xyz"),
                 out = folder.path() / "out.glb", killed = folder.path() / "killed.glb";
  for (const std::vector<std::string>& more :
       std::vector<std::vector<std::string>>{{"--one-page", "--page-size", "256"}, {}}) {
    const CommandResult r = tessera_command(words(mesh, from, out, more));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const Json texture = texture_of(out);
    const Json& pages = texture.at("pack").at("pages");
    CHECK(pages.size() == 1);
    if (!more.empty()) CHECK(pages[0] == Json::array({256, 256}));
    if (!more.empty()) CHECK(texture.at("pack").at("used_share").get<double>() > 0.5);
    CHECK(texture.at("charts").at("stretch_l2").get<double>() < 1.3);
    const CommandResult check = tessera_command({"check", out.string(), "--textures", "--strict"});
    INFO(check.errors);
    CHECK(check.code == 0);
    std::vector<std::string> other = more;
    other.insert(other.end(), {"--threads", "2", "--memory", "160M"});
    const std::vector<std::string> w = words(mesh, from, killed, other);
    const CommandResult resumed = more.empty() ? tessera_command(w) : resumed_after_kills(w);
    INFO(resumed.errors);
    REQUIRE(resumed.code == 0);
    CHECK(file_bytes(killed) == file_bytes(out));
    fs::remove(out), fs::remove(killed);
  }
  const CommandResult both = tessera_command(words(mesh, from, out, {"--one-page", "--texel", "0.1"}));
  CHECK(both.code == 2);
  CHECK(both.errors.find("--texel with --one-page") != std::string::npos);
}

TEST_CASE("bake: pages show the intensity of scans where that is asked for", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = write_hills(folder.path() / "in.ply"), from = folder.path() / "scan.ply",
                 out = folder.path() / "out.ply";
  constexpr int kFine = 4 * kSide;
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string((kFine + 1) * (kFine + 1)) +
                     "\nproperty double x\nproperty double y\nproperty double z\nproperty ushort intensity\n"
                     "end_header\n";
  for (int j = 0; j <= kFine; ++j)
    for (int i = 0; i <= kFine; ++i) {
      const double x = 0.25 * i, y = 0.25 * j;
      text += std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(height(x, y)) + " " +
              std::to_string(1000 + 50 * i) + "\n";
    }
  std::ofstream(from) << text;
  const CommandResult r = tessera_command(words(mesh, from, out, {"--colour", "intensity"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(texture_of(out).at("texels").at("psnr_db").get<double>() > 40.0);
  // Grey, from black to white.
  const fs::path page = folder.path() / "out_0.png";
  const TextureImage image = read_texture_image(ReadFile(page), 0, fs::file_size(page));
  std::array<std::size_t, 4> quarter{};
  std::size_t coloured = 0;
  for (std::size_t i = 0; i < image.rgb.size(); i += 3) {
    coloured += image.rgb[i] != image.rgb[i + 1] || image.rgb[i] != image.rgb[i + 2];
    ++quarter.at(image.rgb[i] / 64);
  }
  CHECK(coloured == 0);
  for (const std::size_t texels : quarter) CHECK(texels > image.rgb.size() / 3 / 8);
  // Colours are what is asked for by default, and meshes have no intensity.
  const CommandResult colours = tessera_command(words(mesh, from, folder.path() / "c.ply"));
  CHECK(colours.code == 3);
  CHECK(colours.errors.find("no colours") != std::string::npos);
  const CommandResult fine = tessera_command(words(mesh, write_hills(folder.path() / "fine.obj"),
                                                   folder.path() / "f.ply", {"--colour", "intensity"}));
  CHECK(fine.code == 2);
  CHECK(fine.errors.find("--colour intensity") != std::string::npos);
}

namespace {

/// Asked to stop once so many units are done.
class StoppingContext : public SerialContext {
 public:
  StoppingContext(const fs::path& work, std::uint64_t stop_at) : SerialContext(work), stop_at_(stop_at) {}
  void check_stop() const override {
    if (advanced >= stop_at_) throw StoppedError("asked to");
  }
  void advance(std::uint64_t units) override {
    SerialContext::advance(units);
    largest_step = std::max(largest_step, units);
  }
  std::uint64_t largest_step = 0;

 private:
  std::uint64_t stop_at_;
};

}  // namespace

TEST_CASE("bake: points are read and sorted with progress that moves, and a stop is heeded amid both",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path work = folder.path() / "work", coarse = write_hills(folder.path() / "in.ply"),
                 scan = write_points(folder.path() / "in.xyz"), textured = folder.path() / "textured.ply";
  fs::create_directories(work);
  const CommandResult r = tessera_command(words(coarse, scan, textured));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  JobState state;
  state.work = work;
  state.inputs = {coarse};
  state.run.memory_bytes = std::uint64_t{1} << 30;
  state.run.threads = 1;
  static_cast<void>(import_mesh(coarse, work, "mesh", state.run, {}));
  static_cast<void>(import_mesh(textured, work, "fine", state.run, {}));
  const auto fine = [&] { return open_imported_mesh(work, "fine"); };
  BakeStores stores;
  stores.mesh = [&](const JobState&) { return open_imported_mesh(work, "mesh"); };
  stores.comment = [](const JobState&) { return std::string(); };
  using Colours = std::function<std::unique_ptr<BakeColours>(const JobState&)>;
  const std::vector<std::pair<std::string, Colours>> sources = {
      {"scan", [&](const JobState&) { return colours_of_scans({scan}, {}); }},
      {"textures", [&](const JobState& s) { return colours_of_textures(textured, s); }},
      {"vertices and directions",
       [&](const JobState&) { return with_directions(colours_of_store(fine(), true), fine()); }}};
  for (const auto& [name, colours] : sources) {
    INFO(name);
    stores.colours = colours;
    const std::unique_ptr<Stage> stage = make_bake_points_stage(state, stores);
    CHECK(stage->unit_name() == "points");
    StoppingContext whole(work, ~std::uint64_t{0});
    static_cast<void>(stage->finish({}, whole));
    CHECK(whole.advanced == stage->units());
    CHECK(whole.largest_step <= stage->units() / 2);
    for (const std::uint64_t share : {1, 5, 9}) {
      INFO(share << " tenths");
      const std::unique_ptr<Stage> again = make_bake_points_stage(state, stores);
      StoppingContext stopped(work, share * stage->units() / 10);
      CHECK_THROWS_AS(again->finish({}, stopped), StoppedError);
      CHECK(stopped.advanced < stage->units());
    }
  }
}

TEST_CASE("bake: what cannot work is refused", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = write_hills(folder.path() / "in.ply"), from = write_points(folder.path() / "in.xyz");
  const auto refusal = [&](const std::vector<std::string>& w, int code) {
    const CommandResult r = tessera_command(w);
    INFO(r.errors);
    CHECK(r.code == code);
    return r.errors;
  };
  CHECK(refusal(words(mesh, from, folder.path() / "out.stl"), 2).find(".glb, .obj or .ply") !=
        std::string::npos);
  CHECK(refusal({"bake", mesh.string(), "-o", (folder.path() / "out.glb").string()}, 2)
            .find("--from is missing") != std::string::npos);
  CHECK(refusal(words(mesh, mesh, folder.path() / "out.glb"), 3).find("no colours") != std::string::npos);
  CHECK(refusal(words(mesh, from, folder.path() / "normals.glb", {"--normal-map"}), 3)
            .find("its points have no normals") != std::string::npos);
  CHECK(refusal(words(mesh, from, folder.path() / "out.glb", {"--page-size", "1000"}), 2)
            .find("no power of two") != std::string::npos);
  CHECK_FALSE(fs::exists(folder.path() / "out.glb"));
}

}  // namespace bake_test
