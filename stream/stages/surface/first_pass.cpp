#include "stream/stages/surface/first_pass.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "kernels/decimate/auto_tolerance.h"
#include "kernels/mesh/block_components.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/mesh/patch_mesh.h"
#include "kernels/mesh/uncross_block.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/meshes/block_sides.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/surface/level_files.h"
#include "stream/stages/surface/output_frame.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {
namespace {

constexpr std::uint64_t kCube = 64, kOctant = 8;  ///< bricks of a block; of an eighth of one
constexpr std::uint64_t kMaxFaces =
    3u << 16;  ///< where a block has more, its eighths are blocks: level ground has 2^17
/// Merged block, what becomes of it, where its vertices may go back to; its patches are gone by then. While crossings are
/// looked for half of it is still free, and decimation's memory too.
constexpr std::uint64_t kBytesPerFace = 96 + 80 + sizeof(SafePlace) / 2;
constexpr std::size_t kPassBuffer = std::size_t{1} << 20;

struct Piece {
  std::uint64_t brick;
  MeshBlock mesh;
  std::vector<SafePlace> safe;
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
  const int edge = bricks == kCube ? 4 : bricks == kOctant ? 2 : 1;
  for (std::size_t a = 0; a < 3; ++a) cut.last_brick[a] = cut.first_brick[a] + edge - 1;
  return cut;
}

/// How a patch says how large its block is.
unsigned content_of(std::uint64_t bricks) {
  if (bricks == kCube) return 0;
  return bricks == kOctant ? kPatchOctant : kPatchAlone;
}
std::uint64_t bricks_of(unsigned content) {
  if (content & kPatchAlone) return 1;
  return content & kPatchOctant ? kOctant : kCube;
}

MeshStore open(const JobState& state, const char* folder, const char* pruned) {
  return MeshStore(list_task_files(state.work / folder, ".tmm"),
                   list_task_files(state.work / pruned, ".tmm"));
}

}  // namespace

double reconstruct_tolerance(const JobState& state) {
  const double requested = reconstruct_options(state).tolerance;
  if (requested == 0.0) return 0.0;
  const Plan plan = Plan::of_work(state.work);
  return tolerance_before_rounding(state.output,
                                   requested == kAutoTolerance
                                       ? auto_tolerance(plan.lattice.h, plan.noise_cells * plan.lattice.h)
                                       : requested,
                                   plan_placement(state, plan));
}

SimplifyOptions reconstruct_simplify_options(const ReconstructOptions& options) {
  SimplifyOptions simplify;
  simplify.tolerance = options.tolerance;
  simplify.smooth = options.smooth;
  simplify.texture = options.texture;
  simplify.colour_tolerance = options.colour_tolerance;
  simplify.normal_map = options.normal_map;
  return simplify;
}

MeshStore open_full_surface(const JobState& state) {
  return open(state, kFullFolder, kPrunedFullFolder);
}
MeshStore open_first_pass(const JobState& state) {
  return open(state, kFirstPassFolder, kPrunedPassFolder);
}

std::vector<MeshBlockCut> first_pass_blocks(const MeshStore& full) {
  std::vector<MeshBlockCut> blocks;
  std::uint64_t end = 0;  // of the last block
  for (std::size_t p = 0; p < full.patches().size(); ++p) {
    const MeshPatchEntry& e = full.patches()[p];
    if (e.key >= end) {
      const std::uint64_t bricks = bricks_of(e.content), first = e.key / bricks * bricks;
      blocks.push_back(block_of(first, bricks));
      end = first + bricks;
    }
    blocks.back().patches.push_back(p);
    blocks.back().faces += e.faces;
  }
  return blocks;
}

std::string island_file(std::size_t task) {
  return kIslandFolder + task_file_stem(task) + ".tsi";
}

