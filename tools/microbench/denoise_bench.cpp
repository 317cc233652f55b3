// What denoising does to a mesh with noise of known size: its vertices' distance to the clean mesh before and after, faces
// that lie against it, seconds. The whole mesh as one block; one line a mesh.
// denoise_bench [key=value]... MESH...
//   noise=0.2    standard deviation along each axis, in mean edges
//   given=0      what denoising is told of it, in mean edges; 0: it measures
//   lambda=0     of the plate at the end; 0: the method's own
//   steps=1 seed=7 repeat=1 method=denoise out=FILE.ply
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "kernels/smooth/flipped_faces.h"
#include "kernels/smooth/smooth.h"
#include "octree/vector.h"
#include "stream/files/scratch_folder.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/import/import_mesh.h"
#include "stream/runtime/options.h"
#include "tools/microbench/thread_seconds.h"

namespace {

using namespace tessera;

MeshBlock load(const std::string& path) {
  const ScratchFolder scratch(std::filesystem::temp_directory_path(), "denoise");
  RunOptions run;
  run.memory_bytes = std::uint64_t{4} << 30;
  run.threads = 1;
  const MeshStore store = import_mesh(path, scratch.path(), "mesh", run, {});
  std::vector<std::size_t> every(store.patches().size());
  for (std::size_t p = 0; p < every.size(); ++p) every[p] = p;
  return store.load(every);
}

double mean_edge(const MeshBlock& mesh) {
  double sum = 0.0;
  for (const auto& f : mesh.faces)
    for (std::size_t k = 0; k < 3; ++k) sum += norm(mesh.position[f[k]] - mesh.position[f[(k + 1) % 3]]);
  return sum / (3.0 * static_cast<double>(mesh.faces.size()));
}

struct Distances {
  double mean = 0.0, rms = 0.0, maximum = 0.0;
};

Distances distances(const ClosestFaces& truth, const std::vector<Double3>& position) {
  Distances d;
  std::uint32_t hint = ClosestFaces::kNone;
  for (const Double3& p : position) {
    const auto hit = truth.closest(p - truth.origin(), 1e300, hint);
    hint = hit.slot;
    d.mean += std::sqrt(hit.square);
    d.rms += hit.square;
    d.maximum = std::fmax(d.maximum, hit.square);
  }
  const auto n = static_cast<double>(position.size());
  return {d.mean / n, std::sqrt(d.rms / n), std::sqrt(d.maximum)};
}

/// Faces whose normal is against those of the faces of the truth nearest to their middle and to each corner.
std::size_t flipped(const ClosestFaces& truth, const MeshBlock& mesh, const std::vector<Double3>& position) {
  std::size_t count = 0;
  std::uint32_t hint = ClosestFaces::kNone;
  for (const auto& f : mesh.faces) {
    const Double3 &a = position[f[0]], &b = position[f[1]], &c = position[f[2]];
    bool against = true;
    for (const Double3& p : {(a + b + c) * (1.0 / 3.0), a, b, c}) {
      hint = truth.closest(p - truth.origin(), 1e300, hint).slot;
      const auto t = truth.corners(hint);
      against = against && !(dot(triangle_normal(a, b, c), triangle_normal(t[0], t[1], t[2])) > 0.0);
    }
    count += against;
  }
  return count;
}

void write(const MeshBlock& mesh, const std::vector<Double3>& position, const std::string& path) {
  MeshHeader header;
  header.vertices = position.size();
  header.faces = mesh.faces.size();
  const auto out = create_mesh_file(path, header);
  out->vertices(position, {});
  std::vector<MeshFace> faces;
  for (const auto& f : mesh.faces) faces.push_back({f[0], f[1], f[2]});
  out->faces(faces);
  out->finish();
}

}  // namespace

int main(int argc, char** argv) {
  std::map<std::string, std::string> value = {{"noise", "0.2"}, {"given", "0"}, {"lambda", "0"},
                                              {"steps", "1"},   {"seed", "7"},  {"method", "denoise"},
                                              {"repeat", "1"},  {"out", ""}};
  const auto number = [&](const char* key) { return std::atof(value[key].c_str()); };
  for (int i = 1; i < argc; ++i) {
    if (const char* equals = std::strchr(argv[i], '=')) {
      value[std::string(argv[i], static_cast<std::size_t>(equals - argv[i]))] = equals + 1;
      continue;
    }
    const MeshBlock clean = load(argv[i]);
    const double edge = mean_edge(clean), deviation = number("noise") * edge;
    MeshBlock mesh = clean;
    std::mt19937 random(static_cast<unsigned>(number("seed")));
    std::normal_distribution<double> normal(0.0, 1.0);
    for (Double3& p : mesh.position)
      for (double& x : p) x += deviation * normal(random);
    const ClosestFaces truth(clean.position, clean.faces, clean.position[0]);
    const Distances before = distances(truth, mesh.position);
    const std::size_t flipped_before = flipped(truth, mesh, mesh.position);
    SmoothOptions options;
    options.method = value["method"];
    options.lambda = number("lambda");
    options.steps = static_cast<int>(number("steps"));
    options.noise = number("given") * edge;
    double seconds = 1e300;
    MeshBlock now;
    for (int trial = 0; trial < static_cast<int>(number("repeat")); ++trial) {
      now = mesh;
      const double start = thread_seconds();
      for (const SmoothRound& round : smooth_rounds(options))
        now.position = smooth_block(now, round).position;
      seconds = std::min(seconds, thread_seconds() - start);
    }
    const Distances after = distances(truth, now.position);
    const char* slash = std::strrchr(argv[i], '/');
    std::printf(
        "%-20s %7zu vertices  %5.2f us each  mean %.4f -> %.4f edges: %.2f x  rms %.2f x  most %.2f -> %.2f  "
        "turned "
        "%zu -> %zu of %zu, in their surroundings %zu -> %zu (clean %zu)\n",
        slash ? slash + 1 : argv[i], mesh.position.size(),
        1e6 * seconds / static_cast<double>(mesh.position.size()), before.mean / edge, after.mean / edge,
        before.mean / after.mean, before.rms / after.rms, before.maximum / edge, after.maximum / edge,
        flipped_before, flipped(truth, mesh, now.position), mesh.faces.size(),
        static_cast<std::size_t>(count_flipped_faces(mesh)),
        static_cast<std::size_t>(count_flipped_faces(now)),
        static_cast<std::size_t>(count_flipped_faces(clean)));
    std::fflush(stdout);
    if (!value["out"].empty()) write(mesh, now.position, value["out"]);
  }
  return 0;
}
