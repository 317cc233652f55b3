// A mesh as a scene item in colours of its distance to a reference, cell by cell.
#include <array>
#include <functional>
#include <optional>

#include "kernels/picture/caption.h"
#include "octree/vector.h"
#include "stream/check/mesh_deviation.h"
#include "stream/render/render_scene.h"
#include "stream/runtime/memory_budget.h"

namespace tessera {
namespace {

constexpr std::size_t kBatchFaces = 32768;

double area_of(const std::array<Double3, 3>& corner) {
  return 0.5 * norm(triangle_normal(corner[0], corner[1], corner[2]));
}

class DeviationItem final : public SceneItem {
 public:
  DeviationItem(const std::filesystem::path& path, const RenderOptions& options, std::uint64_t memory_bytes,
                RenderReport& report)
      : path_(path),
        options_(options),
        deviation_(path, options.deviation, options.with_sign, render_temp(options),
                   memory_bytes != 0 ? memory_bytes : detect_memory_cap().bytes, "render --deviation",
                   options.check_deviation ? std::function<void()>([this] {
                     options_.check_deviation(area_ > 0.0 ? done_ / area_ : 0.0);
                   })
                                           : std::function<void()>()) {
    high_ = options.tolerance > 0.0 ? options.tolerance : deviation_.scale();
    const MeshStore& mesh = deviation_.mesh();
    for (std::size_t i = 0; i < mesh.patches().size(); ++i) {
      report.vertices += mesh.patches()[i].vertices;
      const MeshBlock patch = mesh.load(std::span(&i, 1));
      for (const Double3& p : patch.position) sample_.add(p);
      for (const auto& f : patch.faces)
        area_ += area_of({patch.position[f[0]], patch.position[f[1]], patch.position[f[2]]});
    }
    report.faces += mesh.face_count();
  }

  const SceneSample& sample() const override { return sample_; }
  bool is_points() const override { return false; }
  std::string caption() const override {
    return path_.filename().string() + ", " + with_commas(deviation_.mesh().face_count()) +
           " faces, distance to " + options_.deviation.filename().string();
  }
  std::optional<ColourLegend> legend() const override {
    return ColourLegend{options_.with_sign ? "deviation" : "distance", options_.with_sign ? -high_ : 0.0,
                        high_, options_.with_sign};
  }

  void draw(Picture& picture, const DrawContext& context) override {
    picture.set_offset({0, 0, 0});
    std::vector<PictureVertex> batch;
    batch.reserve(3 * kBatchFaces);
    done_ = 0.0;
    deviation_.for_each(1.5 * high_, [&](const DeviationTriangle& t) {
      PictureVertex v;
      done_ += area_of(t.corner);
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
  std::filesystem::path path_;
  RenderOptions options_;
  MeshDeviation deviation_;
  double high_ = 0.0;
  double area_ = 0.0, done_ = 0.0;  ///< of the mesh, and of what this round coloured
  SceneSample sample_;
};

}  // namespace

std::unique_ptr<SceneItem> make_deviation_item(const std::filesystem::path& path,
                                               const RenderOptions& options, std::uint64_t memory_bytes,
                                               RenderReport& report) {
  return std::make_unique<DeviationItem>(path, options, memory_bytes, report);
}

}  // namespace tessera
