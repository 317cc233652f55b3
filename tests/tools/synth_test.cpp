#include <catch2/catch.hpp>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "kernels/scene/scene.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "stream/check/truth.h"
#include "stream/commands/synth.h"
#include "stream/files/json.h"
#include "stream/formats/points/point_source.h"
#include "stream/meshes/scene_file.h"
#include "tests/helpers/temp_folder.h"

namespace synth_test {

using namespace tessera;
using test::file_bytes;
using test::TempFolder;

namespace {

std::ptrdiff_t files_in(const TempFolder& folder) {
  return std::distance(std::filesystem::directory_iterator(folder.path()), {});
}

PointChunk read_all(const std::filesystem::path& path, PointFileInfo* info = nullptr) {
  const auto file = open_point_file(path, {});
  if (info) *info = file->info();
  PointChunk all;
  for (const auto& slice : file->slices(0, std::uint64_t{1} << 40)) {
    file->read(slice, [&all](const PointChunk& c) {
      all.x.insert(all.x.end(), c.x.begin(), c.x.end());
      all.y.insert(all.y.end(), c.y.begin(), c.y.end());
      all.z.insert(all.z.end(), c.z.begin(), c.z.end());
      all.nx.insert(all.nx.end(), c.nx.begin(), c.nx.end());
      all.rgba.insert(all.rgba.end(), c.rgba.begin(), c.rgba.end());
    });
  }
  return all;
}

SynthOptions options_for(const std::string& scene, std::uint64_t points) {
  SynthOptions o;
  o.scene = scene;
  o.points = points;
  o.threads = 2;
  o.force = true;
  return o;
}

int run(const std::string& arguments, long* peak_kb = nullptr) {
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    const std::string line = std::string("exec " TESSERA_BINARY " ") + arguments + " >/dev/null 2>&1";
    ::execl("/bin/sh", "sh", "-c", line.c_str(), static_cast<char*>(nullptr));
    ::_exit(127);
  }
  int status = 0;
  rusage usage{};
  REQUIRE(::wait4(child, &status, 0, &usage) == child);
  if (peak_kb) *peak_kb = usage.ru_maxrss;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace

TEST_CASE("synth: same bytes on any number of threads, other bytes with another seed", "[property]") {
  const TempFolder folder;
  for (const std::string mode : {"surface", "terrestrial", "structured-light"}) {
    CAPTURE(mode);
    SynthOptions o = options_for(mode == "surface" ? "terrain" : "csg", 150000);
    if (mode == "structured-light") o.points = 20000;
    o.mode = mode;
    o.noise = 0.3;
    o.noise_in_spacings = true;
    o.outliers = 0.01;
    o.normals = o.colour = true;
    std::string first;
    for (const int threads : {1, 2, 5}) {
      o.threads = threads;
      synthesize(o, folder / "a.ply");
      const std::string bytes = file_bytes(folder / "a.ply") + file_bytes(folder / "a.ply.truth.json");
      if (first.empty()) first = bytes;
      CHECK((bytes == first));
    }
    o.seed = 2;
    synthesize(o, folder / "a.ply");
    CHECK((file_bytes(folder / "a.ply") + file_bytes(folder / "a.ply.truth.json") != first));
  }
}

TEST_CASE("synth: what is written is read back in every format", "[pipeline]") {
  const TempFolder folder;
  SynthOptions o = options_for("csg", 12345);
  o.normals = o.colour = true;
  const auto scene = synth::make_scene({"csg", 0, 0});
  for (const std::string name : {"a.ply", "a.xyz"}) {
    CAPTURE(name);
    const SynthReport report = synthesize(o, folder / name);
    CHECK(report.points == 12345);
    PointFileInfo info;
    const PointChunk all = read_all(folder / name, &info);
    REQUIRE(all.size() == 12345);
    if (name == "a.ply") {
      CHECK(info.declared_points == 12345);
      CHECK(info.attributes.normals);
      CHECK(info.attributes.colour);
      CHECK(all.rgba.size() == 12345);
    }
    double worst = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Double3 p{all.x[i], all.y[i], all.z[i]};
      worst = std::max(worst, norm(scene->closest(p).position - p));
    }
    CHECK(worst < (name == "a.ply" ? 2e-7 : 1e-12));  // floats in PLY, all digits in text
  }
  o.normals = false;
  o.shift = {500000.5, 5600000.25, 120};
  const SynthReport report = synthesize(o, folder / "a.las");
  PointFileInfo info;
  const PointChunk las = read_all(folder / "a.las", &info);
  REQUIRE(las.size() == 12345);
  CHECK(info.declared_points == 12345);
  REQUIRE(info.has_bounds);
  CHECK(info.declared_min[0] == Approx(500000.5 - 1.2).margin(0.01));
  CHECK(info.declared_max[2] == Approx(120 + 1.3).margin(0.01));
  double worst = 0;
  for (std::size_t i = 0; i < las.size(); ++i) {
    const Double3 p{las.x[i] - o.shift[0], las.y[i] - o.shift[1], las.z[i] - o.shift[2]};
    worst = std::max(worst, norm(scene->closest(p).position - p));
  }
  CHECK(worst < report.spacing / 1000.0);
  CHECK(read_truth(report.truth).shift == o.shift);
}

TEST_CASE("synth: PTX carries the stations and the gaps of the grid", "[pipeline]") {
  const TempFolder folder;
  SynthOptions o = options_for("indoor", 8000);
  o.mode = "terrestrial";
  o.shift = {100, 200, 0};
  o.views = 2;
  const SynthReport report = synthesize(o, folder / "room.ptx");
  PointFileInfo info;
  const PointChunk all = read_all(folder / "room.ptx", &info);
  CHECK(all.size() == report.points);
  REQUIRE(info.sensors.size() == 2);
  CHECK(info.sensors[0][0] == Approx(100.2));
  CHECK(info.sensors[0][1] == Approx(201.3));
  const Json truth = parse_json(file_bytes(report.truth));
  CHECK(truth.at("scans").size() == 2);
  CHECK(truth.at("scans")[1].at("origin")[0].get<double>() == Approx(info.sensors[1][0]));
}

TEST_CASE("synth: one file per scan holds together what one file holds", "[pipeline]") {
  const TempFolder folder;
  SynthOptions o = options_for("sphere", 5000);
  o.mode = "structured-light";
  o.views = 4;
  const SynthReport whole = synthesize(o, folder / "all.xyz");
  o.per_scan = true;
  const SynthReport parts = synthesize(o, folder / "part.xyz");
  REQUIRE(parts.files.size() == 4);
  CHECK(parts.files[2].filename() == "part_003.xyz");
  std::string joined;
  for (const auto& file : parts.files) joined += file_bytes(file);
  CHECK((joined == file_bytes(whole.files.at(0))));
  CHECK(parts.truth.filename() == "part.truth.json");
}

TEST_CASE("synth: noise and outliers are as large as asked for", "[property]") {
  const TempFolder folder;
  SynthOptions o = options_for("sphere", 100000);
  o.noise = 0.01;
  const SynthReport report = synthesize(o, folder / "noisy.xyz");
  CHECK(report.noise == 0.01);
  const PointChunk noisy = read_all(folder / "noisy.xyz");
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < noisy.size(); ++i) {
    const double d = norm(Double3{noisy.x[i], noisy.y[i], noisy.z[i]}) - 1.0;
    sum += d;
    squares += d * d;
  }
  CHECK(std::fabs(sum / 1e5) < 2e-4);
  CHECK(std::sqrt(squares / 1e5) == Approx(0.01).epsilon(0.02));

