// Does decimation leave a trace of its blocks? Decimates a mesh in blocks, then compares faces near the old seams of each
// pass with faces near planes that never were one: the Kolmogorov-Smirnov distance of face sizes and of deviations.
// seam_bench MESH TOLERANCE [BLOCK_FACES]      tolerance in percent of the diagonal
//   pass P     seams of that pass (planes between two blocks); "bricks": faces of the tiles of the store
//   controls   the same planes moved by 0.2, 0.4, 0.6 and 0.8 of their distance; what they differ by among each other is
//              what geometry alone makes of planes elsewhere
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "kernels/mesh/closest_face.h"
#include "octree/vector.h"
#include "stream/files/scratch_folder.h"
#include "stream/import/import_mesh.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/stage_runner.h"
#include "stream/stages/decimate/decimate_job.h"

namespace {

using namespace tessera;

struct Face {
  Double3 centre;
  double size, deviation;
};

/// Largest difference of the two distribution functions.
double kolmogorov_smirnov(std::vector<double> a, std::vector<double> b) {
  if (a.empty() || b.empty()) return 0.0;
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  double worst = 0.0;
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    const double x = std::min(a[i], b[j]);
    while (i < a.size() && a[i] <= x) ++i;
    while (j < b.size() && b[j] <= x) ++j;
    worst = std::fmax(worst, std::fabs(static_cast<double>(i) / static_cast<double>(a.size()) -
                                       static_cast<double>(j) / static_cast<double>(b.size())));
  }
  return worst;
}

