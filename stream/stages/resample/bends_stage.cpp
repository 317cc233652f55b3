#include <algorithm>

#include "kernels/blends/curvature_tensors.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/mesh_blocking.h"
#include "stream/stages/resample/blend_file.h"
#include "stream/stages/resample/resample_stages.h"

namespace tessera {
namespace {

constexpr double kScaleEdges = 4.0;
constexpr std::uint64_t kTaskFaces = 1u << 19;

class CurvaturesStage : public Stage {
 public:
  CurvaturesStage(const JobState& state, const ResampleOptions& options)
      : work_(state.work),
        store_(open_imported_mesh(state.work, kResampleImport)),
        options_(options),
        scale_(MeshScale::of_work(state.work)) {
    band_.radius = options_.scale > 0.0 ? options_.scale : kScaleEdges * scale_.edge;
    if (!searches()) {
      first_.push_back(0);
      return;
    }
    blocks_ = make_blocks(store_, {options_.block_faces});
    first_ = tasks_by_faces(blocks_, kTaskFaces);
  }

  std::string name() const override { return "bends"; }
  std::size_t task_count() const override { return first_.size() - 1; }
  std::uint64_t units() const override { return searches() ? store_.face_count() : 0; }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t b = first_[task]; b < first_[task + 1]; ++b) {
      const auto near = store_.select(grown(store_.box_of(blocks_[b].patches), band_.radius));
      std::uint64_t vertices = 0, faces = 0;
      for (const std::size_t p : near)
        vertices += store_.patches()[p].vertices, faces += store_.patches()[p].faces;
      maximum = std::max(maximum, curvatures_task_bytes(store_.block_bytes(near), vertices, faces));
    }
    return maximum;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    BandPart part;
    for (std::size_t b = first_[task]; b < first_[task + 1]; ++b) {
      context.check_stop();
      search(store_.load_near(blocks_[b].patches, band_.radius), part);
      context.advance(blocks_[b].faces);
    }
    context.count_written(part.save(context.create(part_file(task))));
    return {{"vertices", part.vertices.size()}};
  }

  std::uint64_t finish_bytes() const override {
    std::uint64_t vertices = 0, links = 0;
    for (std::size_t task = 0; task < task_count(); ++task) {
      if (!std::filesystem::exists(work_ / part_file(task))) continue;
      const auto [v, l] = BandPart::count(work_ / part_file(task));
      vertices += v, links += l;
    }
    return 2 * (vertices * sizeof(BandVertex) + links * 16) + trace_bands_bytes(vertices, links) +
           (std::uint64_t{4} << 20);
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    std::vector<FoundCurve> curves;
    std::uint64_t in_bands = 0;
    if (!searches()) {
      for (const NamedCurve& t : parse_curves(options_.blends, "the blends")) {
        FoundCurve found{t.name, curve_through(t.points, t.closed, scale_.edge), true};
        found.curve.half_width = 0.5 * t.width;
        found.curve.key = curves.size();
        curves.push_back(std::move(found));
      }
    } else {
      for (BlendCurve& t : trace(summaries.size(), context, in_bands))
        curves.push_back({std::to_string(curves.size() + 1), std::move(t), false});
    }
    save_blend_curves(context.create(kCurvesFile), curves);
    Json result = {{"radius", band_.radius}, {"band_vertices", in_bands}, {"tracks", curves.size()}};
    if (curves.empty())
      result["warnings"] = {
          "no blend was found: the mesh is written as it is; try another --scale, or name blends in "
          "a file for --blends"};
    return result;
  }

  std::vector<std::string> obsolete() const override { return {"bends/"}; }

 private:
  bool searches() const { return options_.blends == "auto"; }
  static std::string part_file(std::size_t task) { return "bends/" + task_file_stem(task) + ".tsb"; }

  void search(const MeshHaloBlock& near, BandPart& part) const {
    const MeshBlock& block = near.block;
    std::vector<std::uint8_t> wanted(block.key.size(), 0);
    for (std::size_t f = 0; f < block.faces.size(); ++f)
      if (near.core[f])
        for (const std::uint32_t v : block.faces[f]) wanted[v] = 1;
    const std::vector<CurvatureTensor> curvatures = curvature_tensors(block, wanted, band_.radius);
    for (std::size_t v = 0; v < curvatures.size(); ++v) {
      wanted[v] = wanted[v] && is_in_band(curvatures[v].across, curvatures[v].minimum, band_);
      if (wanted[v])
        part.vertices.push_back({block.key[v], block.position[v], curvatures[v].normal, curvatures[v].along,
                                 curvatures[v].across});
    }
    for (std::size_t f = 0; f < block.faces.size(); ++f) {
      if (!near.core[f]) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = block.faces[f][k], b = block.faces[f][(k + 1) % 3];
        if (wanted[a] && wanted[b]) part.links.emplace_back(std::minmax(block.key[a], block.key[b]));
      }
    }
  }

  std::vector<BlendCurve> trace(std::size_t parts, TaskContext& context, std::uint64_t& in_bands) const {
    BandPart all;
    for (std::size_t task = 0; task < parts; ++task) {
      context.check_stop();
      BandPart part = BandPart::load(work_ / part_file(task));
      all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
      all.links.insert(all.links.end(), part.links.begin(), part.links.end());
    }
    // Vertices at seams come from every block that has them, with the same bits.
    std::sort(all.vertices.begin(), all.vertices.end(),
              [](const BandVertex& a, const BandVertex& b) { return a.key < b.key; });
    all.vertices.erase(std::unique(all.vertices.begin(), all.vertices.end(),
                                   [](const BandVertex& a, const BandVertex& b) { return a.key == b.key; }),
                       all.vertices.end());
    std::sort(all.links.begin(), all.links.end());
    all.links.erase(std::unique(all.links.begin(), all.links.end()), all.links.end());
    const auto index_of = [&](std::uint64_t key) {
      return static_cast<std::uint32_t>(
          std::lower_bound(all.vertices.begin(), all.vertices.end(), key,
                           [](const BandVertex& v, std::uint64_t k) { return v.key < k; }) -
          all.vertices.begin());
    };
    std::vector<std::pair<std::uint32_t, std::uint32_t>> links;
    links.reserve(all.links.size());
    for (const auto& [a, b] : all.links) links.emplace_back(index_of(a), index_of(b));
    in_bands = all.vertices.size();
    return trace_bands(all.vertices, links, band_, scale_.edge);
  }

  std::filesystem::path work_;
  MeshStore store_;
  ResampleOptions options_;
  MeshScale scale_;
  BandOptions band_;
  std::vector<MeshBlockCut> blocks_;
  std::vector<std::size_t> first_;  ///< block per task, one more at the end
};

}  // namespace

std::uint64_t curvatures_task_bytes(std::uint64_t block_bytes, std::uint64_t vertices, std::uint64_t faces) {
  return 2 * block_bytes + curvature_tensors_bytes(vertices, faces) + vertices * sizeof(BandVertex) +
         faces * 48 + (std::uint64_t{4} << 20);
}

std::unique_ptr<Stage> make_curvatures_stage(const JobState& state, const ResampleOptions& options) {
  return std::make_unique<CurvaturesStage>(state, options);
}

}  // namespace tessera
