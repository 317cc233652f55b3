#include "stream/stages/surface/output_frame.h"

#include <algorithm>
#include <cmath>

#include "stream/points/reconstruct_options.h"

namespace tessera {
namespace {

bool float_suffices(double farthest, double h) {
  return farthest * 0x1p-24 <= h * 1e-3;
}

}  // namespace

double farthest_coordinate(const Lattice& lattice, const Int3& brick) {
  double farthest = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const double low = lattice.world(static_cast<int>(a), brick[a] * double{kBrickCells});
    farthest = std::max({farthest, std::fabs(low), std::fabs(low + kBrickCells * lattice.h)});
  }
  return farthest;
}

MeshFrame output_frame(const JobState& state, const Plan& plan, double farthest) {
  return output_frame(state.output, plan, farthest, reconstruct_options(state).local_output);
}

MeshFrame output_frame(const std::filesystem::path& output, const Plan& plan, double farthest,
                       bool local_output) {
  const std::string extension = output.extension().string();
  const bool has_double = extension == ".ply" || extension == ".obj";
  const bool enough = float_suffices(farthest, plan.lattice.h);
  const bool local = local_output || (!has_double && !enough);
  MeshFrame frame;
  frame.lattice = plan.lattice;
  frame.double_positions = has_double && !local && !enough;
  frame.colour = plan.has_colour;
  if (local)
    for (std::size_t a = 0; a < 3; ++a) frame.shift[a] = plan.lattice.world(static_cast<int>(a), 0.0);
  return frame;
}

}  // namespace tessera
