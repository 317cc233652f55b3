// A mesh as a scene item in colours of its distance to a reference, cell by cell.
#include <algorithm>
#include <cmath>

#include "kernels/certify/deviation_samples.h"
#include "kernels/picture/caption.h"
#include "octree/error.h"
#include "stream/check/compare_cells.h"
#include "stream/files/scratch_folder.h"
#include "stream/import/import_mesh.h"
#include "stream/render/render_scene.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::size_t kBatchFaces = 32768;
constexpr std::uint64_t kCellFaces = 1u << 16;
constexpr double kEdgesPerDiagonal = 400.0;      // triangles of about two pixels
constexpr double kSearchPerDiagonal = 1.0 / 16;  // without a scale: how far the reference is looked for
constexpr int kBins = 4096;

class DeviationItem final : public SceneItem {
 public:
  DeviationItem(const std::filesystem::path& path, const RenderOptions& options, std::uint64_t memory_bytes,
                RenderReport& report)
      : path_(path), options_(options), scratch_(render_temp(options), "deviation") {
    RunOptions run;
    run.memory_bytes = memory_bytes != 0 ? memory_bytes : detect_memory_cap().bytes;
    run.threads = core_count();
    mesh_.emplace(import_mesh(path, scratch_.path(), "mesh", run, throw_if_stopped));
    reference_.emplace(import_mesh(options.deviation, scratch_.path(), "reference", run, throw_if_stopped));
    memory_bytes_ = run.memory_bytes;
    const double size = std::max(mesh_->diagonal(), 1e-300);
    edge_ = size / kEdgesPerDiagonal;
    high_ = options.tolerance > 0.0 ? options.tolerance : percentile(0.99, size * kSearchPerDiagonal);
    for (const MeshPatchEntry& patch : mesh_->patches()) vertices_ += patch.vertices;
    for (std::size_t i = 0; i < mesh_->patches().size(); ++i)
      for (const Double3& p : mesh_->load(std::span(&i, 1)).position) sample_.add(p);
    report.vertices += vertices_;
    report.faces += mesh_->face_count();
  }

  const SceneSample& sample() const override { return sample_; }
  bool is_points() const override { return false; }
  std::string caption() const override {
    return path_.filename().string() + ", " + with_commas(mesh_->face_count()) + " faces, distance to " +
           options_.deviation.filename().string();
  }
  std::optional<ColourLegend> legend() const override {
    return ColourLegend{options_.with_sign ? "deviation" : "distance", options_.with_sign ? -high_ : 0.0,
                        high_, options_.with_sign};
  }

  void draw(Picture& picture, const DrawContext& context) override {
    picture.set_offset({0, 0, 0});
    std::vector<PictureVertex> batch;
    batch.reserve(3 * kBatchFaces);
    for_each(1.5 * high_, [&](const DeviationTriangle& t) {
      PictureVertex v;
      set_normal(v, t.normal[0], t.normal[1], t.normal[2]);
      for (std::size_t c = 0; c < 3; ++c) {
        v.x = static_cast<float>(t.corner[c][0] - context.origin[0]);
        v.y = static_cast<float>(t.corner[c][1] - context.origin[1]);
        v.z = static_cast<float>(t.corner[c][2] - context.origin[2]);
        v.rgba = deviation_colour(static_cast<double>(t.deviation[c]), high_, options_.with_sign);
        batch.push_back(v);
      }
      if (batch.size() < 3 * kBatchFaces) return;
      picture.triangles(batch, 0.0f);
      batch.clear();
    });
    if (!batch.empty()) picture.triangles(batch, 0.0f);
  }

 private:
  void for_each(double limit, const std::function<void(const DeviationTriangle&)>& sink) const {
    const DeviationSampling sampling{edge_, limit, options_.with_sign};
    const double reach = limit + 2.0 * edge_;
    const MemoryBudget budget(memory_bytes_, 0);
    for (const CompareCell& cell : make_compare_cells(*mesh_, *reference_, reach, kCellFaces)) {
      throw_if_stopped();
      budget.require(cell.bytes, "render --deviation");
      const MeshBlock a = mesh_->load_box(cell.box);
      if (a.faces.empty()) continue;
      const MeshBlock b = reference_->load_box(grown(cell.box, kCompareHalo * reach));
      const ClosestFaces index(b.position, b.faces, cell.box.low);
      sample_deviation({a.position, a.faces}, {cell.box.low, cell.box.high}, index, sampling, sink);
    }
  }

  /// Of the distances, by area; rounded up to two digits.
  double percentile(double share, double limit) const {
    std::vector<std::uint64_t> bins(kBins + 1, 0);
    std::uint64_t all = 0;
    for_each(limit, [&](const DeviationTriangle& t) {
      for (const float d : t.deviation) {
        const double at = std::abs(static_cast<double>(d)) / limit;
        // The root spreads small distances.
        ++bins[at < 1.0 ? static_cast<std::size_t>(std::sqrt(at) * kBins) : kBins];
        ++all;
      }
    });
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < kBins; ++i) {
      sum += bins[i];
      if (static_cast<double>(sum) < share * static_cast<double>(all)) continue;
      const double root = static_cast<double>(i + 1) / kBins;
      return round_up_2_digits(limit * root * root);
    }
    return round_up_2_digits(limit);
  }

  std::filesystem::path path_;
  RenderOptions options_;
  ScratchFolder scratch_;
  std::optional<MeshStore> mesh_, reference_;
  std::uint64_t memory_bytes_ = 0, vertices_ = 0;
  double edge_ = 0.0, high_ = 0.0;
  SceneSample sample_;
};

}  // namespace

std::unique_ptr<SceneItem> make_deviation_item(const std::filesystem::path& path,
                                               const RenderOptions& options, std::uint64_t memory_bytes,
                                               RenderReport& report) {
  return std::make_unique<DeviationItem>(path, options, memory_bytes, report);
}

}  // namespace tessera
