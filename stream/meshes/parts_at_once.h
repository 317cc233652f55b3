/// \file parts_at_once.h
/// How many parts of a mesh are on their way from a file or to one, where the work is done with one at a time too.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "stream/runtime/stage.h"

namespace tessera {

/// One a thread, and one that waits for its turn, where half of the cap holds them.
/// \param one_bytes  of the stage with one at once   \param part_bytes  of each more
inline std::size_t parts_at_once(const RunOptions& run, std::uint64_t one_bytes, std::uint64_t part_bytes) {
  const std::uint64_t half = run.memory_bytes / 2;
  const std::uint64_t more =
      half > one_bytes ? (half - one_bytes) / std::max<std::uint64_t>(1, part_bytes) : 0;
  return 1 + static_cast<std::size_t>(
                 std::min<std::uint64_t>(more, static_cast<std::uint64_t>(std::max(1, run.threads))));
}

/// No stage of at most these bytes takes more with parts_at_once().
inline std::uint64_t max_bytes_at_once(const RunOptions& run, std::uint64_t one_bytes,
                                       std::uint64_t part_bytes) {
  const std::uint64_t all = one_bytes + static_cast<std::uint64_t>(std::max(1, run.threads)) * part_bytes;
  return std::max(one_bytes, std::min(all, run.memory_bytes / 2));
}

}  // namespace tessera