  o.noise = 0.0;
  o.outliers = 0.05;
  const SynthReport dirty = synthesize(o, folder / "dirty.xyz");
  CHECK(static_cast<double>(dirty.outliers) == Approx(5000).epsilon(0.06));
  const PointChunk points = read_all(folder / "dirty.xyz");
  std::uint64_t off = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    off += std::fabs(norm(Double3{points.x[i], points.y[i], points.z[i]}) - 1.0) > 1e-9;
  }
  CHECK(off == dirty.outliers);
}

TEST_CASE("synth: correlated noise is as deep as asked for and bends over its length", "[property]") {
  const TempFolder folder;
  SynthOptions o = options_for("sphere", 100000);
  o.noise = 0.01;
  o.noise_length = 4.0;
  o.noise_length_in_spacings = true;
  const SynthReport report = synthesize(o, folder / "noisy.xyz");
  CHECK(report.noise_length == Approx(4.0 * report.spacing));
  const PointChunk noisy = read_all(folder / "noisy.xyz");
  // Products of neighbours' noise, by distance: alike within a quarter of the length, strangers beyond two lengths.
  double squares = 0, near = 0, far = 0, near_pairs = 0, far_pairs = 0;
  std::vector<double> depth(noisy.size());
  const auto place = [&](std::size_t i) { return Double3{noisy.x[i], noisy.y[i], noisy.z[i]}; };
  for (std::size_t i = 0; i < noisy.size(); ++i) {
    depth[i] = norm(place(i)) - 1.0;
    squares += depth[i] * depth[i];
  }
  CHECK(std::sqrt(squares / 1e5) == Approx(0.01).epsilon(0.03));
  for (std::size_t i = 0; i < noisy.size(); i += 200)
    for (std::size_t j = 0; j < noisy.size(); ++j) {
      const double away = norm(place(i) - place(j)) / report.noise_length;
      if (i == j || (away > 0.25 && away < 2.5) || away > 4.0) continue;
      (away <= 0.25 ? near : far) += depth[i] * depth[j];
      (away <= 0.25 ? near_pairs : far_pairs) += 1.0;
    }
  REQUIRE(near_pairs > 500);
  CHECK(near / near_pairs > 0.75e-4);
  CHECK(std::fabs(far / far_pairs) < 0.1e-4);

  // Other threads, same bytes.
  const std::string bytes = file_bytes(folder / "noisy.xyz");
  o.threads = 3;
  o.force = true;
  synthesize(o, folder / "noisy.xyz");
  CHECK((file_bytes(folder / "noisy.xyz") == bytes));
}

