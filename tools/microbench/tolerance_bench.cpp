// Tolerance volumes: every way of sampling one field, how they agree, permission grids of equal loss, and the share of
// triangles that the filter settles; prints JSON lines.
// tolerance_bench [REFERENCE TOLERANCE PER_TOLERANCE MESH...]   tolerance in percent of the diagonal, grid nodes per
// tolerance, meshes on the way of a decimation of the reference; the volume is a block of 128 nodes an axis
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>

#include "kernels/certify/tolerance_filter.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/surfaces.h"

namespace {

using namespace tessera;
using test::Surface;

constexpr std::size_t kTriangles = 1u << 19;
constexpr int kPerSide = 4;  // ten samples
constexpr TexturePrecision kPrecisions[] = {TexturePrecision::k8Bit, TexturePrecision::kHalf,
                                            TexturePrecision::kFloat};
constexpr const char* kNames[] = {"8 bit", "16 bit float", "32 bit float"};

double seconds_now() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

template <class Body>
double best_of(int repeats, const Body& body) {
  double best = 1e30;
  for (int i = 0; i < repeats; ++i) {
    const double start = seconds_now();
    body();
    best = std::min(best, seconds_now() - start);
  }
  return best;
}

Surface load(const std::string& path) {
  Surface s;
  const auto mesh = open_mesh_file(path);
  mesh->read_vertices([&](std::span<const Double3> p, std::span<const std::uint32_t>) {
    s.position.insert(s.position.end(), p.begin(), p.end());
  });
  mesh->read_faces([&](std::span<const MeshFace> faces) {
    for (const MeshFace& f : faces)
      s.faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                         static_cast<std::uint32_t>(f[2])});
  });
  return s;
}

Box3 box_of(const Surface& s, double margin) {
  Box3 box{s.position[0], s.position[0]};
  for (const Double3& p : s.position)
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], p[k] - margin);
      box.high[k] = std::max(box.high[k], p[k] + margin);
    }
  return box;
}

/// The faces whose corners lie in a box grown by `margin`.
Surface inside(const Surface& s, const Box3& box, double margin) {
  Surface out;
  out.position = s.position;
  for (const auto& f : s.faces) {
    bool in = true;
    for (const std::uint32_t v : f)
      for (std::size_t k = 0; k < 3; ++k)
        in = in && s.position[v][k] >= box.low[k] - margin && s.position[v][k] <= box.high[k] + margin;
    if (in) out.faces.push_back(f);
  }
  return out;
}

/// Small triangles near the surface, as a decimation tests them.
std::vector<Double3> random_triangles(const Surface& s, std::size_t count, double offset, double edge) {
  test::Random random(1);
  std::vector<Double3> corners;
  for (std::size_t i = 0; i < count; ++i) {
    const Double3 at = test::random_point(s, random.below(s.faces.size()), random);
    Double3 middle = at;
    for (double& x : middle) x += random.in(-offset, offset);
    for (int c = 0; c < 3; ++c) {
      Double3 p = middle;
      for (double& x : p) x += random.in(-edge, edge);
      corners.push_back(p);
    }
  }
  return corners;
}

GridTriangles to_grid(const ToleranceVolume& volume, const std::vector<Double3>& corners) {
  GridTriangles out;
  for (std::size_t i = 0; i < corners.size(); i += 3)
    out.add(volume.to_grid(corners[i]), volume.to_grid(corners[i + 1]), volume.to_grid(corners[i + 2]));
  return out;
}

double largest_sample(const ToleranceVolume& volume, const Double3* c) {
  double most = 0.0;
  for (int j = 0; j < kPerSide; ++j)
    for (int i = 0; i + j < kPerSide; ++i) {
      const double s = (i + static_cast<double>(kSampleOffset)) / kPerSide;
      const double t = (j + static_cast<double>(kSampleOffset)) / kPerSide;
      Double3 p;
      for (std::size_t k = 0; k < 3; ++k) p[k] = c[0][k] + s * (c[1][k] - c[0][k]) + t * (c[2][k] - c[0][k]);
      most = std::max(most, volume.interpolate(p));
    }
  return most;
}

