/// \file face_source.h
/// The faces of the mesh that a job is about to write, part by part, wherever they lie in its work directory.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "octree/lattice.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Faces of one patch.
struct PlacedFaces {
  std::vector<Double3> position;  ///< cells from the lattice origin
  std::vector<std::array<std::uint32_t, 3>> faces;
};

/// Thread-safe for reading. The parts are the same for every cut into tasks, and so is every number of a part.
class FaceSource {
 public:
  virtual ~FaceSource() = default;
  virtual std::size_t task_count() const = 0;
  virtual std::uint64_t task_bytes(std::size_t task) const = 0;
  virtual std::uint64_t face_count() const = 0;
  virtual void read(std::size_t task, const std::function<void(const PlacedFaces&)>& use) const = 0;
};

/// Of patches that are welded, with their borders moved and their holes filled.
/// \pre the passes weld, border and holes are done
std::unique_ptr<FaceSource> welded_faces(const JobState& state);
/// Of a store. \param lattice  in whose cells positions are told
std::unique_ptr<FaceSource> stored_faces(MeshStore store, const Lattice& lattice);

/// What a task takes at most. \param vertices, faces  of the largest patch
std::uint64_t welded_faces_bytes(std::uint64_t vertices, std::uint64_t faces, std::uint64_t filling_bytes);
std::uint64_t stored_faces_bytes(std::uint64_t block_bytes);

}  // namespace tessera
