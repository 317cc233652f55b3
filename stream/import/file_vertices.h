/// \file file_vertices.h
/// The vertices of a mesh file, range by range, on all threads where the file can be read so.
#pragma once
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "stream/formats/mesh_parts.h"
#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

/// null: the file is read in order.
MeshRanges* find_ranges(MeshReader& mesh);

/// Where floats hold them and as many as the header promises fit, they are kept when they come the first time.
class FileVertices {
 public:
  using Sink = std::function<void(std::span<const Double3>, std::span<const std::uint32_t>)>;

  /// \param max_bytes  of what is kept   \param lanes  ranges read at once
  FileVertices(MeshReader& mesh, std::uint64_t max_bytes, std::size_t lanes);

  /// Ranges of kImportRange vertices that follow one another; or one, of all of them. More, once they are kept.
  std::size_t ranges() const;
  std::size_t lanes() const { return lanes_; }
  /// Hands out a range in batches. From any thread.
  void read(std::size_t range, const Sink& sink);
  /// Hands out all vertices, some ranges at once.
  void read_all(const Sink& sink);

 private:
  std::unique_ptr<MeshVertexPart> take_part();
  void read_kept(std::uint64_t begin, std::uint64_t end, const Sink& sink) const;
  void read_in_order(const Sink& sink);

  MeshReader& mesh_;
  const MeshRanges* file_ranges_;
  const std::size_t lanes_;
  bool keep_;
  std::atomic<bool> all_{false};  ///< are kept
  std::atomic<std::size_t> kept_ranges_{0};
  std::vector<Float3> position_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<MeshVertexPart>> parts_;  ///< to be used again
};

}  // namespace tessera