DecimateOptions first_pass_kernel(const JobState& state, bool double_positions) {
  SimplifyOptions simplify = reconstruct_simplify_options(reconstruct_options(state));
  simplify.tolerance = reconstruct_tolerance(state);
  return simplify.kernel(!double_positions);
}

Json decimate_first_block(MeshBlock& block, std::uint64_t first_brick, std::uint64_t bricks,
                          const Lattice& lattice, const DecimateOptions& kernel,
                          const std::function<void(std::uint64_t, MeshBlock&&)>& sink) {
  const DecimateReport report = decimate(block, block, kernel);
  const MeshBlockCut cut = block_of(first_brick, bricks);
  std::vector<std::uint64_t> brick;
  brick.reserve(block.faces.size());
  for (const auto& f : block.faces)
    brick.push_back(cut.brick_of(lattice, block.position[f[0]], block.position[f[1]], block.position[f[2]]));
  split_faces(block, brick, sink);
  return to_json(report);
}

struct FirstPass::Impl {
  TaskContext& context;
  const std::size_t task;
  const MeshFrame frame;
  const MeshStoreInfo info;
  DecimateOptions kernel;
  std::uint64_t min_faces = 0;  ///< islands with fewer go
  MeshFileWriter full;
  std::optional<MeshFileWriter> first;  ///< where the first pass runs here
  std::optional<SideFileWriter> sides;  ///< where cells are of one size
  /// Bricks of the largest blocks, of those at work. Without a first pass blocks only tell islands: with levels the
  /// bricks of an eighth have one size.
  std::uint64_t cube = kOctant, block_bricks = kOctant;
  std::uint64_t last_brick = 0, block_faces = 0;  ///< and what came of its block so far
  std::uint64_t level = 0;                        ///< of its bricks
  std::vector<Piece> pieces;                      ///< of the block, not yet finished
  std::vector<IslandPart> parts;
  std::vector<IslandSeam> seams;
  Json counts = Json::object();
  std::uint64_t blocks = 0, dropped = 0, dropped_faces = 0, crossing_pairs = 0;

  Impl(const JobState& state, TaskContext& c, std::size_t t)
      : context(c),
        task(t),
        frame(frame_of(state)),
        info(info_of(frame)),
        full(c.create(kFullFolder + task_file_stem(t) + ".tmm"), info) {
    const ReconstructOptions options = reconstruct_options(state);
    min_faces = options.min_component != 0 ? options.min_component : automatic_min_component(0);
    if (options.fuses_first_pass()) {
      first.emplace(c.create(kFirstPassFolder + task_file_stem(t) + ".tmm"), info);
      cube = block_bricks = kCube;
    }
    if (!options.has_levels()) sides.emplace(c.create(side_file(t)), frame);
    kernel = first_pass_kernel(state, info.double_positions);
  }

