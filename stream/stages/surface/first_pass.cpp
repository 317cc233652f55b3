#include "stream/stages/surface/first_pass.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "kernels/mesh/block_components.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/mesh/patch_mesh.h"
#include "stream/files/direct_file.h"
#include "stream/files/task_files.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/surface/level_files.h"
#include "stream/stages/surface/output_frame.h"
#include "stream/stages/surface/weld_stage.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint64_t kCube = 8;              ///< bricks of a block
constexpr std::uint64_t kMostFaces = 1u << 17;  ///< more than these, and each brick is a block
constexpr std::uint64_t kBytesPerFace =
    96 + 96 + 80;  ///< patch in its block, merged block, what becomes of it
constexpr std::size_t kBuffer = std::size_t{1} << 20;

struct Piece {
  std::uint64_t brick;
  MeshBlock mesh;
};

MeshFrame frame_of(const JobState& state) {
  Plan plan = Plan::of_work(state.work);
  // The surface may reach one brick beyond the points.
  double farthest = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    Int3 brick;
    for (std::size_t a = 0; a < 3; ++a)
      brick[a] = corner >> a & 1 ? plan.brick_max[a] + 1 : std::max(0, plan.brick_min[a] - 1);
    farthest = std::max(farthest, farthest_coordinate(plan.lattice, brick));
  }
  plan.lattice = finest_lattice(plan.lattice, reconstruct_options(state));
  return output_frame(state, plan, farthest);
}

MeshStoreInfo info_of(const MeshFrame& frame) {
  MeshStoreInfo info;
  info.lattice = frame.lattice;
  if (frame.shift != Double3{0, 0, 0}) info.lattice.origin_brick = {0, 0, 0};
  info.double_positions = frame.double_positions;
  info.colour = frame.colour;
  info.shift = frame.shift;
  return info;
}

MeshBlockCut block_of(std::uint64_t first_brick, std::uint64_t bricks) {
  MeshBlockCut cut;
  cut.first_brick = brick_of_key(first_brick);
  for (std::size_t a = 0; a < 3; ++a) cut.last_brick[a] = cut.first_brick[a] + (bricks == kCube ? 1 : 0);
  return cut;
}

MeshStore open(const JobState& state, const char* folder, const char* pruned) {
  return MeshStore(list_task_files(state.work / folder, ".tmm"),
                   list_task_files(state.work / pruned, ".tmm"));
}

}  // namespace

double reconstruct_tolerance(const JobState& state) {
  const double asked = reconstruct_options(state).tolerance;
  if (asked != kAutoTolerance) return asked;
  const Plan plan = Plan::of_work(state.work);
  return auto_tolerance(plan.lattice.h, plan.noise_cells * plan.lattice.h);
}

SimplifyOptions reconstruct_simplify_options(const ReconstructOptions& options) {
  SimplifyOptions simplify;
  simplify.tolerance = options.tolerance;
  simplify.smooth = options.smooth;
  return simplify;
}

bool fuses_stores(const ReconstructOptions& options) {
  return (options.decimates() || options.has_levels()) && options.max_hole_edges() == 0 &&
         !options.smooths_border() && options.reference == "surface";
}

bool fuses_first_pass(const ReconstructOptions& options) {
  return fuses_stores(options) && !options.smooths() && !options.has_levels();
}

MeshStore open_full_surface(const JobState& state) {
  return open(state, kFullFolder, kPrunedFullFolder);
}
MeshStore open_first_pass(const JobState& state) {
  return open(state, kFirstPassFolder, kPrunedPassFolder);
}

std::vector<MeshBlockCut> first_pass_blocks(const MeshStore& full) {
  std::vector<MeshBlockCut> blocks;
  std::uint64_t last = 0;
  for (std::size_t p = 0; p < full.patches().size(); ++p) {
    const MeshPatchEntry& e = full.patches()[p];
    const bool alone = (e.content & kPatchAlone) != 0;
    const std::uint64_t bricks = alone ? 1 : kCube;
    const std::uint64_t first = e.key / bricks * bricks;
    if (blocks.empty() || first != last || alone) blocks.push_back(block_of(first, bricks));
    last = first;
    blocks.back().patches.push_back(p);
    blocks.back().faces += e.faces;
  }
  return blocks;
}

std::string island_file(std::size_t task) {
  return kIslandFolder + task_file_stem(task) + ".tsi";
}

MeshBlock load_island_block(const MeshStore& store, std::uint64_t brick, std::uint32_t bricks,
                            std::vector<std::size_t>& patches) {
  patches.clear();
  for (std::uint64_t b = brick; b < brick + bricks; ++b)
    if (const std::int64_t patch = store.find(b); patch >= 0)
      patches.push_back(static_cast<std::size_t>(patch));
  return store.load(patches);
}

struct FirstPass::Impl {
  TaskContext& context;
  const std::size_t task;
  const MeshFrame frame;
  const MeshStoreInfo info;
  DecimateOptions kernel;
  std::uint64_t least_faces = 0;  ///< islands with fewer go
  MeshFileWriter full;
  std::optional<MeshFileWriter> first;     ///< where the first pass runs here
  std::uint64_t cube = 0, cube_faces = 0;  ///< at work, and what came of it so far
  std::uint64_t level = 0;                 ///< of its bricks: those of one cube have one size
  std::vector<Piece> pieces;               ///< of it, not yet finished
  std::vector<IslandPart> parts;
  std::vector<IslandSeam> seams;
  json counts = json::object();
  std::uint64_t blocks = 0, dropped = 0, dropped_faces = 0;

