// The main job from points in memory to a mesh file, driven stage by stage: same bytes, sound topology, islands.
#include <catch2/catch.hpp>

#include "octree/error.h"
#include "stream/check/mesh_check.h"
#include "stream/stages/scan/normals_stage.h"
#include "stream/stages/surface/closing_stages.h"
#include "stream/stages/surface/dense_bricks.h"
#include "stream/stages/surface/holes_stage.h"
#include "stream/stages/surface/loops_stage.h"
#include "stream/stages/surface/surface_stage.h"
#include "stream/stages/surface/write_stage.h"
#include "stream/stages/weld/border_stage.h"
#include "stream/stages/weld/weld_stage.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random_points.h"

namespace surface_test {

using namespace tessera;
using namespace tessera::test;

namespace {

struct MeshSetup : ChainSetup {
  int tile_cells = 0;
  bool noise = false;
  std::vector<Double3>* vertices = nullptr;  ///< filled with those of the mesh
};

struct MeshResult {
  std::string bytes;
  MeshCheck check;
  Json orient, close, surface, weld, border;
  Json holes;
  std::size_t in_parts = 0;  ///< bricks whose field is evaluated in parts
};

std::size_t count_in_parts(const JobState& job) {
  const PointStore store = PointStore::of_surface(job.work);
  const int halo = field_halo_cells(field_options(Plan::of_work(job.work), 25.0));
  std::size_t count = 0;
  for (const BrickEntry& brick : store.bricks()) {
    const TileCut cut =
        cut_tile(store, nullptr, {brick_of_key(brick.key), 1}, halo, tile_bytes_limit(job.run));
    CHECK(cut.bytes <= tile_bytes(store.bricks(), nullptr, {brick_of_key(brick.key), 1}, halo));
    count += cut.edge > 0;
  }
  return count;
}

MeshResult run_job(const std::vector<TestPoint>& points, const MeshSetup& setup) {
  const TempFolder folder;
  JobState job = chain_job(folder.path() / "work", setup);
  job.run.tile_cells = setup.tile_cells;
  job.output = folder.path() / "mesh.ply";
  std::filesystem::create_directories(job.work);
  const auto inputs = chain_inputs(points, setup);
  MeshResult result;
  const auto run = [&](const Stage& stage) { return run_stage(stage, job.work, setup.backwards); };
  run(SurveyStage(job, inputs, setup.h, 0));
  run(DistributeStage(job, inputs));
  run(OrderStage(job));
  run(*make_normals_stage(job));
  run(*make_links_stage(job));
  result.orient = run(*make_orient_stage(job));
  if (setup.options.holes != "keep") {
    run(*make_multipole_stage(job));
    run(*make_boundaries_stage(job));
    result.close = run(*make_close_stage(job));
  }
  result.in_parts = count_in_parts(job);
  result.surface = run(*make_surface_stage(job));
  result.weld = run(*make_weld_stage(job));
  result.border = run(*make_border_stage(job));
  run(*make_loops_stage(job));
  result.holes = run(*make_holes_stage(job));
  run(*make_write_stage(job));
  result.bytes = file_bytes(job.output);
  MeshReadOptions read;
  read.keep_bad_faces = true;
  if (setup.vertices)
    open_mesh_file(job.output)
        ->read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
          setup.vertices->insert(setup.vertices->end(), batch.begin(), batch.end());
        });
  result.check = check_mesh(*open_mesh_file(job.output, read), {});
  return result;
}

std::vector<TestPoint> noise_points(std::size_t count, double edge) {
  Random random(7);
  std::vector<TestPoint> points(count);
  for (TestPoint& p : points) {
    for (double& c : p.p) c = random.in(0, edge);
    p.n = {float(random.in(-1, 1)), float(random.in(-1, 1)), float(random.in(-1, 1))};
  }
  return points;
}

/// sphere_points gives repeated positions false normals; here every sample is true.
std::vector<TestPoint> true_sphere(std::size_t count, double radius, const Double3& centre) {
  auto points = sphere_points(count, radius, centre);
  for (TestPoint& p : points)
    for (std::size_t a = 0; a < 3; ++a) p.n[a] = static_cast<float>((p.p[a] - centre[a]) / radius);
  return points;
}

