#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/triangle_foot.h"
#include "kernels/texture/chart_raster.h"
#include "kernels/texture/point_colours.h"
#include "octree/portable_math.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/stages/bake/bake_pages.h"
#include "stream/stages/bake/bake_scale.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/bake/texel_files.h"
#include "stream/stages/bake/texture_points.h"

namespace tessera {
namespace {

constexpr std::uint32_t kErrorSample = 8;  ///< one in so many points is compared with the texture
constexpr std::uint64_t kTexelFaceBytes = 500;

/// Errors of colours at points, squares summed over three channels.
struct ColourErrors {
  std::uint64_t points = 0, texture = 0, vertices = 0, around = 0;
};

/// Corners across the edges of a block and what lies around it, by the keys of their ends.
class AcrossEdges {
 public:
  explicit AcrossEdges(const MeshBlock& near) {
    for (const auto& f : near.faces)
      for (std::size_t k = 0; k < 3; ++k)
        edges_.push_back({near.key[f[k]], near.key[f[(k + 1) % 3]], near.position[f[(k + 2) % 3]]});
    std::sort(edges_.begin(), edges_.end(), less);
  }
  /// Of the face that has the edge from a to b.
  std::optional<Double3> third(std::uint64_t a, std::uint64_t b) const {
    const auto at = std::lower_bound(edges_.begin(), edges_.end(), Edge{a, b, {}}, less);
    if (at == edges_.end() || at->from != a || at->to != b) return std::nullopt;
    return at->third;
  }

 private:
  struct Edge {
    std::uint64_t from, to;
    Double3 third;
  };
  static bool less(const Edge& a, const Edge& b) { return std::tie(a.from, a.to) < std::tie(b.from, b.to); }
  std::vector<Edge> edges_;
};

/// A chart with its colours.
struct ColouredChart {
  MeshChart chart;
  double texel = 0.0;
  int width = 0, height = 0;
  std::vector<std::uint32_t> pixels;

  /// Filtered as graphics hardware does. \returns false where there is no colour
  bool sample(const Double2& uv, int margin, std::array<int, 3>& rgb) const {
    const double x = uv[0] / texel + margin - 0.5, y = uv[1] / texel + margin - 0.5;
    const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
    if (i < 0 || j < 0 || i + 1 >= width || j + 1 >= height) return false;
    const double s = x - i, t = y - j;
    const std::array<double, 4> share = {(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t};
    Double3 sum{};
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t at =
          static_cast<std::size_t>(j + static_cast<int>(k / 2)) * static_cast<std::size_t>(width) +
          static_cast<std::size_t>(i + static_cast<int>(k % 2));
      if (pixels[at] >> 24 == 0) return false;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += share[k] * (pixels[at] >> (8 * c) & 255u);
    }
    for (std::size_t c = 0; c < 3; ++c) rgb[c] = static_cast<int>(std::floor(sum[c] + 0.5));
    return true;
  }
};

std::array<int, 3> mixed_colour(const MeshBlock& block, const std::array<std::uint32_t, 3>& face,
                                const Double3& weights) {
  std::array<int, 3> rgb{};
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) sum += weights[k] * (block.rgba[face[k]] >> (8 * c) & 255u);
    rgb[c] = static_cast<int>(std::floor(std::clamp(sum, 0.0, 255.0) + 0.5));
  }
  return rgb;
}

std::uint32_t packed_rgb(const std::array<int, 3>& rgb) {
  return 0xff000000u | static_cast<std::uint32_t>(rgb[0]) | static_cast<std::uint32_t>(rgb[1]) << 8 |
         static_cast<std::uint32_t>(rgb[2]) << 16;
}

class BakeTexelsStage : public Stage {
 public:
  BakeTexelsStage(const JobState& state, const BakeOptions& options, const BakeStores& stores)
      : work_(state.work),
        options_(options),
        store_(stores.mesh(state)),
        scale_(BakeScale::of_work(state.work)),
        blocks_(scale_.blocks(store_)),
        points_(state.work / kBakePoints) {}

