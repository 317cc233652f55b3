/// \file patch_runs.h
/// Tasks over a store whose patches are each worked on for themselves.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "stream/meshes/mesh_store.h"

namespace tessera {

/// Patches [first, end) of a store.
struct PatchRun {
  std::size_t first = 0, end = 0;
};

/// All patches in their order, in runs of at least so many faces; the last one may have fewer.
inline std::vector<PatchRun> patch_runs(const MeshStore& store, std::uint64_t min_faces) {
  std::vector<PatchRun> runs;
  const auto patches = store.patches();
  PatchRun run;
  std::uint64_t faces = 0;
  for (std::size_t p = 0; p < patches.size(); ++p) {
    faces += patches[p].faces;
    if (faces < min_faces && p + 1 < patches.size()) continue;
    run.end = p + 1;
    runs.push_back(run);
    run.first = p + 1;
    faces = 0;
  }
  return runs;
}

}  // namespace tessera
