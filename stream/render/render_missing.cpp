// What a mesh leaves out of a scan, as a scene item: the points of a sample that lie farther from it than two spacings.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "kernels/picture/caption.h"
#include "octree/error.h"
#include "stream/files/scratch_folder.h"
#include "stream/formats/points/point_source.h"
#include "stream/import/import_mesh.h"
#include "stream/render/render_scene.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxMeasured = 1u << 19;  // points; a picture shows no more
constexpr std::uint64_t kScanSliceBytes = std::uint64_t{32} << 20;
constexpr double kMissingSpacings = 2.0;
constexpr double kDiscSpacings = 2.2;
constexpr float kMinDisc = 2.0f;  // pixels
constexpr std::uint32_t kMissingColour = 0xffff00ffu;
constexpr std::size_t kMissingBatch = 65536;

class MissingItem final : public SceneItem {
 public:
  MissingItem(const std::vector<std::filesystem::path>& meshes, const RenderOptions& options,
              RenderReport& report)
      : scan_(options.missing) {
    read_sample(options);
    const SceneBox bulk = scene_box(all_, true);
    spacing_ = estimated_spacing(all_, bulk);
    distance_ = options.missing_distance > 0.0 ? options.missing_distance : kMissingSpacings * spacing_;
    if (!(distance_ > 0.0))
      throw InputError(scan_.string() + ": its points have no spacing; give --missing-distance");
    std::sort(points_.begin(), points_.end());
    near_.assign(points_.size(), 0);
    for (const std::filesystem::path& mesh : meshes) measure(mesh, options);
    missing_ = static_cast<std::uint64_t>(std::count(near_.begin(), near_.end(), std::uint8_t{0}));
    for (std::size_t i = 0; i < points_.size(); ++i) {
      bool inside = near_[i] == 0;
      for (std::size_t a = 0; a < 3; ++a)
        inside = inside && points_[i][a] >= bulk.low[a] && points_[i][a] <= bulk.high[a];
      if (inside) shown_.add(points_[i]);
    }
    if (report.measured_points > 0) return;  // it tells of the first picture
    report.measured_points = points_.size();
    report.missing_points = missing_;
    report.missing_distance = distance_;
  }

  const SceneSample& sample() const override { return shown_; }
  bool is_points() const override { return true; }
  std::string caption() const override {
    return with_commas(missing_) + " of " + with_commas(points_.size()) + " points of " +
           scan_.filename().string() + " farther than " + number_text(distance_);
  }

  void draw(Picture& picture, const DrawContext& context) override {
    picture.set_offset({0, 0, 0});
    std::vector<PictureVertex> batch;
    batch.reserve(std::min(points_.size(), kMissingBatch));
    // A sample of the points stands for all of them: its discs are wider.
    const double thinned = std::sqrt(static_cast<double>(all_.count()) / static_cast<double>(points_.size()));
    const auto flush = [&] {
      if (!batch.empty())
        picture.points(batch, static_cast<float>(kDiscSpacings * spacing_ * thinned), kMinDisc, false);
      batch.clear();
    };
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (near_[i] != 0) continue;
      PictureVertex v;
      v.x = static_cast<float>(points_[i][0] - context.origin[0]);
      v.y = static_cast<float>(points_[i][1] - context.origin[1]);
      v.z = static_cast<float>(points_[i][2] - context.origin[2]);
      if (!std::isfinite(v.x + v.y + v.z)) continue;
      v.rgba = kMissingColour;
      batch.push_back(v);
      if (batch.size() == kMissingBatch) flush();
    }
    flush();
  }

 private:
  /// Every 2^k-th point, so that it depends on their order alone.
  void read_sample(const RenderOptions& options) {
    ReadOptions read;
    read.columns = options.columns;
    std::uint64_t stride = 1;
    for (const std::filesystem::path& path : expand_inputs({scan_.string()})) {
      const auto file = open_point_file(path, read);
      for (const InputSlice& slice : file->slices(0, kScanSliceBytes)) {
        file->read(slice, [&](const PointChunk& chunk) {
          throw_if_stopped();
          for (std::size_t i = 0; i < chunk.size(); ++i) {
            const Double3 p = {chunk.x[i], chunk.y[i], chunk.z[i]};
            if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) continue;
            const std::uint64_t index = all_.count();
            all_.add(p);
            if (index % stride != 0) continue;
            if (points_.size() == kMaxMeasured) {
              for (std::size_t k = 0; k < kMaxMeasured / 2; ++k) points_[k] = points_[2 * k];
              points_.resize(kMaxMeasured / 2);
              stride *= 2;
              if (index % stride != 0) continue;
            }
            points_.push_back(p);
          }
        });
      }
    }
    if (points_.empty()) throw EmptyError(scan_.string() + ": no point with finite coordinates");
  }

  /// Marks the points that lie near the mesh, one patch of it in memory at a time.
  void measure(const std::filesystem::path& path, const RenderOptions& options) {
    ScratchFolder scratch(render_temp(options), "missing");
    RunOptions run;
    run.memory_bytes = options.memory_bytes != 0 ? options.memory_bytes : detect_memory_cap().bytes;
    run.threads = core_count();
    const MeshStore mesh = import_mesh(path, scratch.path(), "mesh", run, throw_if_stopped);
    const double square = distance_ * distance_;
    for (std::size_t patch = 0; patch < mesh.patches().size(); ++patch) {
      throw_if_stopped();
      const MeshBlock block = mesh.load(std::span(&patch, 1));
      const auto [low, high] = grown(mesh.patches()[patch].box, distance_);
      const ClosestFaces faces(block.position, block.faces, low);
      const auto first = std::lower_bound(points_.begin(), points_.end(), low[0],
                                          [](const Double3& p, double x) { return p[0] < x; });
      std::uint32_t hint = ClosestFaces::kNone;
      for (auto p = first; p != points_.end() && (*p)[0] <= high[0]; ++p) {
        std::uint8_t& near = near_[static_cast<std::size_t>(p - points_.begin())];
        if (near != 0 || (*p)[1] < low[1] || (*p)[1] > high[1] || (*p)[2] < low[2] || (*p)[2] > high[2])
          continue;
        const ClosestFaces::Hit hit =
            faces.closest({(*p)[0] - low[0], (*p)[1] - low[1], (*p)[2] - low[2]}, square, hint);
        if (hit.slot == ClosestFaces::kNone) continue;
        hint = hit.slot;
        near = 1;
      }
    }
  }

  std::filesystem::path scan_;
  SceneSample all_;
  SceneSample shown_;            ///< what is missing, but for stray points: the picture has room for it
  std::vector<Double3> points_;  ///< ascending
  std::vector<std::uint8_t> near_;
  std::uint64_t missing_ = 0;
  double spacing_ = 0.0, distance_ = 0.0;
};

}  // namespace

std::unique_ptr<SceneItem> make_missing_item(const std::vector<std::filesystem::path>& meshes,
                                             const RenderOptions& options, RenderReport& report) {
  return std::make_unique<MissingItem>(meshes, options, report);
}

}  // namespace tessera
