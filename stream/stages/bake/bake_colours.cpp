#include "stream/stages/bake/bake_colours.h"

#include <algorithm>
#include <array>
#include <utility>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/points/plan.h"
#include "stream/stages/scan/point_colours.h"
#include "stream/survey/measured_points.h"

namespace tessera {
namespace {

constexpr std::size_t kReadAhead = 3;  ///< slices of a scan

class ScanColours : public BakeColours {
 public:
  ScanColours(const std::vector<std::filesystem::path>& scans, const ScanColourChoice& choice)
      : points_(open_measured_scans(scans, {}, kReadAhead)), choice_(choice) {
    if (choice.normals && !points_->attributes.normals)
      throw InputError(scans.front().string() +
                       ": its points have no normals, so there is nothing for --normal-map to show; give "
                       "--from a finer mesh");
    if (choice.intensity && !points_->attributes.intensity_16)
      throw InputError(scans.front().string() +
                       ": its points have no intensity, so there is nothing for --colour intensity to show");
    if (!choice.intensity && !points_->attributes.colour)
      throw InputError(scans.front().string() + ": its points have no colours, so there is nothing to bake");
  }
  void read(const Double3& shift, TaskContext& context, const TexturePointSink& sink) override {
    const Double3 by = points_->shift - shift;
    Plan shown;  // the range of intensities alone
    if (choice_.intensity) {
      IntensityHistogram histogram;
      points_->read([&](const PointChunk& chunk) {
        context.check_stop();
        histogram.add(chunk);
        context.advance(chunk.size());
      });
      shown.colour_range = histogram.range();
    }
    std::vector<std::uint32_t> grey;
    points_->read([&](const PointChunk& chunk) {
      context.check_stop();
      context.advance(chunk.size());
      if (choice_.intensity) colour_points(ColourBy::kIntensity, shown, chunk, {}, grey);
      const std::vector<std::uint32_t>& rgba = choice_.intensity ? grey : chunk.rgba;
      if (choice_.intensity ? chunk.intensity.empty() : rgba.empty())
        return;  // of a scan without, among others
      for (std::size_t i = 0; i < chunk.size(); ++i)
        sink(Double3{chunk.x[i], chunk.y[i], chunk.z[i]} + by, rgba[i] & 0xffffffu,
             choice_.normals && !chunk.nx.empty()
                 ? unit_or_zero(Double3{chunk.nx[i], chunk.ny[i], chunk.nz[i]})
                 : Double3{});
    });
  }
  std::uint64_t units() const override { return (choice_.intensity ? 2 : 1) * points_->points_about; }
  std::uint64_t bytes() const override { return kReadAhead * kSliceMemory; }
  bool has_normals() const override { return choice_.normals; }
  Crs crs() const override { return points_->crs; }
  std::uint64_t left_out() const override { return points_->left_out; }
  std::vector<std::string> notices() const override { return points_->notices(); }

 private:
  std::unique_ptr<MeasuredPoints> points_;
  ScanColourChoice choice_;
};

class StoreColours : public BakeColours {
 public:
  StoreColours(MeshStore mesh, bool colourless) : mesh_(std::move(mesh)) {
    if (!mesh_.info().colour && !colourless)
      throw InputError("the mesh that colours come from has no colours, so there is nothing to bake");
  }
  /// Vertices with the normals of their stars, each once.
  void read(const Double3& shift, TaskContext& context, const TexturePointSink& sink) override {
    const Double3 by = mesh_.info().shift - shift;
    for (std::size_t p = 0; p < mesh_.patches().size(); ++p) {
      context.check_stop();
      const MeshHaloBlock near = mesh_.load_near(std::array{p}, 0.0);
      const MeshBlock& block = near.block;
      std::vector<Double3> normal(block.key.size(), Double3{});
      for (const auto& f : block.faces) {
        const Double3 n = triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]);
        for (const std::uint32_t v : f) normal[v] = normal[v] + n;
      }
      for (const std::uint32_t v : near.core_vertices.at(0))
        if (near.first_patch[v] == p)
          sink(block.position[v] + by, mesh_.info().colour ? block.rgba[v] & 0xffffffu : 0xffffffu,
               unit_or_zero(normal[v]));
      context.advance(mesh_.patches()[p].vertices);
    }
  }
  std::uint64_t units() const override {
    std::uint64_t vertices = 0;
    for (const MeshPatchEntry& p : mesh_.patches()) vertices += p.vertices;
    return vertices;
  }
  std::uint64_t bytes() const override { return 8 * mesh_.largest_patch_bytes(); }
  bool has_normals() const override { return true; }

 private:
  MeshStore mesh_;
};

class DirectedColours : public BakeColours {
 public:
  DirectedColours(std::unique_ptr<BakeColours> colours, MeshStore mesh)
      : colours_(std::move(colours)), directions_(std::move(mesh), true) {}
  void read(const Double3& shift, TaskContext& context, const TexturePointSink& sink) override {
    colours_->read(shift, context, sink);
    directions_.read(shift, context, [&](const Double3& p, std::uint32_t, const Double3& normal) {
      if (normal != Double3{}) sink(p, kNoPointColour, normal);
    });
  }
  std::uint64_t units() const override { return colours_->units() + directions_.units(); }
  std::uint64_t bytes() const override { return std::max(colours_->bytes(), directions_.bytes()); }
  bool has_normals() const override { return true; }
  Crs crs() const override { return colours_->crs(); }
  std::uint64_t left_out() const override { return colours_->left_out(); }
  std::vector<std::string> notices() const override { return colours_->notices(); }

 private:
  std::unique_ptr<BakeColours> colours_;
  StoreColours directions_;
};

}  // namespace

std::unique_ptr<BakeColours> with_directions(std::unique_ptr<BakeColours> colours, MeshStore mesh) {
  return std::make_unique<DirectedColours>(std::move(colours), std::move(mesh));
}
std::unique_ptr<BakeColours> colours_of_scans(const std::vector<std::filesystem::path>& scans,
                                              const ScanColourChoice& choice) {
  return std::make_unique<ScanColours>(scans, choice);
}
std::unique_ptr<BakeColours> colours_of_store(MeshStore mesh, bool colourless) {
  return std::make_unique<StoreColours>(std::move(mesh), colourless);
}

}  // namespace tessera
