// Orientation as a user meets it: scans whose normals are known, stripped of them, and the report's word on
// it.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/render/doubt.h"
#include "stream/stages/scan/orient_anchors.h"
#include "stream/stages/scan/orient_solution.h"
#include "tests/helpers/command.h"
#include "tests/helpers/e57_writer.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/reconstruct_command.h"
#include "tests/helpers/serial_job.h"

namespace orient_test {

using namespace tessera::test;

namespace {

std::filesystem::path scan(const TempFolder& folder, const std::string& scene, const std::string& mode,
                           const std::string& points) {
  const auto path = folder.path() / (scene + ".ply");
  const CommandResult r = tessera_command({"synth", "--scene", scene, "--mode", mode, "--points", points,
                                           "--normals", "-o", path.string(), "-t", "2"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  return path;
}

CommandResult reconstruct(const std::filesystem::path& in, const std::filesystem::path& out,
                          const std::vector<std::string>& more) {
  std::vector<std::string> words = {"reconstruct", in.string(),  "-o",   out.string(), "--normals",
                                    "estimate",    "--progress", "none", "-q"};
  words.insert(words.end(), more.begin(), more.end());
  return tessera_command(words);
}

tessera::Json stage_entry(const std::filesystem::path& out, const std::string& name) {
  const tessera::Json report = tessera::parse_json(file_bytes(out.string() + ".report.json"));
  for (const auto& stage : report.at("stages"))
    if (stage.at("name") == name) return stage.at("result");
  return nullptr;
}
tessera::Json orient_entry(const std::filesystem::path& out) {
  return stage_entry(out, "orient");
}

}  // namespace

TEST_CASE("orient: simulated scans without normals show the right side", "[pipeline]") {
  const TempFolder folder;
  const std::string scene = GENERATE("statue", "torus", "terrain");
  const auto out = folder.path() / "mesh.ply";
  const CommandResult r =
      reconstruct(scan(folder, scene, "surface", scene == "statue" ? "300000" : "100000"), out, {});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const tessera::Json entry = orient_entry(out);
  INFO(tessera::dump_json(entry));
  CHECK(entry.at("agreement").at("fraction").get<double>() > 0.998);
}

TEST_CASE("orient: a furnished room shows inwards, with no viewpoint given", "[pipeline]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const CommandResult r = reconstruct(scan(folder, "indoor", "terrestrial", "300000"), out, {});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const tessera::Json entry = orient_entry(out);
  INFO(tessera::dump_json(entry));
  CHECK(entry.at("enclosed_fraction").get<double>() > 0.01);
  CHECK(entry.at("agreement").at("fraction").get<double>() > 0.98);
}

TEST_CASE("orient: what stays in doubt in a room is a toss of a coin, and what is decided is right",
          "[pipeline]") {
  const TempFolder folder;
  const auto in = folder.path() / "indoor.ply";
  REQUIRE(
      tessera_command({"synth", "--scene", "indoor", "--mode", "terrestrial", "--points", "300k", "--noise",
                       "0.3s", "--outliers", "0.01", "--normals", "-o", in.string(), "-t", "2"})
          .code == 0);
  const auto out = folder.path() / "mesh.ply";
  const CommandResult r = reconstruct(in, out, {});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const tessera::Json entry = orient_entry(out);
  INFO(tessera::dump_json(entry));
  REQUIRE(entry.at("scene") == "room");
  CHECK(entry.at("uncertain_fraction").get<double>() < 0.004);  // 0.0069 where nothing looks again
  CHECK(entry.at("uncertain_strewn_points").get<int>() > 0);
  CHECK(entry.at("uncertain_strewn_fraction").get<double>() < 0.001);
  const tessera::Json &all = entry.at("agreement"), &doubt = all.at("uncertain");
  const auto wrong = all.at("disagree").get<double>() - doubt.at("disagree").get<double>();
  const auto right = all.at("agree").get<double>() - doubt.at("agree").get<double>();
  CHECK(wrong / (wrong + right) < 0.004);
  CHECK(doubt.at("fraction").get<double>() < 0.6);  // 0.71 right where nothing looks again

  // What the scan is told as reaches the passes behind: rims of shadows are blunted and their holes filled.
  CHECK(stage_entry(out, "blunt").at("moved_vertices").get<int>() > 0);
  CHECK(stage_entry(out, "loops").contains("chained"));
  const tessera::Json holes = stage_entry(out, "holes");
  INFO(tessera::dump_json(holes));
  CHECK(holes.at("filled").get<int>() > 0);
  CHECK(holes.at("rounded").get<int>() > 0);
}

TEST_CASE("orient: a city scanned from the air shows upwards, roofs too, with nothing given", "[pipeline]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const CommandResult r = reconstruct(scan(folder, "city", "airborne", "150000"), out, {});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const tessera::Json entry = orient_entry(out);
  INFO(tessera::dump_json(entry));
  CHECK(entry.at("scene") == "from above");
  CHECK(entry.at("agreement").at("fraction").get<double>() > 0.997);
}

TEST_CASE("orient: a wide city is oriented block by block, the same bytes under any cap", "[pipeline]") {
  const TempFolder folder;
  const auto in = scan(folder, "city", "airborne", "300000");
  std::string bytes;
  for (const auto& [threads, cap] : {std::pair{"1", "300M"}, std::pair{"2", "1G"}}) {
    const auto out = folder.path() / (std::string("mesh") + threads + ".ply");
    const CommandResult r = reconstruct(in, out, {"--resolution", "1", "-t", threads, "--memory", cap});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const tessera::Json entry = orient_entry(out);
    INFO(tessera::dump_json(entry));
    CHECK(entry.at("scene") == "from above");
    CHECK(entry.at("anchors").get<int>() > 0);
    CHECK(entry.at("agreement").at("fraction").get<double>() > 0.997);
    if (bytes.empty()) bytes = file_bytes(out);
    CHECK(file_bytes(out) == bytes);
  }
}

TEST_CASE("orient: anchors contracted in cubes get the signs that one graph of them gives", "[pipeline]") {
  using namespace tessera;
  const TempFolder folder;
  const auto in = scan(folder, "indoor", "terrestrial", "400000");
  const auto out = folder.path() / "mesh.ply";
  REQUIRE(reconstruct(in, out, {"--resolution", "0.015", "--until", "links", "--keep"}).code == 7);
  const std::filesystem::path work = out.string() + ".tessera";
  const PointOverlay overlay(list_task_files(work / PointOverlay::kFolder, PointOverlay::kExtension));
  const std::vector<PatchBlock> blocks = list_patch_blocks(overlay);
  const PatchLinks links(work);
  const OrientationScene scene = OrientationScene::load(work / OrientationScene::kFile);
  REQUIRE_FALSE(scene.from_above);
  const SightVotes sight(work / SightVotes::kFile);
  const Viewers viewers;
  SerialContext context(work);
  AnchorsFileWriter file(context.create("anchors/000000.tsa"));
  for (std::size_t b = 0; b < blocks.size(); ++b)
    file.block(overlay.bricks()[blocks[b].first_brick].key,
               solve_block(overlay, links, b, blocks[b], scene, TopColumns(viewers.up), &sight, viewers));
  file.finish();
  const PatchAnchors anchors(work);
  const AnchorSigns whole(overlay, blocks, links, scene, anchors, &sight, context);
  const AnchorSigns cut(overlay, blocks, links, scene, anchors, &sight, context, anchors.anchor_count() / 4);
  CHECK(whole.cubes() == 1);
  CHECK(cut.cubes() > 2);
  std::size_t patches = 0, other = 0, doubt = 0, cut_doubt = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b)
    for (const PatchAnchor& a : anchors.load<PatchAnchor>(b, &AnchorsEntry::patches)) {
      const AnchorSigns::Known l = whole.of(b, a), r = cut.of(b, a);
      ++patches, other += l.sign != r.sign ? 1 : 0;
      doubt += l.uncertain || l.component != 0 ? 1 : 0, cut_doubt += r.uncertain || r.component != 0 ? 1 : 0;
    }
  CAPTURE(blocks.size(), cut.cubes(), anchors.anchor_count(), patches, other, doubt, cut_doubt);
  CHECK(other < patches / 100);
  CHECK(cut_doubt < doubt + patches / 100);
  CHECK(cut.frustrated() < whole.frustrated() + 0.002);
}

TEST_CASE("orient: what a wide room sees is found part by part, the same bytes under any cap", "[pipeline]") {
  const TempFolder folder;
  const auto in = scan(folder, "indoor", "terrestrial", "400000");
  std::string bytes;
  for (const auto& [threads, cap] : {std::pair{"1", "100M"}, std::pair{"2", "1G"}}) {
    const auto out = folder.path() / (std::string("mesh") + threads + ".ply");
    const CommandResult r = reconstruct(in, out, {"--resolution", "0.015", "-t", threads, "--memory", cap});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const tessera::Json entry = orient_entry(out);
    INFO(tessera::dump_json(entry));
    CHECK(entry.at("scene") == "room");
    CHECK(entry.at("anchors").get<int>() > 0);
    CHECK(entry.at("agreement").at("fraction").get<double>() > 0.98);
    if (bytes.empty()) bytes = file_bytes(out);
    CHECK(file_bytes(out) == bytes);
  }
}

TEST_CASE("orient: a cap that the forecast lets pass is enough for what a room sees", "[memory]") {
  const TempFolder folder;
  const auto in = scan(folder, "indoor", "terrestrial", "400000");
  const auto out = folder.path() / "mesh.ply";
  std::string cap = "40M";
  CommandResult r;
  for (int tries = 0; tries < 6; ++tries) {
    r = reconstruct(in, out, {"--resolution", "0.015", "-t", "1", "--memory", cap, "--until", "orient"});
    if (r.code != 4) break;
    INFO(cap << ": " << r.errors);
    CHECK_FALSE(std::filesystem::exists(out.string() + ".tessera/normals"));
    const auto at = r.errors.find("would do is --memory ");
    REQUIRE(at != std::string::npos);
    cap = std::to_string(std::stoull(r.errors.substr(at + 21))) + "M";
  }
  INFO(cap << ": " << r.errors);
  CHECK(r.code == 7);
}

TEST_CASE("orient: an animal of a few rings of points is an object, in one piece", "[pipeline]") {
  // Points 2 apart along rings 5 apart, as some shape collections hold; legs are three rings' distance thick.
  const TempFolder folder;
  std::string text;
  const auto limb = [&](std::array<double, 3> at, std::array<double, 3> axis, double length, double radius) {
    const int around = static_cast<int>(std::max(8.0, 6.2832 * radius / 2.0));
    const std::size_t flat = axis[2] != 0.0 ? 0 : 2;
    for (double along = 0.0; along <= length; along += 5.0)
      for (int k = 0; k < around; ++k) {
        const double angle = 6.283185307 * k / around;
        std::array<double, 3> p = at;
        for (std::size_t a = 0; a < 3; ++a) p[a] += along * axis[a];
        p[flat] += radius * std::cos(angle), p[1] += radius * std::sin(angle);
        for (const double v : p) text += std::to_string(v) + " ";
        text += "\n";
      }
  };
  limb({0, 0, 100}, {1, 0, 0}, 180, 25);
  for (const double x : {15.0, 165.0})
    for (const double y : {-14.0, 14.0}) limb({x, y, 0}, {0, 0, 1}, 80, 8);
  const auto out = folder.path() / "mesh.ply";
  const tessera::Json report = reconstructed(folder.write("animal.xyz", text), out, {});
  const tessera::Json entry = orient_entry(out);
  INFO(tessera::dump_json(entry));
  CHECK(entry.at("scene") == "object");
  CHECK(entry.at("covered_fraction").get<double>() > 0.3);
  CHECK(checked(out, folder.path()).components == 1);
}

TEST_CASE("orient: a mast has no top that stands in for it", "[pipeline]") {
  const TempFolder folder;
  Random random(7);
  std::string text;
  const auto point = [&](double x, double y, double z) {
    text += std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n";
  };
  for (int i = 0; i < 1500; ++i) {
    const double angle = random.in(0, 6.2831853);
    point(0.06 * std::cos(angle) + 0.012 * random.gaussian(),
          0.06 * std::sin(angle) + 0.012 * random.gaussian(), random.in(0, 6));
  }
  for (int i = 0; i < 300; ++i)
    point(random.in(0, 0.9), random.in(-0.12, 0.12), 6.0 + 0.012 * random.gaussian());
  const auto out = folder.path() / "mesh.ply";
  const tessera::Json report = reconstructed(folder.write("mast.xyz", text), out, {});
  const tessera::Json entry = orient_entry(out);
  INFO(tessera::dump_json(entry));
  CHECK(entry.at("scene") == "from above");
  CHECK(entry.at("level_fraction").get<double>() < 0.3);
  CHECK(entry.at("vegetation").at("as") == "surface");
  CHECK(report.at("coverage").at("confirmed").get<double>() > 0.97);
}

TEST_CASE("orient: a forest without return numbers was seen from above", "[pipeline]") {
  const TempFolder folder;
  Random random(4);
  std::string text;
  const auto point = [&](double x, double y, double z) {
    text += std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n";
  };
  for (int i = 0; i < 150000; ++i) point(random.in(0, 200), random.in(0, 200), random.in(0, 0.1));
  for (int tree = 0; tree < 250; ++tree) {
    const double x = random.in(0, 200), y = random.in(0, 200), z = random.in(25, 40);
    for (int i = 0; i < 800; ++i)
      point(x + 4.0 * random.gaussian(), y + 4.0 * random.gaussian(), z + 4.0 * random.gaussian());
  }
  const auto out = folder.path() / "mesh.ply";
  reconstructed(folder.write("forest.xyz", text), out, {});
  const tessera::Json entry = orient_entry(out);
  INFO(tessera::dump_json(entry));
  CHECK(entry.at("scene") == "from above");
  CHECK(entry.at("covered_fraction").get<double>() > 0.3);
  CHECK(entry.at("roofed_fraction").get<double>() < 0.1);
}

TEST_CASE("orient: same bytes whatever tiles, threads and cap", "[property]") {
  const TempFolder folder;
  const auto in = scan(folder, "indoor", "terrestrial", "120000");
  std::string first;
  for (const std::vector<std::string>& run : {std::vector<std::string>{"-t", "1"},
                                              {"-t", "2", "--tile-size", "64"},
                                              {"-t", "2", "--memory", "128M"}}) {
    const auto out = folder.path() / "mesh.ply";
    std::vector<std::string> more = run;
    more.push_back("--force");
    const CommandResult r = reconstruct(in, out, more);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    if (first.empty()) first = file_bytes(out);
    CHECK(file_bytes(out) == first);
  }
}

TEST_CASE("orient: too much doubt is exit code 6 and a picture, and no mesh", "[pipeline]") {
  const TempFolder folder;
  const auto in = scan(folder, "city", "terrestrial", "60000");
  const auto out = folder.path() / "mesh.ply";
  const CommandResult r = reconstruct(in, out, {"--max-uncertain", "0"});
  INFO(r.errors);
  CHECK(r.code == 6);
  CHECK(r.errors.find("--max-uncertain") != std::string::npos);
  CHECK(std::filesystem::file_size(out.string() + ".uncertain.png") > 1000);
  CHECK_FALSE(std::filesystem::exists(out));
  CHECK(std::filesystem::file_size(out.string() + ".uncertain.ply") > 1000);
}

TEST_CASE("orient: notable doubt is a warning in summary and report, and a picture", "[pipeline]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const auto in = scan(folder, "city", "terrestrial", "60000");
  const CommandResult r = tessera_command(
      {"reconstruct", in.string(), "-o", out.string(), "--normals", "estimate", "--progress", "none"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const tessera::Json entry = orient_entry(out);
  INFO(tessera::dump_json(entry));
  REQUIRE(entry.at("uncertain_fraction").get<double>() > 0.01);
  REQUIRE(entry.at("uncertain_fraction").get<double>() < 0.5);
  const tessera::Json report = tessera::parse_json(file_bytes(out.string() + ".report.json"));
  REQUIRE(report.at("warnings").size() == 1);
  CHECK(report.at("warnings")[0] == entry.at("warnings")[0]);
  CHECK(r.errors.find("warning: " + entry.at("warnings")[0].get<std::string>()) != std::string::npos);
  CHECK(std::filesystem::file_size(out.string() + ".uncertain.png") > 1000);

  // Its points colour the mesh: about the share in doubt, and not all of it.
  const std::string points = out.string() + ".uncertain.ply";
  const tessera::Doubt doubt(points, 0);
  std::size_t red = 0, all = 0;
  for (const tessera::Double3& p : read_whole(out).points) red += doubt.at(p) ? 1 : 0, ++all;
  CHECK(red > all / 500);
  CHECK(red < all / 2);
  const auto draw = [&](const std::string& png, std::vector<std::string> more) {
    more.insert(more.begin(), {"render", out.string(), "-o", png, "--size", "400x300", "--no-captions"});
    return tessera_command(more).code;
  };
  const std::string doubtful = (folder / "doubt.png").string(), plain = (folder / "plain.png").string();
  REQUIRE(draw(doubtful, {"--uncertain", points}) == 0);
  REQUIRE(draw(plain, {}) == 0);
  CHECK(file_bytes(doubtful) != file_bytes(plain));
  CHECK(draw((folder / "a.png").string(), {"--uncertain", in.string()}) == 3);
  CHECK(draw((folder / "a.png").string(), {"--uncertain", points, "--deviation", out.string()}) == 2);
}

TEST_CASE("orient: little doubt is no warning", "[pipeline]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const CommandResult r = reconstruct(scan(folder, "torus", "surface", "30000"), out, {});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const tessera::Json report = tessera::parse_json(file_bytes(out.string() + ".report.json"));
  CHECK(report.at("warnings").empty());
  CHECK_FALSE(std::filesystem::exists(out.string() + ".uncertain.png"));
  CHECK_FALSE(std::filesystem::exists(out.string() + ".uncertain.ply"));
}

TEST_CASE("orient: the pose of an E57 scan tells the side of a shell that nothing else tells", "[pipeline]") {
  // The cap of a sphere about (10, 20, 30), seen from its middle or from above its top; the scanner lies on its side.
  const TempFolder folder;
  const bool inside = GENERATE(true, false);
  const double height = inside ? 0.0 : 3.0;
  std::vector<std::vector<double>> local(3);
  for (int i = 0; i < 60000; ++i) {
    const double z = 0.5 + (i + 0.5) / 120000.0, angle = 2.399963229728653 * i, r = std::sqrt(1.0 - z * z);
    // What the quarter turn about x below undoes: y to z, z to -y.
    local[0].push_back(r * std::cos(angle));
    local[1].push_back(z - height);
    local[2].push_back(-r * std::sin(angle));
  }
  E57TestScan scan;
  scan.fields = e57_doubles(kE57Cartesian, local);
  scan.xml =
      e57_pose("0.70710678118654752", "0.70710678118654752", "0", "0", "10", "20", inside ? "30" : "33");
  scan.packets = 40;
  const auto out = folder.path() / "mesh.ply";
  const CommandResult r = reconstruct(folder.write("shell.e57", e57_file({scan})), out, {});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(orient_entry(out).at("scene") == "sensors");
  const WholeMesh mesh = read_whole(out);
  std::size_t outwards = 0;
  for (const auto& f : mesh.faces) {
    using namespace tessera;
    const Double3& a = mesh.points[f[0]];
    const Double3 normal = cross(mesh.points[f[1]] - a, mesh.points[f[2]] - a);
    outwards += dot(normal, a - Double3{10, 20, 30}) > 0 ? 1 : 0;
  }
  REQUIRE(mesh.faces.size() > 10000);
  CHECK(outwards == (inside ? 0 : mesh.faces.size()));
}

namespace {

/// Points of a ball of radius 1 with normals times what `factor` says of each.
std::string ball(const TempFolder& folder,
                 const std::function<float(const std::array<double, 3>&, std::uint32_t)>& factor) {
  constexpr std::uint32_t kPoints = 20000;
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(kPoints) + "\n";
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"})
    bytes += std::string("property float ") + name + "\n";
  bytes += "end_header\n";
  std::uint32_t chance = 1;
  for (std::uint32_t i = 0; i < kPoints; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / kPoints, angle = 2.399963229728653 * i,
                 r = std::sqrt(1.0 - z * z);
    const std::array<double, 3> d = {r * std::cos(angle), r * std::sin(angle), z};
    chance = chance * 1664525u + 1013904223u;
    const float f = factor(d, chance >> 8);
    for (const double v : d) {
      const auto position = static_cast<float>(v * (1.0 + 1e-3 * ((chance >> 16) % 100 / 50.0 - 1.0)));
      bytes.append(reinterpret_cast<const char*>(&position), sizeof position);
    }
    for (const double v : d) {
      const float n = f * static_cast<float>(v);
      bytes.append(reinterpret_cast<const char*>(&n), sizeof n);
    }
  }
  return folder.write("ball.ply", bytes).string();
}

struct Ball {
  std::uint64_t loops = 0;
  double volume = 0.0;
  tessera::Json report;
};
Ball ball_of(const TempFolder& folder, const std::string& in, const std::vector<std::string>& more = {}) {
  const auto out = folder.path() / "mesh.ply";
  std::filesystem::remove_all(folder.path() / "mesh.ply.tessera");
  std::vector<std::string> words = {"--force"};
  words.insert(words.end(), more.begin(), more.end());
  Ball b;
  b.report = reconstructed(in, out, words);
  const auto check = checked(out, folder.path());
  b.loops = check.boundary_loops;
  b.volume = check.volume;
  return b;
}

constexpr double kBall = 4.18879;

}  // namespace

TEST_CASE("orient: given normals without a common side keep their directions and get new sides",
          "[pipeline]") {
  const TempFolder folder;
  const int kind = GENERATE(0, 1, 2, 3);
  CAPTURE(kind);
  const auto in = ball(folder, [&](const std::array<double, 3>& d, std::uint32_t chance) {
    switch (kind) {
      case 0:
        return chance % 2 == 0 ? 1.0f : -1.0f;
      case 1:
        return d[0] > 0.0 ? 1.0f : -1.0f;
      case 2:
        return chance % 100 < 8 ? -1.0f : 1.0f;
      default:  // most of them missing beside
        return chance % 100 < 30 ? 0.0f : chance % 2 == 0 ? 1.0f : -1.0f;
    }
  });
  const Ball b = ball_of(folder, in);
  CHECK(b.loops == 0);
  CHECK(b.volume == Approx(kBall).epsilon(0.02));
  CHECK(b.report.at("normals").at("from") == "given directions, sides found anew");
  REQUIRE(b.report.at("warnings").size() == 1);
  CHECK_THAT(b.report.at("warnings")[0].get<std::string>(), Catch::Contains("no common side"));
}

TEST_CASE("orient: given normals that most agree on decide the side, and those asked for are taken",
          "[pipeline]") {
  const TempFolder folder;
  // Inwards, one in twelve turned: it is a hollow that is meant.
  const auto in = ball(folder, [](const std::array<double, 3>&, std::uint32_t chance) {
    return chance % 100 < 8 ? 1.0f : -1.0f;
  });
  CHECK(ball_of(folder, in).volume == Approx(-kBall).epsilon(0.02));
  const tessera::Json report = ball_of(folder, in, {"--normals", "given"}).report;
  CHECK(report.at("normals").at("from") == "given");
  CHECK_THAT(report.at("warnings")[0].get<std::string>(), Catch::Contains("as --normals given asks"));
}

TEST_CASE("orient: where many points have no normal, theirs follow the given ones around them",
          "[pipeline]") {
  const TempFolder folder;
  const float side = GENERATE(1.0f, -1.0f);
  const auto in = ball(folder, [&](const std::array<double, 3>& d, std::uint32_t chance) {
    return d[0] > 0.4 || chance % 10 == 0 ? 0.0f : side;
  });
  const Ball b = ball_of(folder, in);
  CHECK(b.loops == 0);
  CHECK(b.volume == Approx(side * kBall).epsilon(0.02));
  CHECK(b.report.at("normals").at("from") == "given, missing ones estimated");
}

TEST_CASE("orient: normals with a common side are taken as they are", "[pipeline]") {
  const TempFolder folder;
  const auto in = ball(folder, [](const std::array<double, 3>&, std::uint32_t chance) {
    return chance % 100 < 3 ? 0.0f : -2.5f;
  });
  const Ball b = ball_of(folder, in);
  CHECK(b.report.at("normals").at("from") == "given");
  CHECK(b.report.at("warnings").empty());
  CHECK(b.volume == Approx(-kBall).epsilon(0.02));
}

}  // namespace orient_test