  void take(std::uint64_t next, int brick_level, MeshBlock&& mesh, std::vector<SafePlace>&& safe) {
    if (next / cube != last_brick / cube)
      begin_block(cube);
    else if (next / kOctant != last_brick / kOctant && block_bricks < cube)
      begin_block(kOctant);
    last_brick = next;
    level = static_cast<std::uint64_t>(brick_level);
    if (mesh.faces.empty()) return;
    block_faces += mesh.faces.size();
    pieces.push_back({next, std::move(mesh), std::move(safe)});
    if (block_bricks == 1) return flush();
    while (block_faces > kMaxFaces && block_bricks > 1) divide_block();
  }
  void begin_block(std::uint64_t bricks) {
    flush();
    block_bricks = bricks;
  }
  void flush() {
    if (!pieces.empty()) finish_block(pieces, block_bricks);
    pieces.clear();
    block_faces = 0;
  }
  /// Bricks of a cube that has too many faces go by eighths as soon as that shows, so few wait in memory.
  void divide_block() {
    block_bricks /= kOctant;
    const auto block = [&](std::size_t piece) { return pieces[piece].brick / block_bricks; };
    std::size_t done = 0;
    for (std::size_t i = 1; i <= pieces.size(); ++i) {
      if (i == pieces.size() ? block_bricks > 1 : block(i) == block(done)) continue;
      finish_block({&pieces[done], i - done}, block_bricks);
      done = i;
    }
    pieces.erase(pieces.begin(), pieces.begin() + static_cast<std::ptrdiff_t>(done));
    block_faces = 0;
    for (const Piece& piece : pieces) block_faces += piece.mesh.faces.size();
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
    uncross(of, block, complete, bricks);
    for (Piece& piece : of) {
      full.add(piece.brick, piece.mesh, kPatchCompact | content_of(bricks));
      piece.mesh = MeshBlock{};
    }
    if (block.faces.empty()) return;
    for (std::size_t v = 0; v < complete.size(); ++v)
      if (!complete[v]) seams.push_back({block.key[v], parts.size() + components.of_vertex[v]});
    for (std::uint32_t c = 0; c < components.faces.size(); ++c)
      parts.push_back({first_brick, static_cast<std::uint32_t>(bricks), c, components.faces[c],
                       components.border[c], components.folded[c], static_cast<std::uint32_t>(level)});

    ++blocks;
    if (!first) return;
    add_counts(counts,
               decimate_first_block(block, first_brick, bricks, info.lattice, kernel,
                                    [&](std::uint64_t key, MeshBlock&& patch) { first->add(key, patch); }));
  }

  /// Faces that cross at the sides of a block, with corners that others hold, are left to the pass "sides".
  void uncross(std::span<Piece> of, MeshBlock& block, std::span<const std::uint8_t> complete,
               std::uint64_t bricks) {
    std::vector<SafePlace> safe;
    for (const Piece& piece : of) safe.insert(safe.end(), piece.safe.begin(), piece.safe.end());
    const Uncrossed mended = uncross_block(block, safe, complete,
                                           frame.lattice.h * static_cast<double>(std::uint64_t{1} << level));
    crossing_pairs += mended.pairs;
    for (Piece& piece : of) take_back(piece.mesh, mended.returned);
    if (sides)
      sides->add(of.front().brick / bricks * bricks, static_cast<std::uint32_t>(bricks), block, safe);
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
      if (components.open[c] || components.faces[c] >= min_faces) continue;
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
  impl_->take(brick_key(brick), patch.level, make_mesh_block(patch, impl_->frame),
              safe_places(patch, impl_->frame));
}

Json FirstPass::finish() {
  Impl& self = *impl_;
  self.flush();
  self.context.count_written(self.full.finish());
  if (self.first) self.context.count_written(self.first->finish());
  if (self.sides) self.context.count_written(self.sides->finish());
  PackedWriter file(self.context.create(island_file(self.task)), kIslandKind, kPassBuffer);
  const std::vector<IslandEntry> table = {{file.append(bytes_of(self.parts)),
                                           file.append(bytes_of(self.seams)), self.dropped,
                                           self.dropped_faces}};
  self.context.count_written(file.finish(table));
  self.counts["blocks"] = self.blocks;
  self.counts["crossing_pairs"] = self.crossing_pairs;
  return std::move(self.counts);
}

std::uint64_t FirstPass::max_block_faces(std::uint64_t brick_faces) {
  return std::max(std::min(kCube * brick_faces, kMaxFaces), brick_faces);
}

std::uint64_t FirstPass::bytes(std::uint64_t block_faces, std::uint64_t brick_faces) {
  const std::uint64_t faces = std::max(std::min(block_faces, kMaxFaces), brick_faces);
  // Of a block that turns out too large, what waits and what is at work are together as much and one brick more.
  return (faces + brick_faces) * kBytesPerFace + decimate_bytes(faces, 0) + 2 * DirectFile::kDefaultBuffer +
         (std::uint64_t{2} << 20);
}

}  // namespace tessera