double median(std::vector<double> v) {
  if (v.empty()) return 0.0;
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

/// Eight bins of equal width up to `top`, in percent.
void print_histogram(const char* name, const std::vector<double>& values, double top) {
  std::vector<std::size_t> bins(8, 0);
  for (const double v : values) ++bins[std::min<std::size_t>(7, static_cast<std::size_t>(8.0 * v / top))];
  std::printf("    %-10s", name);
  for (const std::size_t n : bins)
    std::printf(" %5.1f%%", 100.0 * static_cast<double>(n) /
                                static_cast<double>(std::max<std::size_t>(1, values.size())));
  std::printf("\n");
}

/// \param phase  of a point along each axis: its place between two seams, 0 to 1; and their distance
using Phase = std::function<bool(const Double3& p, std::size_t axis, double& phase, double& distance)>;

/// Faces whose centre lies within `width` of a plane at this phase.
std::vector<const Face*> near_planes(const std::vector<Face>& faces, const Phase& phase, double at,
                                     double width) {
  std::vector<const Face*> out;
  for (const Face& f : faces) {
    bool near = false;
    for (std::size_t a = 0; a < 3 && !near; ++a) {
      double t = 0.0, distance = 0.0;
      if (!phase(f.centre, a, t, distance)) continue;
      const double off = std::fabs(t - at);
      near = std::fmin(off, 1.0 - off) * distance <= width;
    }
    if (near) out.push_back(&f);
  }
  return out;
}

void compare(const char* name, const std::vector<Face>& faces, const Phase& phase, double width,
             double tolerance) {
  const auto values = [](const std::vector<const Face*>& list, double Face::*what) {
    std::vector<double> v;
    for (const Face* f : list) v.push_back(f->*what);
    return v;
  };
  std::vector<std::vector<const Face*>> controls;
  for (const double at : {0.2, 0.4, 0.6, 0.8}) controls.push_back(near_planes(faces, phase, at, width));
  const std::vector<const Face*> seam = near_planes(faces, phase, 0.0, width);
  std::vector<const Face*> all;
  for (const auto& c : controls) all.insert(all.end(), c.begin(), c.end());
  std::printf("%s: %zu faces near seams, %zu near controls\n", name, seam.size(), all.size());
  for (const auto& [what, word] :
       {std::pair(&Face::size, "size"), std::pair(&Face::deviation, "deviation")}) {
    double among = 0.0;
    for (std::size_t c = 0; c < controls.size(); ++c) {
      std::vector<const Face*> others;
      for (std::size_t d = 0; d < controls.size(); ++d)
        if (d != c) others.insert(others.end(), controls[d].begin(), controls[d].end());
      among = std::fmax(among, kolmogorov_smirnov(values(controls[c], what), values(others, what)));
    }
    const double n = static_cast<double>(seam.size()), m = static_cast<double>(all.size());
    std::printf(
        "  %-9s KS to controls %.4f; largest among controls %.4f; chance (5 %%) %.4f; median %.4g against "
        "%.4g\n",
        word, kolmogorov_smirnov(values(seam, what), values(all, what)), among,
        n * m > 0.0 ? 1.358 * std::sqrt((n + m) / (n * m)) : 0.0, median(values(seam, what)),
        median(values(all, what)));
    const double top = what == &Face::deviation ? tolerance : 4.0 * median(values(all, what));
    if (top > 0.0) {
      print_histogram("seams", values(seam, what), top);
      print_histogram("controls", values(all, what), top);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "seam_bench MESH TOLERANCE_PERCENT [BLOCK_FACES]\n");
    return 2;
  }
  const ScratchFolder scratch(std::filesystem::temp_directory_path(), "seams");
  JobState state;
  state.work = scratch.path();
  state.run.memory_bytes = std::uint64_t{8} << 30;
  state.run.threads = 2;
  const MeshStore reference = import_mesh(argv[1], scratch.path(), "mesh", state.run, {});
  SimplifyOptions options;
  options.tolerance = std::atof(argv[2]) / 100.0 * reference.diagonal();
  if (argc > 3) options.block_faces = static_cast<std::uint64_t>(std::atoll(argv[3]));
  for (int pass = 0; pass < options.passes; ++pass) {
    const StageEntry entry{
        "pass", [&](const JobState& s) {
          return make_simplify_stage(s, options, imported_stores("mesh"), {pass, 0, false});
        }};
    run_stages(state, {entry}, {});
  }
  const MeshStore store = open_pass_input(state, imported_stores("mesh"), {options.passes, 0, false});
  std::vector<std::size_t> every(store.patches().size()), whole(reference.patches().size());
  for (std::size_t p = 0; p < every.size(); ++p) every[p] = p;
  for (std::size_t p = 0; p < whole.size(); ++p) whole[p] = p;
  const MeshBlock mesh = store.load(every);
  std::vector<Face> faces;
  {
    const MeshBlock original = reference.load(whole);
    const ClosestFaces closest(original.position, original.faces, original.position[0]);
    for (const auto& t : mesh.faces) {
      Face f{};
      Double3 u, v, p;
      for (std::size_t a = 0; a < 3; ++a) {
        const double x = mesh.position[t[0]][a], y = mesh.position[t[1]][a], z = mesh.position[t[2]][a];
        f.centre[a] = (x + y + z) / 3.0;
        u[a] = y - x, v[a] = z - x;
        p[a] = f.centre[a] - original.position[0][a];
      }
      const Double3 n = cross(u, v);
      f.size = std::sqrt(0.5 * norm(n));
      f.deviation = std::sqrt(closest.closest(p, 1e300, ClosestFaces::kNone).square);
      faces.push_back(f);
    }
  }
  std::vector<double> sizes;
  for (const Face& f : faces) sizes.push_back(f.size);
  const double width = median(sizes);
  std::printf("%s: %llu -> %zu faces, tolerance %.4g, median size %.4g\n", argv[1],
              static_cast<unsigned long long>(reference.face_count()), faces.size(), options.tolerance,
              width);
  const Lattice& lattice = store.info().lattice;
  const double brick = lattice.h * kBrickCells;
  const auto in_bricks = [&](const Double3& p, std::size_t a) {
    return p[a] / brick - static_cast<double>(lattice.origin_brick[a]);
  };
  for (int pass = 0; pass < options.passes; ++pass) {
    const MeshStore in = open_pass_input(state, imported_stores("mesh"), {pass, 0, false});
    const std::vector<MeshBlockCut> blocks = simplify_blocks(in, reference, options, pass);
    const Phase phase = [&](const Double3& p, std::size_t axis, double& t, double& distance) {
      for (const MeshBlockCut& b : blocks) {
        bool inside = true;
        for (std::size_t a = 0; a < 3 && inside; ++a)
          inside = in_bricks(p, a) >= b.first_brick[a] && in_bricks(p, a) < b.last_brick[a] + 1;
        if (!inside) continue;
        const double edge = b.last_brick[axis] + 1 - b.first_brick[axis];
        t = (in_bricks(p, axis) - b.first_brick[axis]) / edge;
        distance = edge * brick;
        return true;
      }
      return false;
    };
    const std::string name =
        "pass " + std::to_string(pass + 1) + ", " + std::to_string(blocks.size()) + " blocks";
    compare(name.c_str(), faces, phase, width, options.tolerance);
  }
  const Phase bricks = [&](const Double3& p, std::size_t axis, double& t, double& distance) {
    const double x = in_bricks(p, axis);
    t = x - std::floor(x);
    distance = brick;
    return true;
  };
  compare("bricks", faces, bricks, width, options.tolerance);
  return 0;
}
