// How far creases of a remeshed mesh lie from those of its input, and the other way, in lengths of edges.
// crease_bench WORK      work directory of a finished `tessera remesh ... -o OUT --keep`: OUT.tessera; loads both meshes whole
//   Creases are those that remeshing found, and those of them that were left. Five points of every edge are measured.
//   strong    of the input's, those that turn by more than 45 degrees: the others may yield to the shape of faces
#include <algorithm>
#include <cstdio>
#include <exception>
#include <limits>
#include <numeric>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/mesh/closest_face.h"
#include "kernels/remesh/reference_surface.h"
#include "kernels/remesh/remesh.h"
#include "stream/runtime/option_table.h"
#include "stream/runtime/work_dir.h"
#include "stream/stages/decimate/decimate_job.h"
#include "stream/stages/remesh/sizing_stage.h"

namespace {

using namespace tessera;

struct Creases {
  std::vector<Double3> at;
  std::vector<std::array<std::uint32_t, 3>> edges;  ///< as triangles without area
};

/// \param origin  subtracted \param strong  those alone that turn by more than 45 degrees
Creases creases_of(const MeshBlock& block, const Double3& origin, bool strong) {
  Creases out;
  for (const Double3& p : block.position) out.at.push_back(p - origin);
  const CollapseMesh mesh(block, origin);
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f)
    for (std::uint32_t c = 4 * f; c < 4 * f + 3; ++c) {
      const std::uint32_t o = mesh.opposite(c);
      if (o == kNoCorner || o < c || !(mesh.crease_edge(c) || mesh.crease_edge(o))) continue;
      const auto normal = [&](std::uint32_t g) {
        const std::uint32_t* v = mesh.face(g).vertex;
        return triangle_normal(mesh.at(v[0]), mesh.at(v[1]), mesh.at(v[2]));
      };
      const Double3 m = normal(c >> 2), n = normal(o >> 2);
      if (strong && dot(m, n) > 0.70710678118654752 * norm(m) * norm(n)) continue;
      const std::uint32_t a = mesh.block_vertex(mesh.vertex(next_corner(c))),
                          b = mesh.block_vertex(mesh.vertex(prev_corner(c)));
      out.edges.push_back({a, b, b});
    }
  return out;
}

void tell(const char* name, const Creases& from, const Creases& to, double edge) {
  std::vector<double> off;
  if (!to.edges.empty()) {
    const ClosestFaces there(to.at, to.edges, Double3{});
    for (const auto& e : from.edges)
      for (int i = 0; i < 5; ++i) {
        const double t = (i + 0.5) / 5.0;
        const Double3 p = from.at[e[0]] * (1.0 - t) + from.at[e[1]] * t;
        off.push_back(
            std::sqrt(there.closest(p, std::numeric_limits<double>::max(), ClosestFaces::kNone).square) /
            edge);
      }
  }
  std::sort(off.begin(), off.end());
  const auto at = [&](double share) {
    return off.empty() ? 0.0
                       : off[std::min(off.size() - 1,
                                      static_cast<std::size_t>(share * static_cast<double>(off.size())))];
  };
  const auto beyond = static_cast<double>(off.end() - std::upper_bound(off.begin(), off.end(), 0.02));
  std::printf("%s: %zu edges; beyond 0.02 edges %.3f %%; median %.5f, 99 %% %.4f, largest %.4f edges\n", name,
              from.edges.size(), off.empty() ? 0.0 : 100.0 * beyond / static_cast<double>(off.size()),
              at(0.5), at(0.99), at(1.0));
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "crease_bench WORK\n");
    return 2;
  }
  JobState state = WorkDir::open_existing(argv[1], false).read_state();
  state.work = argv[1];
  const auto options = from_settings<RemeshJobOptions>(state.settings);
  const SimplifyStores stores = imported_stores("mesh");
  const Sizing sizing = Sizing::of_work(state.work);
  const auto whole = [](const MeshStore& store) {
    std::vector<std::size_t> every(store.patches().size());
    std::iota(every.begin(), every.end(), std::size_t{0});
    return store.load(every);
  };
  const MeshBlock mesh =
      whole(open_pass_input(state, stores, {options.passes, last_round(state.work), false}));
  MeshBlock input = whole(stores.full(state));
  const Double3 origin = input.position[0];
  {
    const MeshBlock reference = input;
    ReferenceSurface(reference, origin, options.feature_angle_deg,
                     kMinCreaseEdges * (options.adaptive ? sizing.shortest : sizing.edge), {})
        .mark(input);
  }
  const Creases before = creases_of(input, origin, false), after = creases_of(mesh, origin, false);
  tell("result to input", after, before, sizing.edge);
  tell("input to result", before, after, sizing.edge);
  tell("input to result, strong", creases_of(input, origin, true), after, sizing.edge);
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "crease_bench: %s\n", e.what());
  return 1;
}
