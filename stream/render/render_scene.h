/// \file render_scene.h
/// What render() draws: things that can be surveyed once and then streamed into a picture.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "kernels/picture/picture.h"
#include "stream/render/render.h"

namespace tessera {

/// Bounds of all, and an even sample of what was added: every 2^k-th, so that it depends on order alone.
class SceneSample {
 public:
  void add(const Double3& p);
  bool empty() const { return points_.empty(); }
  std::uint64_t count() const { return count_; }
  const Double3& low() const { return low_; }
  const Double3& high() const { return high_; }
  const std::vector<Double3>& points() const { return points_; }
  void merge(const SceneSample& other);

 private:
  static constexpr std::size_t kMax = 1u << 17;
  std::vector<Double3> points_;
  std::uint64_t count_ = 0, stride_ = 1;
  Double3 low_{}, high_{};
};

/// The box that the picture is made for: all of the sample, or, when a few stray points would shrink the rest
/// to a dot, the box of the bulk (0.2 % trimmed per side and axis) and a margin.
struct SceneBox {
  Double3 low{}, high{};
  bool trimmed = false;
};
SceneBox scene_box(const SceneSample& sample, bool may_trim);

/// A scale of colours, drawn beside the picture.
struct ColourLegend {
  std::string title;
  double low = 0.0, high = 0.0;
  bool with_sign = false;
};

/// Everything that drawing needs to know beyond the item.
struct DrawContext {
  Double3 origin{};  ///< scene origin, subtracted from all positions
  SceneBox box;      ///< for colours by height
  const RenderOptions* options = nullptr;
};

class SceneItem {
 public:
  virtual ~SceneItem() = default;
  virtual const SceneSample& sample() const = 0;
  virtual bool is_points() const = 0;
  /// "bunny.ply, 69,451 faces"
  virtual std::string caption() const = 0;
  virtual void draw(Picture& picture, const DrawContext& context) = 0;
  virtual std::optional<ColourLegend> legend() const { return std::nullopt; }
};

/// Surveys the mesh. `memory_bytes` is what vertices and edge tables may use; `report` gets counts and
/// notices. \throws as render()
std::unique_ptr<SceneItem> make_mesh_item(const std::filesystem::path& path, const RenderOptions& options,
                                          std::uint64_t memory_bytes, RenderReport& report);
/// The mesh in colours of its distance to options.deviation.
std::unique_ptr<SceneItem> make_deviation_item(const std::filesystem::path& path,
                                               const RenderOptions& options, std::uint64_t memory_bytes,
                                               RenderReport& report);
/// The points of options.missing that lie farther from all these meshes than options.missing_distance, in magenta, of a sample.
std::unique_ptr<SceneItem> make_missing_item(const std::vector<std::filesystem::path>& meshes,
                                             const RenderOptions& options, RenderReport& report);
std::unique_ptr<SceneItem> make_points_item(const std::vector<std::filesystem::path>& paths,
                                            const RenderOptions& options, RenderReport& report);

/// Spacing of the points of a sample if they cover the cells that it touches evenly, as a surface; 0 = no telling.
double estimated_spacing(const SceneSample& sample, const SceneBox& box);

/// Dark blue over green and yellow to light red by share 0..1: readable in grey too.
std::uint32_t ramp_colour(double share);
/// Colour of a deviation: 0 to `high` over the ramp, or blue behind, grey on and red in front of the
/// reference; magenta beyond the scale.
std::uint32_t deviation_colour(double deviation, double high, bool with_sign);
/// Folder for temporary files: options.temp, or beside the output.
std::filesystem::path render_temp(const RenderOptions& options);
/// Height of `p` along options.up within the box, 0..1.
double height_share(const Double3& p, const DrawContext& context);

}  // namespace tessera