void bench_raster(const char* way, const ToleranceVolume& volume, TexturePrecision precision,
                  ToleranceRaster& raster, const GridTriangles& triangles, const std::vector<double>& truth) {
  std::vector<float> out(triangles.size());
  const double seconds = best_of(5, [&] { raster.largest(triangles, kPerSide, out); });
  double low = 0.0, high = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double off = static_cast<double>(out[i]) - truth[i] / volume.spacing();
    low = std::min(low, off);
    high = std::max(high, off);
  }
  std::printf(
      "{\"bench\":\"tolerance\",\"way\":\"%s\",\"precision\":\"%s\",\"mtriangles_per_s\":%.2f,\"voxels_"
      "below\":%.5f,"
      "\"voxels_above\":%.5f,\"allowed_below\":%.5f,\"allowed_above\":%.5f,\"mib\":%.2f,\"renderer\":\"%s\"}"
      "\n",
      way, kNames[static_cast<int>(precision)], static_cast<double>(triangles.size()) / seconds * 1e-6, -low,
      high, volume.filter_error(precision, raster.hardware_filter()) / volume.spacing(),
      (volume.filter_error(precision, raster.hardware_filter()) + volume.texture_error(precision)) /
          volume.spacing(),
      static_cast<double>(raster.bytes()) / 1048576.0, raster.description().c_str());
}

/// Share of the points that are truly inside which a test lets pass.
template <class Test>
double passed(const ClosestFaces& reference, const std::vector<Double3>& points, double tolerance,
              const Test& test) {
  double inside = 0.0, yes = 0.0;
  for (const Double3& p : points) {
    Double3 local;
    for (std::size_t k = 0; k < 3; ++k) local[k] = p[k] - reference.origin()[k];
    const auto hit = reference.closest(local, tolerance * tolerance, ClosestFaces::kNone);
    if (hit.slot == ClosestFaces::kNone) continue;
    inside += 1.0;
    if (test(p)) yes += 1.0;
  }
  return inside > 0.0 ? yes / inside : 1.0;
}

/// On a smaller block, so that fine grids stay quick; both sizes are per volume, so their ratio is the block's.
void bench_permission(const Surface& reference_mesh, const Double3& middle, double tolerance,
                      double spacing) {
  Box3 box{middle, middle};
  for (std::size_t k = 0; k < 3; ++k) box.low[k] -= 12.0 * spacing, box.high[k] += 12.0 * spacing;
  const Surface block = inside(reference_mesh, box, 3.0 * tolerance);
  const ClosestFaces reference(block.position, block.faces, middle);
  const ToleranceVolume volume(box, reference, {.tolerance = tolerance, .spacing = spacing});
  test::Random random(5);
  std::vector<Double3> points, corners;
  for (int i = 0; i < 60000; ++i) {
    Double3 p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = random.in(box.low[k], box.high[k]);
    points.push_back(p);
    for (int c = 0; c < 3; ++c) {
      Double3 q;
      for (std::size_t k = 0; k < 3; ++k)
        q[k] = std::clamp(p[k] + random.in(-spacing, spacing), box.low[k], box.high[k]);
      corners.push_back(q);
    }
  }
  const double ours = passed(reference, points, tolerance,
                             [&](const Double3& p) { return volume.interpolate(p) <= tolerance; });
  double factor = 1.0;
  for (; factor < 6.0; factor += 0.25) {
    const PermissionGrid grid(box, reference, tolerance, volume.spacing() / factor);
    if (passed(reference, points, tolerance, [&](const Double3& p) { return grid.permits(p); }) >= ours)
      break;
  }
  const PermissionGrid grid(box, reference, tolerance, volume.spacing() / factor);
  std::size_t permitted = 0;
  const std::size_t some = points.size();
  const double seconds = best_of(3, [&] {
    permitted = 0;
    for (std::size_t i = 0; i < 3 * some; i += 3)
      permitted += grid.permits(corners[i], corners[i + 1], corners[i + 2]);
  });
  const double nodes = static_cast<double>(volume.values().size());
  std::printf(
      "{\"bench\":\"permission grid\",\"inside_let_pass\":%.4f,\"resolution_for_the_same\":%.2f,\"mib\":%.2f,"
      "\"mib_8_bit_volume\":%.2f,\"mib_16_bit_volume\":%.2f,\"mtriangles_per_s\":%.2f}\n",
      ours, factor, static_cast<double>(grid.bytes()) / 1048576.0, nodes / 1048576.0, 2.0 * nodes / 1048576.0,
      static_cast<double>(some) / seconds * 1e-6);
}

