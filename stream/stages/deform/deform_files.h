/// \file deform_files.h
/// What the stages of a deformation hand on, and what `prepare` leaves for `apply`: base surface, basis functions, and where
/// every vertex of the mesh stands over the base, in the order of the mesh's file.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "kernels/edit/edit_basis.h"
#include "kernels/edit/layer_levels.h"
#include "kernels/edit/normal_displacement.h"
#include "stream/files/packed_file.h"

namespace tessera {

/// Vertices that are encoded together.
inline constexpr std::size_t kDisplacedVertices = std::size_t{1} << 16;

struct BaseSurface {
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<Double3> sharp{};  ///< positions before it was smoothed; empty: the same. A basis has none
  /// Above 0: edges are split (refined_base.h), and were so long in the mean around the support. A basis does not tell.
  double split_edge = 0.0;
  std::uint64_t given_crossings = 0;  ///< of a split one: faces at the support that crossed others before
  /// Of a split one: the mesh's own faces, over its first vertices. Empty: it is not split.
  std::vector<std::array<std::uint32_t, 3>> given_faces{};
};
void save_base(const std::filesystem::path& path, const BaseSurface& base);
BaseSurface load_base(const std::filesystem::path& path);

/// What `apply` must know of the mesh, and what the report says of the preparation.
struct DeformBasis {
  BaseSurface base;
  EditBasis edit;
  std::vector<LayerLevel> levels;  ///< for details that keep their volumes
  std::string
      about;  ///< JSON: handles, diagonal, report; with `prepare` mesh {path, bytes, xxh3, vertices, faces}
};

class BasisWriter {
 public:
  BasisWriter(const std::filesystem::path& path, const DeformBasis& basis);
  void add(const NormalDisplacements& batch);
  /// Returns bytes written.
  std::uint64_t finish(const std::string& about);

  struct Entry {
    std::uint64_t key;
    Section section;
  };

 private:
  void put(std::uint64_t key, std::span<const std::byte> bytes);
  PackedWriter file_;
  std::vector<Entry> table_;
  std::uint64_t batches_ = 0;
};

class BasisReader {
 public:
  /// \throws InputError for a file that is damaged or none of these
  explicit BasisReader(const std::filesystem::path& path);
  std::string about() const;
  DeformBasis load() const;
  std::uint64_t batches() const;
  /// Bytes of load() in memory.
  std::uint64_t bytes() const;
  /// Thread-safe. \pre batch < batches()
  NormalDisplacements batch(std::uint64_t batch) const;

 private:
  template <class T>
  std::vector<T> part(std::uint64_t key) const;
  PackedFile file_;
  std::map<std::uint64_t, Section> sections_;
};

}  // namespace tessera
