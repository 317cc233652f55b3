#include "stream/commands/face_groups.h"

#include <limits>
#include <string>
#include <vector>

#include "octree/error.h"
#include "octree/union_find.h"
#include "stream/files/external_sort.h"

namespace tessera {
namespace {

/// A face of a component, by the component's first vertex.
struct GroupedFace {
  std::uint64_t component = 0, face = 0;
  MeshFace corners{};
  std::uint64_t synthetic = 0;
  bool operator<(const GroupedFace& o) const {
    return component != o.component ? component < o.component : face < o.face;
  }
};

constexpr std::uint32_t kNoComponent = std::numeric_limits<std::uint32_t>::max();

}  // namespace

std::uint64_t write_face_groups(MeshReader& mesh, std::uint64_t vertices, MeshWriter& writer,
                                const FaceGroupOptions& options) {
  const auto stop = [&] {
    if (options.check_stop) options.check_stop();
  };
  if (vertices >= kNoComponent || vertices * 4 > options.memory_bytes / 2)
    throw ResourceError("groups by component hold 4 bytes of every vertex, and the mesh has " +
                        std::to_string(vertices) + "; write it without --groups, or decimate it first");
  DisjointSets<std::uint32_t> sets(static_cast<std::size_t>(vertices));
  mesh.read_faces([&](std::span<const MeshFace> faces) {
    stop();
    for (const MeshFace& f : faces)
      for (std::size_t k = 1; k < 3; ++k)
        sets.unite(static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[k]));
  });
  const std::vector<std::uint32_t>& root = sets.roots();
  ExternalSort<GroupedFace> sort(options.temp, options.memory_bytes / 2);
  std::uint64_t at = 0;
  const bool flagged = mesh.has_synthetic();
  mesh.read_flagged_faces([&](std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) {
    stop();
    for (std::size_t i = 0; i < faces.size(); ++i)
      sort.add({root[faces[i][0]], at++, faces[i], flagged ? synthetic[i] : std::uint64_t{0}});
  });
  std::uint64_t components = 0, component = kNoComponent;
  std::vector<MeshFace> faces;
  std::vector<std::uint8_t> flags;
  const auto flush = [&] {
    if (!faces.empty()) writer.faces(faces, flags);
    faces.clear(), flags.clear();
  };
  sort.drain([&](std::span<const GroupedFace> batch) {
    stop();
    for (const GroupedFace& f : batch) {
      if (f.component != component) {
        flush();
        component = f.component;
        writer.group("component_" + std::to_string(++components));
      }
      faces.push_back(f.corners);
      if (flagged) flags.push_back(static_cast<std::uint8_t>(f.synthetic));
    }
    flush();
  });
  return components;
}

}  // namespace tessera