void bench_filter(const char* what, const ToleranceVolume& volume, const ClosestFaces& reference,
                  const std::vector<Double3>& corners) {
  if (corners.empty()) return;
  const auto raster = make_cpu_raster(volume, TexturePrecision::kHalf);
  std::vector<ToleranceVerdict> verdict;
  ToleranceFilterReport report;
  const double seconds = best_of(
      3, [&] { report = filter_by_volume(volume, TexturePrecision::kHalf, *raster, corners, {}, verdict); });
  // The exact way, on the same triangles.
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (std::uint32_t v = 0; v < corners.size(); v += 3) faces.push_back({v, v + 1, v + 2});
  std::vector<float> bound;
  DeviationReport exact;
  const double exact_seconds = best_of(1, [&] {
    exact = certify_deviation(
        {corners, faces}, nullptr, reference,
        {.tolerance = volume.tolerance(), .reach = volume.tolerance(), .area_unit = 1.0}, &bound);
  });
  std::size_t wrong = 0, inside = 0;
  for (std::size_t i = 0; i < verdict.size(); ++i) {
    const bool in = static_cast<double>(bound[i]) <= volume.tolerance();
    inside += in;
    wrong += verdict[i] == ToleranceVerdict::kOutside && in;
  }
  const auto n = static_cast<double>(verdict.size());
  std::printf(
      "{\"bench\":\"filter\",\"what\":\"%s\",\"triangles\":%zu,\"spacing_in_tolerances\":%.3f,\"settled\":%."
      "4f,"
      "\"inside\":%.4f,\"outside\":%.4f,\"truly_inside\":%.4f,\"wrong\":%zu,\"samples_per_triangle\":%.1f,"
      "\"mtriangles_per_s\":%.2f,\"exact_mtriangles_per_s\":%.2f}\n",
      what, verdict.size(), volume.spacing() / volume.tolerance(),
      static_cast<double>(report.inside + report.outside) / n, static_cast<double>(report.inside) / n,
      static_cast<double>(report.outside) / n, static_cast<double>(inside) / n, wrong,
      static_cast<double>(report.samples) / n, n / seconds * 1e-6, n / exact_seconds * 1e-6);
}

/// What a decimation tests: the star of a vertex after a collapse into each neighbour.
std::vector<Double3> collapse_candidates(const Surface& s, std::size_t most) {
  std::vector<std::vector<std::uint32_t>> star(s.position.size());
  for (std::uint32_t f = 0; f < s.faces.size(); ++f)
    for (const std::uint32_t v : s.faces[f]) star[v].push_back(f);
  test::Random random(3);
  std::vector<Double3> corners;
  for (std::size_t tries = 0; tries < most && corners.size() < 3 * most && !s.faces.empty(); ++tries) {
    const auto& start = s.faces[random.below(s.faces.size())];
    const std::uint32_t from = start[0], to = start[1];
    for (const std::uint32_t f : star[from]) {
      const auto& face = s.faces[f];
      if (face[0] == to || face[1] == to || face[2] == to) continue;
      for (const std::uint32_t v : face) corners.push_back(s.position[v == from ? to : v]);
    }
  }
  return corners;
}

}  // namespace