TEST_CASE("synth: --spacing gives the number of points that the area needs", "[unit]") {
  const TempFolder folder;
  SynthOptions o = options_for("cube", 1);
  o.spacing = 0.02;
  const SynthReport report = synthesize(o, folder / "a.ply");
  CHECK(report.points == 60000);
  CHECK(report.spacing == Approx(0.02).epsilon(1e-6));
}

TEST_CASE("synth: nonsense is refused with exit code 2 and leaves nothing behind", "[pipeline]") {
  const TempFolder folder;
  const std::string out = " -o " + (folder / "a.ply").string();
  for (const std::string arguments :
       {"--scene teapot", "--points 0", "--points ten", "--points 1.5", "--noise x", "--noise -1",
        "--noise-length 2s", "--noise 1 --noise-length x", "--outliers 1", "--mode sonar", "--per-scan",
        "--shift 1,2", "--octaves 99", "--mode terrestrial --views -3"}) {
    CAPTURE(arguments);
    CHECK(run("synth " + arguments + out) == 2);
  }
  CHECK(run("synth --points 10") == 2);                                              // no output
  CHECK(run("synth --points 10 -o " + (folder / "a.e57").string()) == 2);            // unknown format
  CHECK(run("synth --points 10 --normals -o " + (folder / "a.las").string()) == 2);  // no normals in LAS
  CHECK(run("synth --points 10 -o " + (folder / "a.ptx").string()) == 2);            // no grid
  CHECK(run("synth --points 10 -o " + (folder / "no/such/folder/a.ply").string()) == 2);
  CHECK(files_in(folder) == 0);
  CHECK(run("synth --points 10 --normals" + out) == 0);
  CHECK(files_in(folder) == 2);
}