void check_sound(const MeshCheck& c) {
  CHECK(c.nonmanifold_edges == 0);
  CHECK(c.nonmanifold_vertices == 0);
  CHECK(c.inconsistent_edges == 0);
  CHECK(c.duplicate_faces == 0);
  CHECK(c.degenerate_faces == 0);
  CHECK(c.zero_area_faces == 0);
  CHECK(c.unreferenced_vertices == 0);
  CHECK(c.bad_index_faces == 0);
}

}  // namespace

TEST_CASE("main job: a sphere over many bricks is one closed surface, the same bytes for any tiling",
          "[property]") {
  auto points = true_sphere(80'000, 70.0, {1000.0, -37.0, 12.0});
  MeshSetup setup;
  const MeshResult want = run_job(points, setup);
  check_sound(want.check);
  CHECK(want.check.boundary_edges == 0);
  CHECK(want.check.solid());
  CHECK(want.check.total_genus == 0);
  CHECK(want.check.volume == Approx(4.0 / 3.0 * 3.14159265 * 70.0 * 70.0 * 70.0).epsilon(2e-3));

  const int tile = GENERATE(64, 128, 256);
  setup.tile_cells = tile;
  setup.backwards = tile == 64;
  setup.files = static_cast<std::size_t>(tile) / 64;
  setup.slice_points = 700 + static_cast<std::size_t>(tile);
  setup.memory = tile == 256 ? std::uint64_t{96} << 20 : std::uint64_t{4} << 30;
  shuffle(points, static_cast<std::uint64_t>(tile));
  CAPTURE(tile);
  CHECK(run_job(points, setup).bytes == want.bytes);
}

TEST_CASE("main job: pure noise has no defect and no seam, whatever the tiles", "[property]") {
  const auto points = noise_points(60'000, 80.0);
  MeshSetup setup;
  setup.options.min_component = 1;
  setup.options.outliers = "off";
  setup.tile_cells = 64;
  const MeshResult small = run_job(points, setup);
  check_sound(small.check);
  CHECK(small.check.faces > 10'000);
  setup.tile_cells = 256;
  CHECK(run_job(points, setup).bytes == small.bytes);
}

TEST_CASE("main job: dense bricks are computed in parts, the same bytes", "[property]") {
  auto points = true_sphere(900'000, 29.0, {0, 0, 0});
  std::erase_if(points, [](const TestPoint& p) { return p.p[2] > 27.0; });
  Random random(3);
  for (TestPoint& p : points)
    for (std::size_t a = 0; a < 3; ++a) p.p[a] += 0.1 * random.in(-1, 1);
  MeshSetup setup;
  setup.options.holes = GENERATE("keep", "close");  // closed holes: the rims alone are found in parts
  const MeshResult want = run_job(points, setup);
  CHECK(want.in_parts == 0);
  check_sound(want.check);
  CHECK(want.check.faces > 30'000);
  setup.memory = std::uint64_t{64} << 20;
  const MeshResult small = run_job(points, setup);
  CHECK(small.in_parts > 0);
  CHECK(small.bytes == want.bytes);
}

TEST_CASE("islands: what is mostly border and folds is a shred, but not the largest", "[unit]") {
  CHECK(is_shred({4'000, 1'000, 1'000}, 4'000, 1'000'000));
  CHECK_FALSE(is_shred({6'000, 1'000, 1'000}, 6'000, 1'000'000));
  CHECK_FALSE(is_shred({4'000, 0, 1'000}, 4'000, 1'000'000));  // closed
  CHECK_FALSE(is_shred({4'000, 1'000, 1'000}, 4'000, 4'000));
  CHECK_FALSE(is_shred({4'000, 1'000, 1'000}, 4'000, 12'000));  // a part of the scene of its own
  CHECK_FALSE(is_shred({4'000, 1'000, 50}, 4'000, 1'000'000));  // smooth: a hand, a strip of ground
  CHECK(is_shred({4'000, 1'000, 101}, 4'000, 1'000'000));
  CHECK(is_shred({1'900, 1'000, 0}, 1'900, 1'000'000));  // but a fringe
}

TEST_CASE("islands: below the limit smooth pieces stay, crumbs, strips and foil go", "[unit]") {
  const std::uint64_t limit = 1'000, largest = 1'000'000;
  const auto stays = [&](const IslandShape& i) { return island_stays(i, limit, i.faces, largest); };
  CHECK(stays({300, 60, 0}));
  CHECK(stays({300, 60, 7}));
  CHECK_FALSE(stays({300, 60, 8}));   // folds
  CHECK_FALSE(stays({300, 160, 0}));  // a strip
  CHECK_FALSE(stays({99, 20, 0}));    // a crumb
  CHECK_FALSE(stays({4'000, 1'000, 1'000}));
  CHECK(stays({4'000, 1'000, 50}));
  CHECK(island_stays({75, 0, 40}, 75, 75, 75));  // the largest, whatever it is
}

TEST_CASE("main job: islands across bricks are counted whole before they are dropped", "[unit]") {
  auto points = true_sphere(80'000, 70.0, {0, 0, 0});
  // A small ball astride the corner of eight bricks: every brick holds few of its faces.
  const auto ball = true_sphere(4'000, 8.0, {200.0, 0.0, 0.0});
  points.insert(points.end(), ball.begin(), ball.end());
  MeshSetup setup;
  setup.options.min_component = 1;
  const MeshResult all = run_job(points, setup);
  CHECK(all.check.components == 2);
  const std::uint64_t ball_faces = all.check.largest_components[1].faces;
  setup.options.min_component = ball_faces;
  CHECK(run_job(points, setup).check.components == 2);
  setup.options.min_component = ball_faces + 1;
  const MeshResult kept = run_job(points, setup);
  CHECK(kept.check.components == 1);
  CHECK(kept.weld.at("island_faces_dropped") == ball_faces);
  check_sound(kept.check);
}

TEST_CASE("main job: small holes are filled, the same bytes for any tiling, larger ones stay", "[property]") {
  // Holes at the corner of eight bricks, at a face, inside a brick, and one that is too large.
  struct Cap {
    Double3 axis;
    double cosine;
  };
  const Double3 centre = {1000.0, -37.0, 12.0};
  const Cap caps[] = {
      {{0.577, 0.577, 0.577}, 0.985}, {{1, 0, 0}, 0.99}, {{-0.6, 0, 0.8}, 0.995}, {{0, -1, 0}, 0.7}};
  auto points = true_sphere(80'000, 70.0, centre);
  std::erase_if(points, [&](const TestPoint& p) {
    return std::any_of(std::begin(caps), std::end(caps), [&](const Cap& c) {
      double dot = 0.0;
      for (std::size_t a = 0; a < 3; ++a) dot += c.axis[a] * (p.p[a] - centre[a]) / 70.0;
      return dot > c.cosine;
    });
  });
  MeshSetup setup;
  const MeshResult open = run_job(points, setup);
  REQUIRE(open.check.boundary_loops == 4);
  CHECK(open.holes.at("filled") == 0);
  CHECK(open.bytes.find("synthetic") == std::string::npos);
  setup.options.max_hole = "250";
  const MeshResult want = run_job(points, setup);
  check_sound(want.check);
  CHECK(want.check.boundary_loops == 1);
  CHECK(want.check.boundary_edges > 250);
  CHECK(want.holes.at("filled") == 3);
  CHECK(want.check.faces == open.check.faces + want.holes.at("faces").get<std::uint64_t>());
  CHECK(want.bytes.find("property uchar synthetic\n") != std::string::npos);

  setup.tile_cells = GENERATE(64, 256);
  setup.backwards = setup.tile_cells == 64;
  setup.memory = setup.tile_cells == 256 ? std::uint64_t{192} << 20 : std::uint64_t{4} << 30;
  shuffle(points, static_cast<std::uint64_t>(setup.tile_cells));
  CHECK(run_job(points, setup).bytes == want.bytes);
}

TEST_CASE("main job: the outer border of open ground is no hole, however rough and however long holes may be",
          "[property]") {
  Random random(4);
  std::vector<TestPoint> points;
  for (int i = 0; i < 90; ++i)
    for (int j = 0; j < 90; ++j) {
      const double x = 0.7 * i + 0.1 * random.unit(), y = 0.7 * j + 0.1 * random.unit();
      if ((x - 30) * (x - 30) + (y - 30) * (y - 30) < 64.0) continue;  // a hole amid it
      TestPoint p;
      p.p = {x, y, 4.0 * std::sin(0.2 * x) * std::cos(0.15 * y) + 0.15 * random.gaussian()};
      points.push_back(p);
    }
  MeshSetup setup;
  setup.options.max_hole = "1000";
  const MeshResult result = run_job(points, setup);
  CHECK(result.holes.at("refused_outer").get<int>() >= 1);
  CHECK(result.holes.at("filled").get<int>() >= 1);
  CHECK(result.check.boundary_loops == 1);
  CHECK(result.check.boundary_edges > 150);
}

TEST_CASE("main job: a hole stays open where its filling would cross what stands in it", "[property]") {
  struct Hole {
    double radius, pole;
    const char* edges;
  };
  const bool pole = GENERATE(false, true);
  // With a long rim, and with a short one.
  const Hole hole = GENERATE(Hole{10.0, 3.0, "160"}, Hole{3.5, 1.6, "50"});
  CAPTURE(pole, hole.radius);
  const int side = static_cast<int>(300 * hole.radius / 10.0);
  const double middle = 0.2333 * side;
  std::vector<TestPoint> points;
  for (int i = 0; i < side * side; ++i) {
    const double x = 0.5 * (i % side), y = 0.5 * (i / side);
    if (std::hypot(x - middle, y - middle) > hole.radius)
      points.push_back({{x, y, 30.0}, {0.0f, 0.0f, 1.0f}});
  }
  for (int i = 0; pole && i < 40 * 60; ++i) {
    const double a = 2.0 * 3.14159265358979 * (i % 40) / 40, x = std::cos(a), y = std::sin(a);
    points.push_back({{middle + hole.pole * x, middle + hole.pole * y, 15.0 + 0.5 * (i / 40)},
                      {static_cast<float>(x), static_cast<float>(y), 0.0f}});
  }
  MeshSetup setup;
  setup.options.max_hole = hole.edges;
  const MeshResult result = run_job(points, setup);
  check_sound(result.check);
  CHECK(result.holes.at("left_crossing") == (pole ? 1 : 0));
  // The outer border stays in any case; the ends of the pole are small enough to be closed.
  CHECK(result.check.boundary_loops == (pole ? 2u : 1u));
  CHECK(result.holes.at("filled") == (pole ? 2 : 1));
}

TEST_CASE("main job: copies of a scan in clumps are named where no surface comes of them", "[fault]") {
  Random random(6);
  std::vector<TestPoint> points;
  for (int i = 0; i < 5000; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / 5000, angle = 2.399963229728653 * i, r = std::sqrt(1.0 - z * z);
    for (int k = 0; k < 10; ++k) {
      TestPoint p;
      p.p = {3000.0 * r * std::cos(angle) + 0.4 * random.gaussian(),
             3000.0 * r * std::sin(angle) + 0.4 * random.gaussian(), 3000.0 * z + 0.4 * random.gaussian()};
      points.push_back(p);
    }
  }
  MeshSetup setup;
  setup.options.outliers = "off";
  CHECK_THROWS_WITH(run_job(points, setup), Catch::Contains("clumps of about 9") &&
                                                Catch::Contains("--thin") &&
                                                !Catch::Contains("lower --min-component"));
}

TEST_CASE("main job: filling the holes of pure noise leaves a manifold", "[property]") {
  MeshSetup setup;
  setup.options.min_component = 1;
  setup.options.outliers = "off";
  // Short loops every brick finds alone, longer ones are matched over all.
  setup.options.max_hole = GENERATE("80", "40");
  const MeshResult result = run_job(noise_points(20'000, 60.0), setup);
  CHECK(result.check.nonmanifold_edges == 0);
  CHECK(result.check.nonmanifold_vertices == 0);
  CHECK(result.check.inconsistent_edges == 0);
  CHECK(result.check.duplicate_faces == 0);
  CHECK(result.check.degenerate_faces == 0);
  CHECK(result.check.unreferenced_vertices == 0);
  CHECK(result.holes.at("filled") > 20);
}

TEST_CASE("main job: holes are closed, the same bytes for any tiling, also where bricks hold no point",
          "[property]") {
  // The cap that is missing spans several bricks.
  auto points = true_sphere(150'000, 100.0, {1000.0, -37.0, 12.0});
  std::erase_if(points, [](const TestPoint& p) { return p.p[2] > 12.0 + 60.0; });
  MeshSetup setup;
  const MeshResult open = run_job(points, setup);
  CHECK(open.check.boundary_edges > 100);
  CHECK(open.surface.at("synthetic_faces") == 0);
  setup.options.holes = "close";
  const MeshResult want = run_job(points, setup);
  check_sound(want.check);
  CHECK(want.check.boundary_edges == 0);
  CHECK(want.check.components == 1);
  CHECK(want.check.total_genus == 0);
  CHECK(want.close.at("kind") == "solid");
  CHECK(want.close.at("rounds").get<int>() > 1);
  // The cap comes back: its area is 2 pi 100 40, an oblique surface has about three faces a square cell.
  CHECK(want.surface.at("synthetic_faces").get<double>() ==
        Approx(3.1 * 2 * 3.14159 * 100.0 * 40.0).epsilon(0.1));
  CHECK(want.check.volume == Approx(3.14159265 * 4.0 / 3.0 * 1e6).epsilon(5e-4));
  const int tile = GENERATE(64, 128);
  setup.tile_cells = tile;
  setup.backwards = tile == 64;
  setup.threads = tile == 64 ? 1 : 3;
  setup.memory = tile == 64 ? std::uint64_t{96} << 20 : std::uint64_t{4} << 30;
  shuffle(points, static_cast<std::uint64_t>(tile));
  CAPTURE(tile);
  CHECK(run_job(points, setup).bytes == want.bytes);
}

TEST_CASE("main job: scans that contradict each other close without handles, the same bytes for any tiling",
          "[property]") {
  // Two noisy scans, of which the second lies deeper and ends in rags; a cap is missing of both.
  auto points = true_sphere(60'000, 60.0, {1000.0, -37.0, 12.0});
  std::uint32_t state = 1;
  const auto random = [&] {
    return static_cast<double>((state = state * 1664525u + 1013904223u) >> 8) / (1 << 24);
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    Double3 out;
    for (std::size_t a = 0; a < 3; ++a) out[a] = (points[i].p[a] - Double3{1000.0, -37.0, 12.0}[a]) / 60.0;
    const double off = (random() + random() - 1.0) * 0.7 - (i % 2 == 0 ? 2.5 : 0.0);
    for (std::size_t a = 0; a < 3; ++a) points[i].p[a] += off * out[a];
  }
  std::size_t index = 0;
  std::erase_if(points, [&](const TestPoint& p) {
    const double x = p.p[0] - 1000.0, z = p.p[2] - 12.0;
    return z > 40.0 || (index++ % 2 == 0 && (x < 0.0 || std::fmod(z + 60.0, 14.0) < 6.0));
  });
  MeshSetup setup;
  setup.options.holes = "close";
  const MeshResult want = run_job(points, setup);
  CHECK(want.check.boundary_edges == 0);
  CHECK(want.check.components == 1);
  CHECK(want.check.total_genus == 0);
  CHECK(want.close.at("forced_nodes").get<int>() > 10);
  setup.tile_cells = 64;
  setup.backwards = true;
  setup.threads = 3;
  setup.memory = std::uint64_t{96} << 20;
  shuffle(points, 5);
  CHECK(run_job(points, setup).bytes == want.bytes);
}

TEST_CASE("main job: --holes fill-to closes the holes that are small enough, whole", "[unit]") {
  // One cap of radius 57 and one of radius 15.
  auto points = true_sphere(80'000, 70.0, {0.0, 0.0, 0.0});
  std::erase_if(points, [](const TestPoint& p) { return p.p[2] > 40.0 || p.p[0] > 68.4; });
  MeshSetup setup;
  setup.options.radius = 3.625;  // so that the rims of both holes end as far within the data
  const MeshResult open = run_job(points, setup);
  CHECK(open.check.boundary_loops == 2);
  setup.options.holes = "fill-to:20";
  const MeshResult part = run_job(points, setup);
  check_sound(part.check);
  CHECK(part.check.boundary_loops == 1);
  CHECK(part.close.at("unfinished_cells").get<int>() > 1000);
  const double faces = part.surface.at("synthetic_faces").get<double>();
  CHECK(faces == Approx(2 * 3.14159 * 19.5 * 19.5).epsilon(0.2));
  for (const char* bad : {"fill", "fill-to", "fill-to:", "fill-to:-1", "fill-to:x", "fill-to:1e999", ""})
    CHECK_THROWS_AS(HolesMode(bad), UsageError);
  setup.options.holes = "fill-to:600";
  CHECK_THROWS_AS(run_job(points, setup), UsageError);
}

TEST_CASE("main job: an open sheet keeps its outer border, its holes are closed", "[unit]") {
  Random random(5);
  std::vector<TestPoint> points(80'000);
  for (TestPoint& p : points) {
    p.p = {random.in(0, 170), random.in(0, 170), 0.0};
    p.p[2] = 4.0 * std::sin(p.p[0] / 20.0);
    const double slope = 0.2 * std::cos(p.p[0] / 20.0), size = std::sqrt(1 + slope * slope);
    p.n = {static_cast<float>(-slope / size), 0.0f, static_cast<float>(1 / size)};
  }
  std::erase_if(points, [](const TestPoint& p) { return std::hypot(p.p[0] - 70, p.p[1] - 80) < 16.0; });
  MeshSetup setup;
  setup.options.holes = "close";
  const MeshResult mesh = run_job(points, setup);
  check_sound(mesh.check);
  CHECK(mesh.close.at("kind") == "sheet");
  CHECK(mesh.check.boundary_loops == 1);
  CHECK(mesh.surface.at("synthetic_faces").get<double>() == Approx(2 * 3.14159 * 18.0 * 18.0).epsilon(0.2));
}

TEST_CASE("main job: a noisy scan ends in a smooth line, the same bytes for any tiling", "[property]") {
  Random random(5);
  std::vector<TestPoint> points(60'000);
  for (TestPoint& p : points) {
    p.p = {random.in(0, 150), random.in(0, 150), 30.0 + random.in(-0.4, 0.4)};
    p.n = {0.0f, 0.0f, 1.0f};
  }
  std::erase_if(points, [](const TestPoint& p) { return std::hypot(p.p[0] - 70, p.p[1] - 64) < 12.0; });
  MeshSetup setup;
  setup.options.border = "raw";
  const MeshResult raw = run_job(points, setup);
  CHECK(raw.border.at("moved_vertices") == 0);
  setup.options.border = "auto";
  const MeshResult smooth = run_job(points, setup);
  check_sound(smooth.check);
  CHECK(smooth.check.faces == raw.check.faces);
  CHECK(smooth.check.boundary_edges == raw.check.boundary_edges);
  CHECK(smooth.border.at("torn_bricks") == 0);
  CHECK(smooth.border.at("moved_vertices") > smooth.check.boundary_edges * 9 / 10);
  CHECK(smooth.bytes != raw.bytes);
  setup.tile_cells = GENERATE(64, 256);
  setup.backwards = setup.tile_cells == 64;
  setup.memory = setup.tile_cells == 256 ? std::uint64_t{128} << 20 : std::uint64_t{4} << 30;
  shuffle(points, 3);
  CHECK(run_job(points, setup).bytes == smooth.bytes);
}

TEST_CASE("main job: of a noisy scan slits narrower than the support are bridged, holes stay, for any tiling",
          "[property]") {
  Random random(5);
  std::vector<TestPoint> points;
  for (int i = 0; i < 300 * 300; ++i)
    points.push_back({{0.5 * (i % 300), 0.5 * (i / 300), 30.0 + random.in(-0.1, 0.1)}, {0.0f, 0.0f, 1.0f}});
  // Slits of ten cells, one across the corner of four bricks, and a round hole.
  const auto slit = [](const TestPoint& p, double x, double y) {
    return std::abs(p.p[0] - x) < 5.0 && std::abs(p.p[1] - y) < 2.3;
  };
  std::erase_if(points, [&](const TestPoint& p) {
    return slit(p, 64, 64) || slit(p, 30, 100) || slit(p, 127, 20) ||
           std::hypot(p.p[0] - 100, p.p[1] - 100) < 9.0;
  });
  MeshSetup setup;
  setup.options.max_hole = "0";
  const MeshResult open = run_job(points, setup);
  REQUIRE(open.check.boundary_loops >= 5);
  setup.options.max_hole = "auto";
  const MeshResult want = run_job(points, setup);
  check_sound(want.check);
  CHECK(want.check.boundary_loops == 2);
  CHECK(want.holes.at("filled") == open.check.boundary_loops - 2);
  setup.tile_cells = GENERATE(64, 256);
  setup.backwards = setup.tile_cells == 64;
  setup.memory = setup.tile_cells == 256 ? std::uint64_t{192} << 20 : std::uint64_t{4} << 30;
  shuffle(points, static_cast<std::uint64_t>(setup.tile_cells));
  CHECK(run_job(points, setup).bytes == want.bytes);
}

TEST_CASE("main job: without closing no vertex is farther from the data than the support radius", "[unit]") {
  auto points = true_sphere(12'000, 27.0, {0.0, 0.0, 0.0});
  std::erase_if(points, [](const TestPoint& p) { return p.p[2] > 20.0 || p.p[0] < -22.0; });
  MeshSetup setup;
  std::vector<Double3> vertices;
  setup.vertices = &vertices;
  const MeshResult open = run_job(points, setup);
  CHECK(open.check.boundary_loops == 2);
  double worst = 0;
  for (const Double3& v : vertices) {
    double minimum = 1e300;
    for (const TestPoint& p : points) {
      double d2 = 0;
      for (std::size_t a = 0; a < 3; ++a) d2 += (p.p[a] - v[a]) * (p.p[a] - v[a]);
      minimum = std::min(minimum, d2);
    }
    worst = std::max(worst, minimum);
  }
  CHECK(std::sqrt(worst) < 3.0);
  CHECK(vertices.size() > 1000);
}

TEST_CASE("main job: cleaning takes strays, not the sparse part of a scan whose density varies", "[unit]") {
  Random random(6);
  std::vector<TestPoint> points;
  const auto add = [&](double x, double y, double z) { points.push_back({{x, y, z}, {0.0f, 0.0f, 1.0f}}); };
  for (int i = 0; i < 60'000;) {  // beside the scanner: 21 points a cell
    const double x = random.in(-30, 30), y = random.in(-30, 30);
    if (x * x + y * y < 900.0) add(x, y, 0.0), ++i;
  }
  for (double y = -85; y < 85; y += 1.5)
    for (double x = -85; x < 85; x += 1.5) add(x + random.in(0, 0.5), y + random.in(0, 0.5), 0.0);
  for (int i = 0; i < 300; ++i) add(random.in(-80, 80), random.in(-80, 80), random.in(10, 60));
  const MeshResult mesh = run_job(points, {});
  check_sound(mesh.check);
  CHECK(mesh.orient.at("outliers_dropped").get<int>() >= 300);
  CHECK(mesh.orient.at("outliers_dropped").get<int>() < 1000);  // a few at the rim too
  CHECK(mesh.check.components == 1);
  CHECK(mesh.check.boundary_loops == 1);
  CHECK(mesh.check.area == Approx(170.0 * 170.0).epsilon(0.03));
}

}  // namespace surface_test
