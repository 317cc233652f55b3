/// \file check_call.h
/// `tessera check` as a call: what is true of a mesh, and whether another one stays within a tolerance of it.
#pragma once
#include <filesystem>
#include <functional>

#include "stream/check/mesh_check.h"
#include "stream/check/mesh_compare.h"
#include "stream/files/json.h"
#include "stream/runtime/options.h"

namespace tessera {

struct CheckCall {
  std::filesystem::path mesh;
  MeshCheckOptions options = {};         ///< threads, check_stop and temp are taken from below
  std::filesystem::path reference = {};  ///< compared with, where it is given
  CompareOptions compare = {};           ///< its tolerance must be set then
  RunOptions how = {};                   ///< memory, threads, temp; as for jobs
  std::function<bool()> go_on = {};      ///< asked every few milliseconds, any thread; false stops

  /// The report that `--json` writes: figures of the mesh, and under `deviation` those of the comparison, where `complaint`
  /// says in a sentence what is beyond the tolerance.
  /// \throws InputError for a mesh that cannot be read; ResourceError; StoppedError
  [[nodiscard]] Json run() const;
};

}  // namespace tessera