TEST_CASE("synth: 10 million points stream through less than 128 MB", "[memory]") {
  const TempFolder folder;
  long peak_kb = 0;
  CHECK(run("synth --points 10M --normals -t 2 -o " + (folder / "a.ply").string(), &peak_kb) == 0);
  CHECK(std::filesystem::file_size(folder / "a.ply") > 240000000);
  CHECK(peak_kb < 128 * 1024);
}

TEST_CASE("synth: a mesh is a scene, scanned from several stations and a truth for checks", "[pipeline]") {
  const TempFolder folder;
  // A pyramid with a roof of its own: every number below follows from it.
  const std::string mesh =
      folder
          .write(
              "tent.obj",
              "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 2 2 3\nf 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n")
          .string();
  SynthOptions o = options_for(mesh, 20000);
  o.normals = true;
  o.flying = 0.0;
  const auto scene = open_scene({mesh, 0, 0}, std::uint64_t{1} << 30);
  for (const std::string mode : {"surface", "terrestrial", "structured-light"}) {
    CAPTURE(mode);
    o.mode = mode;
    o.views = 5;
    const auto out = folder / (mode + ".ply");
    const SynthReport report = synthesize(o, out);
    const PointChunk points = read_all(out);
    CHECK(points.x.size() == Approx(20000.0).epsilon(0.3));
    double worst = 0.0;
    for (std::size_t i = 0; i < points.x.size(); ++i) {
      const Double3 p = {points.x[i], points.y[i], points.z[i]};
      worst = std::max(worst, norm(scene->closest(p).position - p));
    }
    CHECK(worst < 1e-5);  // floats
    if (mode == "surface") CHECK(report.area == Approx(16.0 + 4.0 * 2.0 * std::sqrt(13.0)).epsilon(0.05));
    CHECK(read_truth(report.truth).scene.name == std::filesystem::absolute(mesh).string());
    const std::string bytes = file_bytes(out);
    o.threads = 1;
    synthesize(o, folder / "one.ply");
    CHECK(file_bytes(folder / "one.ply") == bytes);
    o.threads = 2;
  }
  // Noise lies along rays, as for other scenes; the mesh that was scanned is where its truth says.
  o.mode = "terrestrial";
  o.noise = 0.01;
  synthesize(o, folder / "noisy.ply");
  const PointChunk noisy = read_all(folder / "noisy.ply");
  double squares = 0.0;
  for (std::size_t i = 0; i < noisy.x.size(); ++i) {
    const Double3 p = {noisy.x[i], noisy.y[i], noisy.z[i]};
    const Double3 off = p - scene->closest(p).position;
    squares += dot(off, off);
  }
  const double rms = std::sqrt(squares / static_cast<double>(noisy.x.size()));
  CHECK(rms > 0.002);
  CHECK(rms < 0.011);
  CHECK(run("check " + mesh + " --truth " + (folder / "noisy.ply.truth.json").string()) == 0);

  const std::string scan = " -o " + (folder / "x.ply").string();
  CHECK(run("synth --scene " + (folder / "none.ply").string() + scan) == 3);
  CHECK(run("synth --scene " + folder.write("bad.obj", "v 0 0\n").string() + scan) == 3);
  CHECK(run("synth --scene " + folder.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n").string() +
            scan) == 3);
  CHECK(run("synth --scene " + mesh + " --memory 100" + scan) == 4);
  CHECK(run("synth --scene nonsense" + scan) == 2);
  CHECK_FALSE(std::filesystem::exists(folder / "x.ply"));
}

}  // namespace synth_test
