/// \file loop_batches.h
/// Collects boundary loops, and writes them with their positions whenever a task of "holes" has enough of them.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "kernels/holes/boundary_loops.h"
#include "stream/runtime/stage.h"
#include "stream/stages/surface/hole_files.h"
#include "stream/stages/weld/numbered_patches.h"

namespace tessera {

class LoopBatches {
 public:
  /// The welded mesh, which outlives it.
  struct Mesh {
    const std::filesystem::path& work;
    const PatchStore& store;
    const Numbering& numbering;
    bool has_colour = false;
  };
  /// \param task  of the stage, names the files; \param max_edges, max_vertices  of a batch and of its fillings, but for its
  /// last loop
  LoopBatches(const Mesh& mesh, std::size_t task, TaskContext& context, std::uint64_t max_edges,
              std::uint64_t max_vertices)
      : mesh_(mesh),
        task_(task),
        context_(context),
        max_edges_(max_edges),
        max_vertices_(max_vertices),
        numbered_(mesh.work, mesh.store, mesh.numbering) {}

  void add(HoleBoundary&& boundary);
  /// After the last one.
  void flush();
  std::uint64_t loops() const { return loops_; }

 private:
  std::vector<NamedLoop> gather();
  void load_positions(const std::vector<std::uint64_t>& need, std::vector<Double3>& position,
                      std::vector<std::uint32_t>& colour);

  Mesh mesh_;
  std::size_t task_;
  TaskContext& context_;
  std::uint64_t max_edges_, max_vertices_;
  NumberedPatches numbered_;
  std::vector<HoleBoundary> batch_;
  std::size_t batches_ = 0;
  std::uint64_t loops_ = 0, edges_ = 0, vertices_ = 0, cost_ = 0;
};

}  // namespace tessera