  Impl(const JobState& state, TaskContext& c, std::size_t t)
      : context(c),
        task(t),
        frame(frame_of(state)),
        info(info_of(frame)),
        full(c.create(kFullFolder + task_file_stem(t) + ".tmm"), info) {
    const ReconstructOptions options = reconstruct_options(state);
    least_faces = options.min_component != 0 ? options.min_component : automatic_min_component(0);
    if (fuses_first_pass(options))
      first.emplace(c.create(kFirstPassFolder + task_file_stem(t) + ".tmm"), info);
    SimplifyOptions simplify = reconstruct_simplify_options(options);
    simplify.tolerance = reconstruct_tolerance(state);
    kernel = simplify.kernel(!info.double_positions);
  }

  /// Bricks of a cube that has too many faces go one by one as soon as that shows, so few wait in memory.
  void take(std::uint64_t brick, int brick_level, MeshBlock&& mesh) {
    if (brick / kCube != cube) {
      flush();
      cube = brick / kCube;
      cube_faces = 0;
    }
    level = static_cast<std::uint64_t>(brick_level);
    if (mesh.faces.empty()) return;
    cube_faces += mesh.faces.size();
    pieces.push_back({brick, std::move(mesh)});
    if (cube_faces <= kMostFaces) return;
    for (Piece& piece : pieces) finish_block({&piece, 1}, 1);
    pieces.clear();
  }
  void flush() {
    if (!pieces.empty()) finish_block(pieces, kCube);
    pieces.clear();
  }

  void finish_block(std::span<Piece> of, std::uint64_t bricks) {
    context.check_stop();
    const std::uint64_t first_brick = of.front().brick / bricks * bricks;
    MeshBlock block = merged(of);
    if (block.faces.empty()) return;
    std::vector<std::uint8_t> complete = complete_stars(block);
    BlockComponents components = find_components(block, complete);
    if (drop_islands(of, block, components)) {
      block = merged(of);
      complete = complete_stars(block);
      components = find_components(block, complete);
    }
    for (const Piece& piece : of)
      full.add(piece.brick, piece.mesh, kPatchCompact | (bricks == 1 ? unsigned{kPatchAlone} : 0u));
    if (block.faces.empty()) return;
    for (std::size_t v = 0; v < complete.size(); ++v)
      if (!complete[v]) seams.push_back({block.key[v], parts.size() + components.of_vertex[v]});
    for (std::uint32_t c = 0; c < components.faces.size(); ++c)
      parts.push_back({first_brick, static_cast<std::uint32_t>(bricks), c, components.faces[c],
                       components.border[c], level});

    ++blocks;
    if (!first) return;
    add_counts(counts, to_json(decimate(block, block, kernel)));
    const MeshBlockCut cut = block_of(first_brick, bricks);
    std::vector<std::uint64_t> brick;
    brick.reserve(block.faces.size());
    for (const auto& f : block.faces)
      brick.push_back(
          cut.brick_of(info.lattice, block.position[f[0]], block.position[f[1]], block.position[f[2]]));
    split_faces(block, brick, [&](std::uint64_t key, MeshBlock&& patch) { first->add(key, patch); });
  }

  static MeshBlock merged(std::span<const Piece> of) {
    if (of.size() == 1) return of.front().mesh;
    std::vector<const MeshBlock*> meshes;
    for (const Piece& piece : of) meshes.push_back(&piece.mesh);
    return merge_blocks(meshes, {}, nullptr);
  }

  bool drop_islands(std::span<Piece> of, const MeshBlock& block, const BlockComponents& components) {
    std::vector<std::uint8_t> goes(components.faces.size(), 0);
    bool any = false;
    for (std::size_t c = 0; c < goes.size(); ++c) {
      if (components.open[c] || components.faces[c] >= least_faces) continue;
      goes[c] = any = true;
      ++dropped;
      dropped_faces += components.faces[c];
    }
    if (!any) return false;
    std::vector<std::uint64_t> gone;
    for (std::size_t v = 0; v < block.key.size(); ++v)
      if (goes[components.of_vertex[v]]) gone.push_back(block.key[v]);
    for (Piece& piece : of) piece.mesh = without_vertices(piece.mesh, gone);
    return true;
  }
};

FirstPass::FirstPass(const JobState& state, TaskContext& context, std::size_t task)
    : impl_(std::make_unique<Impl>(state, context, task)) {}
FirstPass::~FirstPass() = default;

void FirstPass::add(const Patch& patch) {
  Int3 brick = patch.brick;
  for (int& b : brick) b <<= patch.level;
  impl_->take(brick_key(brick), patch.level, make_mesh_block(patch, impl_->frame));
}

json FirstPass::finish() {
  Impl& self = *impl_;
  self.flush();
  self.context.count_written(self.full.finish());
  if (self.first) self.context.count_written(self.first->finish());
  PackedWriter file(self.context.create(island_file(self.task)), kIslandKind, kBuffer);
  const std::vector<IslandEntry> table = {{file.append(bytes_of(self.parts)),
                                           file.append(bytes_of(self.seams)), self.dropped,
                                           self.dropped_faces}};
  self.context.count_written(file.finish(table));
  self.counts["blocks"] = self.blocks;
  return std::move(self.counts);
}

std::uint64_t FirstPass::bytes(std::uint64_t block_faces, std::uint64_t brick_faces) {
  const std::uint64_t faces = std::max(std::min(block_faces, kMostFaces), brick_faces);
  // Pieces of a cube that turns out too large lie there until each had its turn.
  return faces * kBytesPerFace + decimate_bytes(faces, 0) + (block_faces > kMostFaces ? 96 * kMostFaces : 0) +
         2 * DirectFile::kDefaultBuffer + (std::uint64_t{2} << 20);
}

}  // namespace tessera
