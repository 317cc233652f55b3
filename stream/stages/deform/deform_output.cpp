#include "stream/stages/deform/deform_output.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "stream/formats/meshes/mesh_precision.h"

namespace tessera {

MeshCounts count_mesh(MeshReader& mesh, TaskContext& context) {
  MeshCounts n;
  mesh.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
    context.check_stop();
    n.vertices += batch.size();
  });
  mesh.read_faces([&](std::span<const MeshFace> batch) {
    context.check_stop();
    n.faces += batch.size();
  });
  return n;
}

MeshBox bounds_of(std::span<const Double3> points) {
  MeshBox box = {points.front(), points.front()};
  for (const Double3& p : points) {
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], p[k]);
      box.high[k] = std::max(box.high[k], p[k]);
    }
  }
  return box;
}

void place_output(MeshHeader& header, const std::filesystem::path& output, const MeshBox& box, bool stays) {
  const double fine = fine_rounding(header.faces, box.low, box.high, 0.0);
  if (!stays && float_rounding({0, 0, 0}, box.low, box.high) > fine) header.double_positions = true;
  header.origin = place_mesh(output, header.double_positions, box.low, box.high, fine).origin;
}

void write_deformed_faces(MeshReader& mesh, bool reverse, MeshWriter& writer, TaskContext& context) {
  std::vector<MeshFace> reversed;
  mesh.read_flagged_faces([&](std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) {
    context.check_stop();
    if (reverse) {
      reversed.assign(faces.begin(), faces.end());
      for (MeshFace& f : reversed) std::swap(f[1], f[2]);
      faces = reversed;
    }
    writer.faces(faces, synthetic);
  });
}

}  // namespace tessera
