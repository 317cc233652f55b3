/// Stage "lattice" of solids: where the lattice lies.
#include <algorithm>
#include <cmath>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {
namespace {

constexpr double kCellsOfDiagonal = 300.0;
constexpr double kMinWall = 2.0;        ///< of a shell, cells
constexpr double kOtherUnits = 1000.0;  ///< diagonals that differ so much: a warning
constexpr double kFarthest = 0x1p120;   ///< of any node from zero: what is written is told in floats

class LatticeStage : public SerialStage {
 public:
  LatticeStage(const JobState& state, SolidModel model) : state_(state), model_(std::move(model)) {}
  std::string name() const override { return "lattice"; }
  std::uint64_t units() const override { return 0; }
  std::string unit_name() const override { return "solids"; }
  std::uint64_t finish_bytes() const override { return solid_lattice_bytes(state_, model_); }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    MeshBox box;
    double minimum = 0.0, maximum = 0.0;
    std::uint64_t faces = 0;
    bool any = false;
    const auto add = [&](const MeshBox& more) {
      for (std::size_t a = 0; a < 3; ++a) {
        box.low[a] = any ? std::min(box.low[a], more.low[a]) : more.low[a];
        box.high[a] = any ? std::max(box.high[a], more.high[a]) : more.high[a];
      }
      const double diagonal = norm(more.high - more.low);
      minimum = any ? std::min(minimum, diagonal) : diagonal;
      maximum = std::max(maximum, diagonal);
      any = true;
    };
    for (const PlacedMesh& mesh : model_.meshes)
      for (const std::size_t input : mesh.inputs) {
        const MeshStore store = open_imported_mesh(state_.work, solid_import(input));
        faces += store.face_count();
        add(placed_box(mesh.placement, store.box()));
      }
    for (const PlacedShape& s : model_.shapes) {
      MeshBox bounds;
      if (make_placed_shape(state_, s)->bounds(bounds.low, bounds.high)) add(bounds);
    }
    const double diagonal = norm(box.high - box.low);
    Plan plan;
    plan.lattice.h =
        model_.resolution > 0.0 ? model_.resolution : round_up_2_digits(diagonal / kCellsOfDiagonal);
    plan.resolution_reason = model_.resolution > 0.0 ? "given" : "a 300th of the diagonal";
    const double brick = plan.lattice.h * kBrickCells;
    if (model_.shell > 0.0 && model_.shell < kMinWall * plan.lattice.h)
      throw UsageError("--shell " + number_text(model_.shell) + ": a wall is at least " +
                       number_text(kMinWall) + " cells thick, and a cell is " + number_text(plan.lattice.h) +
                       " wide: give a --resolution of at most " + number_text(model_.shell / kMinWall));
    const double grown = std::max(0.0, model_.offset) * model_.mitre;
    for (std::size_t a = 0; a < 3; ++a) box.low[a] -= grown, box.high[a] += grown;
    double farthest = 0.0;
    for (std::size_t a = 0; a < 3; ++a)
      farthest = std::max({farthest, std::fabs(box.low[a]), std::fabs(box.high[a])});
    if (!(farthest <= kFarthest))
      throw InputError("the solids reach " + number_text(farthest) +
                       " from zero: coordinates are too large for a lattice from " + number_text(kFarthest) +
                       " on; scale them first");
    for (std::size_t a = 0; a < 3; ++a) {
      const double first = std::floor(box.low[a] / brick) - 1.0, last = std::floor(box.high[a] / brick) + 1.0;
      if (!(std::fabs(first) < 0x1p52) || !((last - first + 1.0) * kBrickCells < double{1 << kMaxCellBits}))
        throw UsageError("--resolution " + number_text(plan.lattice.h) + ": the solids are " +
                         number_text(diagonal) + " wide, more than 2^20 cells; the least that can do is " +
                         number_text(round_up_2_digits(diagonal / 1e6)));
      plan.lattice.origin_brick[a] = static_cast<std::int64_t>(first);
      plan.brick_min[a] = 1;
      plan.brick_max[a] = static_cast<std::int32_t>(last - first) - 1;
    }
    plan.save(context.create(Plan::kFile));
    Json out = {{"h", plan.lattice.h},
                {"resolution_reason", plan.resolution_reason},
                {"faces", faces},
                {"diagonal", diagonal}};
    if (maximum > kOtherUnits * minimum)
      out["warnings"] = {"the solids are " + number_text(minimum) + " and " + number_text(maximum) +
                         " wide: are they in the same units?"};
    return out;
  }

 private:
  JobState state_;
  SolidModel model_;
};

}  // namespace

std::size_t SolidModel::inputs() const {
  std::size_t count = 0;
  for (const PlacedMesh& mesh : meshes) count += mesh.inputs.size();
  return count;
}

std::string solid_import(std::size_t input) {
  return "mesh-" + std::to_string(input);
}

void transform_block(const Placement& placement, MeshBlock& block) {
  if (placement.is_identity()) return;
  for (Double3& p : block.position) p = placement.apply(p);
  if (!(placement.determinant() < 0.0)) return;
  // A mirror image looks inwards where its faces keep their order. Edges 01 and 20 change places.
  constexpr unsigned kFirst = kFaceBorder01 | kFaceCrease01, kLast = kFaceBorder20 | kFaceCrease20;
  static_assert(kLast == kFirst << 2);
  for (auto& f : block.faces) std::swap(f[1], f[2]);
  for (std::uint8_t& flags : block.face_flags)
    flags =
        static_cast<std::uint8_t>((flags & ~(kFirst | kLast)) | (flags & kFirst) << 2 | (flags & kLast) >> 2);
}

MeshBox placed_box(const Placement& placement, const MeshBox& box) {
  MeshBox out;
  for (int corner = 0; corner < 8; ++corner) {
    const Double3 p =
        placement.apply({corner & 1 ? box.high[0] : box.low[0], corner & 2 ? box.high[1] : box.low[1],
                         corner & 4 ? box.high[2] : box.low[2]});
    for (std::size_t a = 0; a < 3; ++a) {
      out.low[a] = corner == 0 ? p[a] : std::min(out.low[a], p[a]);
      out.high[a] = corner == 0 ? p[a] : std::max(out.high[a], p[a]);
    }
  }
  return out;
}

std::vector<Long3> quantise_block(const Lattice& lattice, const MeshBlock& block) {
  std::vector<Long3> out(block.position.size());
  for (std::size_t v = 0; v < out.size(); ++v) out[v] = quantise_solid(lattice, block.position[v]);
  return out;
}

std::uint64_t solid_lattice_bytes(const JobState& state, const SolidModel& model) {
  std::uint64_t bytes = std::uint64_t{32} << 20;
  for (const PlacedShape& s : model.shapes) bytes += placed_shape_bytes(state, s);
  return bytes;
}

std::unique_ptr<Stage> make_solid_lattice_stage(const JobState& state, const SolidModel& model) {
  return std::make_unique<LatticeStage>(state, model);
}

}  // namespace tessera
