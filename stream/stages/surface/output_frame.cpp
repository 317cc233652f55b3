#include "stream/stages/surface/output_frame.h"

#include <algorithm>
#include <cmath>

#include "stream/points/reconstruct_options.h"
#include "stream/stages/surface/level_files.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {
namespace {

/// Whether floats tell coordinates to a thousandth of a cell: their steps grow with what they tell, down to the least one,
/// and end somewhere.
bool float_suffices(double farthest, double h) {
  constexpr double kLargest = 0x1p127, kHalfMinStep = 0x1p-150;
  return farthest < kLargest && std::max(farthest * 0x1p-24, kHalfMinStep) <= h * kFineCells;
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
  return output_frame(plan, farthest, reconstruct_options(state).local_output);
}

MeshFrame output_frame(const Plan& plan, double farthest, bool local) {
  MeshFrame frame;
  frame.lattice = plan.lattice;
  frame.double_positions = !local && !float_suffices(farthest, plan.lattice.h);
  frame.colour = plan.has_colour;
  if (local)
    for (std::size_t a = 0; a < 3; ++a) frame.shift[a] = plan.lattice.world(static_cast<int>(a), 0.0);
  return frame;
}

MeshPlacement plan_placement(const JobState& state, const Plan& plan) {
  // The surface may reach one brick beyond the points.
  Int3 first, last;
  for (std::size_t a = 0; a < 3; ++a) {
    first[a] = std::max(0, plan.brick_min[a] - 1);
    last[a] = plan.brick_max[a] + 1;
  }
  const double farthest =
      std::max(farthest_coordinate(plan.lattice, first), farthest_coordinate(plan.lattice, last));
  Plan finest = plan;
  finest.lattice = finest_lattice(plan.lattice, reconstruct_options(state));
  const double requested = reconstruct_options(state).tolerance, fine = kFineCells * finest.lattice.h;
  return brick_placement(state.output, output_frame(state, finest, farthest), plan.lattice, first, last,
                         requested > 0.0 ? std::min(fine, 1e-2 * requested) : fine);
}

PatchFrame patch_frame(const JobState& state, const Plan& plan, const PatchStore& store, bool reconstructs) {
  double farthest = 0.0;
  Int3 first = {0, 0, 0}, last = {0, 0, 0};
  for (const PatchEntry& e : store.patches()) {
    const Int3 brick = brick_of_key(e.key);
    if (&e == store.patches().data()) first = last = brick;
    farthest = std::max(farthest, farthest_coordinate(plan.lattice, brick));
    for (std::size_t a = 0; a < 3; ++a) {
      first[a] = std::min(first[a], brick[a]);
      last[a] = std::max(last[a], brick[a]);
    }
  }
  PatchFrame out;
  out.frame = reconstructs ? output_frame(state, plan, farthest) : output_frame(plan, farthest, false);
  out.written.lattice = plan.lattice;
  out.written.shift = out.frame.shift;
  out.written.floats = !out.frame.double_positions || holds_floats_only(state.output);
  out.written.origin =
      brick_placement(state.output, out.frame, plan.lattice, first, last, kFineCells * plan.lattice.h).origin;
  return out;
}

WrittenBy written_by(bool reconstructs) {
  return [reconstructs](const JobState& state) {
    return patch_frame(state, Plan::of_work(state.work), open_patches(state.work), reconstructs).written;
  };
}

MeshPlacement brick_placement(const std::filesystem::path& output, const MeshFrame& frame,
                              const Lattice& lattice, const Int3& first, const Int3& last, double fine) {
  Double3 low, high;
  for (std::size_t a = 0; a < 3; ++a) {
    const int axis = static_cast<int>(a);
    low[a] = lattice.world(axis, first[a] * double{kBrickCells}) - frame.shift[a];
    high[a] = lattice.world(axis, (last[a] + 1) * double{kBrickCells}) - frame.shift[a];
  }
  return place_mesh(output, frame.double_positions, low, high, fine);
}

}  // namespace tessera
