/// \file mesh_deviation.h
/// How far a mesh lies from another one, everywhere on its faces: for colours in pictures and pages. Proofs are
/// mesh_compare.h's.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>

#include "kernels/certify/deviation_samples.h"
#include "stream/files/scratch_folder.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

class MeshDeviation {
 public:
  /// Imports both. \param with_sign  negative behind the closest face of the reference
  /// \param temp  folder for what is streamed \param memory_bytes  cap of the process
  /// \param who   the option, as messages name it \param check  called every few hundred distances, may throw; may be empty
  /// \throws InputError; ResourceError when the cap cannot suffice, naming one that would, or the disk is full
  MeshDeviation(const std::filesystem::path& mesh, const std::filesystem::path& reference, bool with_sign,
                const std::filesystem::path& temp, std::uint64_t memory_bytes, const char* who,
                std::function<void()> check = {});

  const MeshStore& mesh() const { return *mesh_; }
  /// All faces, cut until no side exceeds a 400th of the diagonal, in an order of their own, with distances at corners.
  /// \param limit  > 0: distances beyond it are infinite. \throws ResourceError, StoppedError
  void for_each(double limit, const std::function<void(const DeviationTriangle&)>& sink) const;
  /// End of a scale: the 99th percentile by corners, rounded up to two digits; looks as far as a 16th of the diagonal.
  double scale() const;

 private:
  /// The percentile; none when it lies beyond the limit.
  std::optional<double> scale_within(double limit) const;

  ScratchFolder scratch_;
  std::optional<MeshStore> mesh_, reference_;
  std::uint64_t memory_bytes_;
  bool with_sign_;
  const char* who_;
  std::function<void()> check_;
  double size_ = 0.0;
};

}  // namespace tessera
