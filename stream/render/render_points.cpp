// Point files as one scene item: streamed once for bounds and spacing, once for the picture.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/picture/caption.h"
#include "octree/error.h"
#include "stream/formats/points/point_source.h"
#include "stream/render/render_scene.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::size_t kBatchPoints = 65536;
constexpr std::uint64_t kSliceBytes = std::uint64_t{32} << 20;
constexpr float kMinPixels = 1.5f;      // thinner discs flicker away between samples
constexpr double kSplatSpacings = 2.2;  // discs of neighbours overlap: no background shines through
constexpr int kGrid = 96;               // cells along the longest side for the estimate of the spacing

class PointsItem final : public SceneItem {
 public:
  PointsItem(const std::vector<std::filesystem::path>& paths, const RenderOptions& options,
             RenderReport& report)
      : paths_(paths) {
    read_options_.columns = options.columns;
    each_chunk([&](const PointChunk& chunk) {
      for (std::size_t i = 0; i < chunk.size(); ++i) {
        const Double3 p = {chunk.x[i], chunk.y[i], chunk.z[i]};
        if (std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2])) sample_.add(p);
      }
    });
    if (sample_.empty()) {
      throw EmptyError(paths_.front().string() + ": no point with finite coordinates, nothing to draw");
    }
    report.points += sample_.count();
    box_ = scene_box(sample_, true);
    diameter_ = options.splat > 0.0 ? options.splat : kSplatSpacings * estimated_spacing(sample_, box_);
    if (box_.trimmed) {
      report.notices.push_back(paths_.front().string() +
                               ": a few stray points lie far outside; the view is made for the rest");
    }
  }

  const SceneSample& sample() const override { return sample_; }
  bool is_points() const override { return true; }
  std::string caption() const override {
    const std::string name =
        paths_.size() == 1 ? paths_.front().filename().string() : with_commas(paths_.size()) + " files";
    return name + ", " + with_commas(sample_.count()) + " points";
  }

  void draw(Picture& picture, const DrawContext& context) override {
    const RenderOptions& options = *context.options;
    picture.set_offset({0, 0, 0});
    std::vector<PictureVertex> batch;
    batch.reserve(kBatchPoints);
    bool plain = true;
    const auto flush = [&] {
      if (!batch.empty()) picture.points(batch, static_cast<float>(diameter_), kMinPixels, plain);
      batch.clear();
    };
    each_chunk([&](const PointChunk& chunk) {
      const bool any = options.colour == "auto" || options.colour == "texture";  // points have no pages
      const bool by_vertex = !chunk.rgba.empty() && (any || options.colour == "vertex");
      const bool by_height = options.colour == "height" || (any && chunk.rgba.empty() && chunk.nx.empty());
      if (plain != !(by_vertex || by_height)) flush();
      plain = !(by_vertex || by_height);
      for (std::size_t i = 0; i < chunk.size(); ++i) {
        const Double3 p = {chunk.x[i], chunk.y[i], chunk.z[i]};
        PictureVertex v;
        v.x = static_cast<float>(p[0] - context.origin[0]);
        v.y = static_cast<float>(p[1] - context.origin[1]);
        v.z = static_cast<float>(p[2] - context.origin[2]);
        if (!std::isfinite(v.x + v.y + v.z)) continue;
        if (!chunk.nx.empty()) set_normal(v, chunk.nx[i], chunk.ny[i], chunk.nz[i]);
        if (by_vertex) v.rgba = chunk.rgba[i];
        if (by_height) v.rgba = ramp_colour(height_share(p, context));
        batch.push_back(v);
        if (batch.size() == kBatchPoints) flush();
      }
    });
    flush();
  }

 private:
  template <typename Sink>
  void each_chunk(const Sink& sink) const {
    for (const std::filesystem::path& path : paths_) {
      const auto file = open_point_file(path, read_options_);
      for (const InputSlice& slice : file->slices(0, kSliceBytes)) {
        file->read(slice, [&](const PointChunk& chunk) {
          throw_if_stopped();
          sink(chunk);
        });
      }
    }
  }

  std::vector<std::filesystem::path> paths_;
  ReadOptions read_options_;
  SceneSample sample_;
  SceneBox box_;
  double diameter_ = 0.0;
};

}  // namespace

double estimated_spacing(const SceneSample& sample, const SceneBox& box) {
  double longest = 0.0;
  for (std::size_t i = 0; i < 3; ++i) longest = std::max(longest, box.high[i] - box.low[i]);
  if (!(longest > 0.0) || !std::isfinite(longest)) return 0.0;
  const double cell = longest / kGrid;
  std::vector<std::uint32_t> cells;
  std::uint64_t inside = 0;
  for (const Double3& p : sample.points()) {
    std::uint32_t key = 0;
    bool in = true;
    for (std::size_t i = 0; i < 3; ++i) {
      const double at = (p[i] - box.low[i]) / cell;
      in = in && at >= 0.0 && at <= kGrid;
      key = key * 128 + static_cast<std::uint32_t>(std::clamp(at, 0.0, kGrid - 1.0));
    }
    if (!in) continue;
    ++inside;
    cells.push_back(key);
  }
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  const double points = static_cast<double>(sample.count()) * static_cast<double>(inside) /
                        static_cast<double>(sample.points().size());
  // A plane through a grid touches about 1.5 cells per cell area of its own.
  const double area = static_cast<double>(cells.size()) / 1.5 * cell * cell;
  return points > 0.0 ? std::sqrt(area / points) : 0.0;
}

std::unique_ptr<SceneItem> make_points_item(const std::vector<std::filesystem::path>& paths,
                                            const RenderOptions& options, RenderReport& report) {
  return std::make_unique<PointsItem>(paths, options, report);
}

}  // namespace tessera