  std::string name() const override { return "texture-texels"; }
  std::size_t task_count() const override { return blocks_.size(); }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    const MeshBlockCut& cut = blocks_[task];
    const MeshBox box = store_.box_of(cut.patches);
    const std::vector<std::size_t> near = store_.select(box);
    std::uint64_t faces = 0;
    for (const std::size_t p : near) faces += store_.patches()[p].faces;
    return 2 * store_.block_bytes(near) + faces * kTexelFaceBytes +
           points_.count(grown(box, scale_.max_distance)) *
               (TexturePoints::bytes_per_point() + PointColours::bytes_per_point()) +
           block_raster_bytes(scale_.block_texels(cut), options_.page_size, 12) + (std::uint64_t{3} << 20);
  }
  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json run(std::size_t task, TaskContext& context) const override {
    const MeshBlockCut& cut = blocks_[task];
    const MeshBlock block = store_.load(cut.patches);
    const MeshHaloBlock near = store_.load_near(cut.patches, 0.0);
    const AcrossEdges edges(near.block);
    const MeshBox box = store_.box_of(cut.patches);
    Double3 origin{};
    for (std::size_t a = 0; a < 3; ++a) origin[a] = 0.5 * (box.low[a] + box.high[a]);
    const TexturePointBlock points = points_.load(grown(box, scale_.max_distance), origin);
    const PointColours colours(points.position, points.rgba, points.normal,
                               {scale_.spacing, scale_.max_distance, 8});
    context.count_read(store_.block_bytes(cut.patches) + points.position.size() * 20);
    const TriangleSpan mesh{block.position, block.faces};
    const FaceAcross across = [&](std::uint32_t face, std::uint32_t k) {
      const auto& f = block.faces[face];
      return edges.third(block.key[f[(k + 1) % 3]], block.key[f[k]]);
    };
    const ChartFile file(chart_file(work_, task));
    PackedWriter writer(context.create(texel_file(task)), kTexelKind, std::size_t{1} << 20);
    std::vector<TexelEntry> table;
    std::vector<ColouredChart> charts;
    std::vector<PointColours::Near> scratch;
    std::uint64_t inside = 0, bare = 0;
    for (std::size_t c = 0; c < file.entries().size(); ++c) {
      context.check_stop();
      ColouredChart done;
      done.chart = file.load(c);
      done.texel = file.entries()[c].texel;
      const ChartRaster raster = raster_chart(done.chart, done.texel, static_cast<int>(options_.margin));
      done.width = raster.width, done.height = raster.height;
      done.pixels.assign(raster.what.size(), 0);
      for (int y = 0; y < raster.height; ++y)
        for (int x = 0; x < raster.width; ++x) {
          if (raster.at(x, y) == ChartRaster::kEmpty) continue;
          const TexelPlace place = texel_place(mesh, done.chart, raster, x, y, across);
          std::uint32_t& pixel =
              done.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(raster.width) +
                          static_cast<std::size_t>(x)];
          const bool found = colours.find(place.position - origin, place.normal, pixel, scratch);
          if (!found && !block.rgba.empty())
            pixel = packed_rgb(mixed_colour(block, block.faces[place.face], place.weights));
          if (raster.is_inside(x, y)) ++inside, bare += !found;
        }
      TexelEntry entry;
      entry.pixels = writer.append(bytes_of(done.pixels));
      entry.width = static_cast<std::uint32_t>(raster.width);
      entry.height = static_cast<std::uint32_t>(raster.height);
      table.push_back(entry);
      charts.push_back(std::move(done));
    }
    context.count_written(writer.finish(table));
    const ColourErrors errors = measure(block, near, charts, points, colours, origin);
    context.advance(block.faces.size());
    return {{"inside", inside},
            {"bare", bare},
            {"points", errors.points},
            {"texture", errors.texture},
            {"vertices", errors.vertices},
            {"around", errors.around}};
  }

  Json finish(const std::vector<Json>& tasks, TaskContext&) const override {
    std::uint64_t inside = 0, bare = 0;
    ColourErrors all;
    for (const Json& t : tasks) {
      inside += t.at("inside").get<std::uint64_t>(), bare += t.at("bare").get<std::uint64_t>();
      all.points += t.at("points").get<std::uint64_t>(), all.texture += t.at("texture").get<std::uint64_t>();
      all.vertices += t.at("vertices").get<std::uint64_t>();
      all.around += t.at("around").get<std::uint64_t>();
    }
    Json out = {{"texels", inside}, {"without_points", bare}, {"compared_points", all.points}};
    if (all.points > 0) {
      out["psnr_db"] = psnr(all.texture, all.points);
      out["points_around_psnr_db"] = psnr(all.around, all.points);
      if (store_.info().colour) out["vertex_colours_psnr_db"] = psnr(all.vertices, all.points);
    }
    return out;
  }

 private:
  static double psnr(std::uint64_t squares, std::uint64_t points) {
    const double mean = std::max(static_cast<double>(squares) / (3.0 * static_cast<double>(points)), 1e-3);
    return 10.0 * natural_log(255.0 * 255.0 / mean) / natural_log(10.0);
  }

  /// Points whose nearest face is of the block, against what its texture shows there.
  ColourErrors measure(const MeshBlock& block, const MeshHaloBlock& near,
                       const std::vector<ColouredChart>& charts, const TexturePointBlock& points,
                       const PointColours& colours, const Double3& origin) const {
    struct OfFace {
      std::uint32_t chart = 0, index = 0;
    };
    std::vector<OfFace> of_face(block.faces.size());
    for (std::uint32_t c = 0; c < charts.size(); ++c)
      for (std::uint32_t i = 0; i < charts[c].chart.faces.size(); ++i)
        of_face[charts[c].chart.faces[i]] = {c, i};
    // Faces of the core come in the order of the block.
    std::vector<std::uint32_t> in_block(near.block.faces.size(), 0);
    std::uint32_t next = 0;
    for (std::size_t f = 0; f < in_block.size(); ++f)
      if (near.core[f]) in_block[f] = next++;
    const ClosestFaces closest(near.block.position, near.block.faces, origin);
    ColourErrors errors;
    std::vector<PointColours::Near> scratch;
    for (std::size_t i = 0; i < points.position.size(); ++i) {
      const Float3& q = points.position[i];
      const Double3 p = wide(q);
      if (!is_sampled(p + origin)) continue;
      const ClosestFaces::Hit hit =
          closest.closest(p, scale_.max_distance * scale_.max_distance, ClosestFaces::kNone);
      if (hit.slot == ClosestFaces::kNone) continue;
      const std::uint32_t face = closest.face(hit.slot);
      if (!near.core[face]) continue;
      const std::uint32_t f = in_block[face];
      const auto& t = block.faces[f];
      const Double3 a = block.position[t[0]] - origin, b = block.position[t[1]] - origin,
                    c = block.position[t[2]] - origin;
      const Double3 foot = foot_in_triangle(p, a, b, c).at;
      const Double3 n = triangle_normal(a, b, c);
      const double square = dot(n, n);
      if (!(square > 0.0)) continue;
      const Double3 weights = {dot(triangle_normal(foot, b, c), n) / square,
                               dot(triangle_normal(foot, c, a), n) / square,
                               dot(triangle_normal(foot, a, b), n) / square};
      const ColouredChart& chart = charts[of_face[f].chart];
      const auto& corners = chart.chart.corners[of_face[f].index];
      Double2 uv{};
      // Corners of a chart go with those of the face.
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t d = 0; d < 2; ++d) uv[d] += weights[k] * chart.chart.uv[corners[k]][d];
      std::array<int, 3> seen{};
      if (!chart.sample(uv, static_cast<int>(options_.margin), seen)) continue;
      ++errors.points;
      errors.texture += squared_difference(seen, points.rgba[i]);
      std::uint32_t around = points.rgba[i];
      colours.find(p, n / std::sqrt(square), around, scratch, static_cast<std::uint32_t>(i));
      errors.around +=
          squared_difference({static_cast<int>(around & 255u), static_cast<int>(around >> 8 & 255u),
                              static_cast<int>(around >> 16 & 255u)},
                             points.rgba[i]);
      if (!block.rgba.empty())
        errors.vertices += squared_difference(mixed_colour(block, t, weights), points.rgba[i]);
    }
    return errors;
  }

  static std::uint64_t squared_difference(const std::array<int, 3>& rgb, std::uint32_t rgba) {
    std::uint64_t sum = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const int d = rgb[c] - static_cast<int>(rgba >> (8 * c) & 255u);
      sum += static_cast<std::uint64_t>(d * d);
    }
    return sum;
  }

  /// By the cell of a fine lattice that a point lies in, whatever block looks at it.
  bool is_sampled(const Double3& p) const {
    std::uint64_t bits = 0;
    for (std::size_t a = 0; a < 3; ++a)
      bits = mix(bits ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(
                            std::floor((p[a] - points_.cells().low[a]) / scale_.spacing))));
    return bits % kErrorSample == 0;
  }

  std::filesystem::path work_;
  BakeOptions options_;
  MeshStore store_;
  BakeScale scale_;
  std::vector<MeshBlockCut> blocks_;
  TexturePoints points_;
};

}  // namespace

std::string texel_file(std::size_t block) {
  return kBakeTexels + task_file_stem(block) + ".ttx";
}

std::unique_ptr<Stage> make_bake_texels_stage(const JobState& state, const BakeOptions& options,
                                              const BakeStores& stores) {
  return std::make_unique<BakeTexelsStage>(state, options, stores);
}

}  // namespace tessera
