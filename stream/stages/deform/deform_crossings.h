/// \file deform_crossings.h
/// How many pairs of faces meet beyond what they share (mesh_crossings.h) before an edit and after it. An edit may fold what it
/// moves: that is told, not taken back.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>

#include "stream/files/json.h"

namespace tessera {

struct DeformCrossingOptions {
  std::uint64_t memory_bytes = 0;
  std::filesystem::path temp;
  int threads = 1;
  std::function<void()> check_stop;
};

/// Adds to the result of a stage that wrote a mesh `crossings`: {before {cross, overlap, touch}, after {the same, faces, listed
/// pairs with places}}. Where there are more after than before, and where the memory does not hold the search, a sentence stands
/// under `warnings`.
void add_deform_crossings(Json& result, const std::filesystem::path& before,
                          const std::filesystem::path& after, const DeformCrossingOptions& options);

}  // namespace tessera
