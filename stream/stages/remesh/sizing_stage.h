/// \file sizing_stage.h
/// How long edges are to be, and how many faces that makes of every brick: known before the first pass.
#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "stream/files/json.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"
#include "stream/stages/remesh/remesh_options.h"

namespace tessera {

struct Sizing {
  double edge = 0.0;      ///< scan units; the longest where they adapt
  double shortest = 0.0;  ///< where they adapt
  bool fine = false;      ///< they follow the surface closely (RemeshJobOptions::may_be_fine)
  std::map<std::uint64_t, std::uint64_t> faces;  ///< expected of each brick of the imported mesh
  std::uint64_t left = 0;  ///< faces that the round before left, with shorter edges; 0: this is the first
  std::uint64_t expected(const MeshPatchEntry& patch) const;
  /// With edges so many times longer, where what there is has `found` faces.
  Sizing longer(double times, std::uint64_t found) const;
  /// With edges of the same length that keep less near to the input.
  Sizing coarser() const;
  /// Of a round.
  static Sizing of_work(const std::filesystem::path& work, int round = 0);
  Json to_json() const;
};
std::string sizing_file(int round);
/// The round in which edges got the length that they have in this one.
int first_round_of_size(const std::filesystem::path& work, int round);
/// Whether a round left far more faces than asked for, or poor shapes: the next one asks for less, and does all anew.
bool was_too_fine(const std::filesystem::path& work, int round);

/// The last round that there is so far: of the proof, around faces that crossed, or with longer edges.
int last_remesh_round(const std::filesystem::path& work);

/// Sums areas, and curvatures where these decide, patch by patch.
/// \throws ValidationError  when it ends, where a tolerance alone asks for thousands of faces for each of the input
std::unique_ptr<Stage> make_sizing_stage(const JobState& state, const RemeshJobOptions& options);

}  // namespace tessera
