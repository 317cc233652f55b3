/// \file certify_stage.h
/// The proof at the end of a job that changes a mesh: both ways against the reference, by a code path of its
/// own (mesh_compare.h). A result that is not proven gets no name: another round is made, or the job ends.
#pragma once
#include <functional>
#include <memory>
#include <string>

#include "stream/formats/meshes/mesh_precision.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

struct CertifyRequest {
  std::string name;        ///< of the stage
  double tolerance = 0.0;  ///< scan units; 0 = measure and report only
  double scale = 0.0;  ///< of what is only measured: five quarters of it is told; 0 = a share of the diagonal
  bool tight = true;   ///< false: a bound up to the tolerance, or the scale, is as good as a tight one
  std::function<MeshStore(const JobState&)> mesh;
  std::function<MeshStore(const JobState&)> reference;
  /// How the job's output holds the mesh: what rounding may move its vertices by is added to every bound, and to the
  /// tolerance, which is what the job left of its own (tolerance_before_rounding).
  MeshPlacement placement = {};
  std::string
      failed_file;  ///< name of the file of faces that are not proven, or cross, if any; empty = no other round
  std::string
      crossing_file;  ///< name of a file of faces that cross though they are proven, if it is there: another round as well
  /// The stage and mesh of the round before, same reference: what has not changed since is taken from it. Empty = none.
  std::string name_before;
  std::function<MeshStore(const JobState&)> mesh_before;
};

// What a task and the end take at most. \param cell_bytes  CompareCell::bytes of the largest cell
std::uint64_t certify_task_bytes(std::uint64_t cell_bytes);
std::uint64_t certify_finish_bytes(std::uint64_t cell_bytes, std::uint64_t cells);
std::uint64_t certify_lane_bytes(
    std::uint64_t cell_bytes);  ///< of one more cell that the end compares at once

/// finish() throws ValidationError (exit code 6) when the tolerance is not proven and there is no other round.
std::unique_ptr<Stage> make_certify_stage(const JobState& state, const CertifyRequest& request);

}  // namespace tessera