int main(int argc, char** argv) {
  setenv("LP_NUM_THREADS", "1", 0);  // figures per core
  const bool files = argc > 3;
  const Surface reference_mesh = files ? load(argv[1]) : test::sphere(7, 1.0);
  const Box3 whole = box_of(reference_mesh, 0.0);
  double diagonal = 0.0, extent = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    diagonal += (whole.high[k] - whole.low[k]) * (whole.high[k] - whole.low[k]);
    extent = std::max(extent, whole.high[k] - whole.low[k]);
  }
  diagonal = std::sqrt(diagonal);
  const double tolerance = (files ? std::atof(argv[2]) : 1.0) / 100.0 * diagonal;
  const double spacing = files ? tolerance / std::atof(argv[3]) : (extent + 4.0 * tolerance) / 124.0;
  // A block of 124 cells an axis around a place on the surface, or all of a small model.
  const Double3 middle = reference_mesh.position[reference_mesh.faces[reference_mesh.faces.size() / 2][0]];
  Box3 box = box_of(reference_mesh, 2.0 * tolerance);
  for (std::size_t k = 0; k < 3; ++k) {
    if (box.high[k] - box.low[k] <= 124.0 * spacing) continue;
    box.low[k] = std::max(box.low[k], middle[k] - 62.0 * spacing);
    box.high[k] = std::min(box.high[k], middle[k] + 62.0 * spacing);
  }
  const Surface reference_block = inside(reference_mesh, box, 3.0 * tolerance);
  const ClosestFaces reference(reference_block.position, reference_block.faces, middle);
  const double start = seconds_now();
  const ToleranceVolume volume(box, reference, {.tolerance = tolerance, .spacing = spacing});
  std::printf(
      "{\"bench\":\"volume\",\"nodes\":[%d,%d,%d],\"faces\":%zu,\"seconds\":%.3f,\"spacing_in_tolerances\":%."
      "3f,"
      "\"mean_lift_voxels\":%.4f,\"largest_lift_voxels\":%.4f}\n",
      volume.nodes()[0], volume.nodes()[1], volume.nodes()[2], reference_mesh.faces.size(),
      seconds_now() - start, spacing / tolerance, volume.mean_lift() / spacing,
      volume.largest_lift() / spacing);

  const std::vector<Double3> corners =
      random_triangles(inside(reference_mesh, box, -spacing), kTriangles, 1.5 * tolerance, 1.5 * spacing);
  const GridTriangles triangles = to_grid(volume, corners);
  std::vector<double> truth(kTriangles / 4);
  for (std::size_t i = 0; i < truth.size(); ++i) truth[i] = largest_sample(volume, &corners[3 * i]);
  const auto software = create_gl_context();
  for (const TexturePrecision precision : kPrecisions) {
    bench_raster("vectorised CPU", volume, precision, *make_cpu_raster(volume, precision), triangles, truth);
    software->make_current();
    bench_raster("OSMesa atlas", volume, precision,
                 *make_gl_raster(volume, precision, *software, GlRaster::kAtlas), triangles, truth);
    bench_raster("OSMesa one fragment", volume, precision,
                 *make_gl_raster(volume, precision, *software, GlRaster::kFragment), triangles, truth);
  }
  if (const auto gpu = find_egl_context()) {
    for (const TexturePrecision precision : kPrecisions) {
      bench_raster("EGL atlas", volume, precision, *make_gl_raster(volume, precision, *gpu, GlRaster::kAtlas),
                   triangles, truth);
      bench_raster("EGL one fragment", volume, precision,
                   *make_gl_raster(volume, precision, *gpu, GlRaster::kFragment), triangles, truth);
    }
  } else {
    std::printf("{\"bench\":\"tolerance\",\"way\":\"EGL\",\"note\":\"no GPU answers\"}\n");
  }
  software->make_current();
  {
    QueryRaster query(volume, TexturePrecision::kFloat, *software);
    GridTriangles few;
    for (std::size_t c = 0; c < 9; ++c)
      few.column[c].assign(triangles.column[c].begin(), triangles.column[c].begin() + (kTriangles / 8));
    std::vector<std::uint8_t> over(few.size());
    const auto threshold = static_cast<float>(tolerance / spacing);
    const double seconds = best_of(3, [&] { query.exceeds(few, kPerSide, threshold, over); });
    std::size_t differ = 0;
    for (std::size_t i = 0; i < over.size(); ++i) differ += (over[i] != 0) != (truth[i] > tolerance);
    std::printf(
        "{\"bench\":\"tolerance\",\"way\":\"OSMesa one occlusion query a "
        "triangle\",\"mtriangles_per_s\":%.3f,"
        "\"verdicts_that_differ\":%zu,\"of\":%zu}\n",
        static_cast<double>(few.size()) / seconds * 1e-6, differ, over.size());
  }
  bench_permission(reference_mesh, middle, tolerance, spacing);
  bench_filter(files ? argv[1] : "sphere", volume, reference,
               collapse_candidates(inside(reference_mesh, box, 0.0), 50000));
  for (int i = 4; i < argc; ++i)
    bench_filter(argv[i], volume, reference, collapse_candidates(inside(load(argv[i]), box, 0.0), 50000));
  if (!files)
    bench_filter("coarser sphere", volume, reference, collapse_candidates(test::sphere(5, 1.0), 50000));
  return 0;
}
