/// \file first_pass.h
/// The first pass of decimation inside the surface stage (`reconstruct --tolerance`): patches become blocks in memory,
/// the full-resolution surface goes to a compact store that later passes and the proof measure against, and what the
/// pass leaves goes to the store that the next pass reads. With --smooth the pass waits: the compact store is all.
///
/// A block is a fixed cube of 4^3 bricks of the lattice; where that holds too many faces, of 2^3 or of one brick. Vertices
/// at its faces have no complete star, so they stay; later passes have their seams elsewhere. Islands that end inside
/// a block and are too small whatever else there is go here, all others are left to the islands stage.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "kernels/decimate/decimate.h"
#include "stream/files/json.h"
#include "stream/files/packed_file.h"
#include "stream/meshes/mesh_blocking.h"
#include "stream/runtime/stage.h"

namespace tessera {

struct Patch;
struct ReconstructOptions;
struct SimplifyOptions;

/// What `--tolerance` of a reconstruction means, scan units. \pre the survey is done where it is `auto`
double reconstruct_tolerance(const JobState& state);
/// What `reconstruct --tolerance` decimates with, its tolerance as it was typed.
SimplifyOptions reconstruct_simplify_options(const ReconstructOptions& options);

inline constexpr int kFirstPassEdge = 4;  ///< bricks along the largest blocks

/// Beside MeshPatchContent: the brick's block has 2^3 bricks.
inline constexpr unsigned kPatchOctant = 16;

// What it leaves, in the work directory, one file a task of the surface stage.
inline constexpr const char* kFullFolder = "full/";               ///< the full-resolution surface
inline constexpr const char* kFirstPassFolder = "pass-1/";        ///< after the first pass
inline constexpr const char* kIslandFolder = "islands/";          ///< components of blocks (islands_stage.h)
inline constexpr const char* kPrunedFullFolder = "full-pruned/";  ///< patches that lost an island
inline constexpr const char* kPrunedPassFolder = "pass-1-pruned/";

/// The blocks of the first pass, from the store of the full-resolution surface.
std::vector<MeshBlockCut> first_pass_blocks(const MeshStore& full);

/// The full-resolution surface, and what the first pass left of it; both without the islands that went.
MeshStore open_full_surface(const JobState& state);
MeshStore open_first_pass(const JobState& state);

/// What decimates a block of the first pass.
DecimateOptions first_pass_kernel(const JobState& state, bool double_positions);
/// Does, and hands on what is left by bricks, in ascending order. \param block  its full surface; changed \returns the report
Json decimate_first_block(MeshBlock& block, std::uint64_t first_brick, std::uint64_t bricks,
                          const Lattice& lattice, const DecimateOptions& kernel,
                          const std::function<void(std::uint64_t, MeshBlock&&)>& sink);

/// A component of one block.
struct IslandPart {
  std::uint64_t brick = 0;      ///< first brick of the block, Morton code
  std::uint32_t bricks = 0;     ///< 1, 8 or 64: size of the block
  std::uint32_t component = 0;  ///< of the block
  std::uint32_t faces = 0;
  std::uint32_t border = 0;  ///< edges at which the surface ends
  std::uint32_t folded = 0;  ///< vertices at which it folds
  std::uint32_t level = 0;   ///< of its cells, with --levels: 0 is the finest
};
/// A vertex that blocks share.
struct IslandSeam {
  std::uint64_t key = 0;
  std::uint64_t part = 0;  ///< index of an IslandPart: in the file, later over all files
  auto operator<=>(const IslandSeam&) const = default;
};
/// What an island file says at its end.
struct IslandEntry {
  Section parts, seams;
  std::uint64_t dropped = 0;  ///< islands that went at once
  std::uint64_t dropped_faces = 0;
};
inline constexpr PackedKind kIslandKind = {"TSISLND5", "an island file"};
std::string island_file(std::size_t task);

/// One task's part.
class FirstPass {
 public:
  FirstPass(const JobState& state, TaskContext& context, std::size_t task);
  ~FirstPass();
  FirstPass(const FirstPass&) = delete;
  FirstPass& operator=(const FirstPass&) = delete;

  /// \pre extracted with names, bricks in ascending order
  void add(const Patch& patch);
  /// What it counted, as a pass reports it.
  Json finish();

  /// Most faces that its blocks have, unless a brick has more. \param brick_faces  of a brick, at most
  static std::uint64_t max_block_faces(std::uint64_t brick_faces);
  /// Upper bound of what it allocates. \param block_faces, brick_faces  most faces of a cube of kFirstPassEdge^3 bricks, of a brick
  static std::uint64_t bytes(std::uint64_t block_faces, std::uint64_t brick_faces);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
