/// \file remesh_verdict.h
/// Whether what a round of remeshing leaves is what `--faces` asked for: how many faces, and of what shapes.
#pragma once
#include <cstdint>

#include "stream/files/json.h"
#include "stream/stages/remesh/remesh_options.h"

namespace tessera {

class RemeshVerdict {
 public:
  /// Of the faces asked for, how many may come out, and how many more of a small number.
  static constexpr double kMostTimesFaces = 1.2;
  static constexpr std::uint64_t kAlwaysMoreFaces = 100;

  /// \param options  outlives it \param edge  length of the round's edges
  RemeshVerdict(const RemeshJobOptions& options, double edge) : options_(options), edge_(edge) {}

  /// A tolerance asks for as many as it needs; edges of a length for as many as there are.
  [[nodiscard]] bool are_far_more(std::uint64_t faces, double times = kMostTimesFaces) const;
  /// \throws ValidationError  naming the way to get them all
  [[noreturn]] void refuse_far_more(std::uint64_t faces) const;
  /// Of edges that keep near to the input: whether shapes would be better if they did not.
  [[nodiscard]] static bool is_poor(const Json& round);
  /// Warns of poor shapes. \param round  what its last pass tells, with "quality"; comes back with the warning
  /// \throws ValidationError  where they are no shapes to go on with
  const Json& judge_shape(Json& round) const;

 private:
  const RemeshJobOptions& options_;
  double edge_;
};

}  // namespace tessera
