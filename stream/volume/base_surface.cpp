#include "stream/volume/base_surface.h"

#include <algorithm>
#include <array>

#include "stream/meshes/mesh_column.h"

namespace tessera {
namespace {

/// A batch for every patch.
class MeshBase : public BaseSurface {
 public:
  MeshBase(const MeshStore& mesh, const Double3& origin) : mesh_(mesh), origin_(origin) {}
  std::uint64_t window_bytes(const MeshBox& window) const override {
    std::uint64_t most = 0;
    for (const std::size_t patch : mesh_.select(column_of(window, mesh_.box())))
      most = std::max(most, mesh_.block_bytes(std::array{patch}));
    return 4 * most;
  }
  void for_triangles(const MeshBox& window, const Use& use) const override {
    for (const std::size_t patch : mesh_.select(column_of(window, mesh_.box())))
      use(triangles_of(mesh_.load(std::array{patch}), origin_));
  }
  double low() const override { return mesh_.box().low[2]; }
  double high() const override { return mesh_.box().high[2]; }

 private:
  const MeshStore& mesh_;
  Double3 origin_;
};

}  // namespace

std::unique_ptr<BaseSurface> mesh_base(const MeshStore& mesh, const Double3& origin) {
  return std::make_unique<MeshBase>(mesh, origin);
}

}  // namespace tessera
