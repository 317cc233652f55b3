#include <algorithm>
#include <array>
#include <limits>

#include "kernels/texture/normal_map.h"
#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/formats/meshes/textured_mesh_writer.h"
#include "stream/meshes/store_output_file.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/bake/bake_pages.h"
#include "stream/stages/bake/bake_scale.h"
#include "stream/stages/bake/bake_stages.h"

namespace tessera {
namespace {

class BakeWriteStage : public SerialStage {
 public:
  BakeWriteStage(const JobState& state, const BakeOptions& options, const BakeStores& stores)
      : state_(state),
        margin_(static_cast<int>(options.margin)),
        jpeg_(options.is_jpeg()),
        normal_map_(options.normal_map),
        placement_(stores.placement),
        comment_(stores.comment(state)),
        store_(stores.mesh(state)),
        blocks_(BakeScale::of_work(state.work).blocks(store_)),
        pages_(BakePages::of_work(state.work)) {}

  std::string name() const override { return "write"; }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t finish_bytes() const override {
    std::uint64_t block = 0;
    for (const MeshBlockCut& cut : blocks_)
      block = std::max(block, store_.block_bytes(cut.patches) + cut.faces * 200);
    return write_mesh_store_bytes(store_.largest_patch_bytes(), store_.patches().size(),
                                  sort_bytes(state_.run)) +
           2 * block + pages_.spots.size() * 2 * BakePages::bytes_per_chart();
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const MeshPlacement placement =
        placement_ ? placement_(state_) : store_placement(state_.output, store_, 0.0);
    Json result = {{"path", json_text(state_.output)}, {"faces", store_.face_count()}};
    if (holds_floats_only(state_.output)) {
      write_glb(placement.origin, context, result);
      return result;
    }
    std::vector<std::string> names, normal_names;
    for (std::size_t p = 0; p < pages_.pages.size(); ++p) {
      context.check_stop();
      names.push_back(page_image_name(state_.output, p, jpeg_));
      std::filesystem::copy_file(state_.work / page_image_file(p, jpeg_),
                                 context.create(kSidecarName + names.back()),
                                 std::filesystem::copy_options::overwrite_existing);
      if (!normal_map_) continue;
      normal_names.push_back(page_normals_name(state_.output, p));
      std::filesystem::copy_file(state_.work / page_normals_file(p),
                                 context.create(kSidecarName + normal_names.back()),
                                 std::filesystem::copy_options::overwrite_existing);
    }
    if (const std::filesystem::path material = material_path(state_.output); !material.empty())
      write_durably(context.create(kSidecarName + material.filename().string()),
                    material_text(names, normal_names));
    std::size_t patch = 0;
    OpenBlock open;
    MeshStoreOutput output;
    output.path = state_.output;
    output.comments = {comment_};
    output.temp = state_.work;
    output.memory_bytes = sort_bytes(state_.run);
    output.check_stop = [&] { context.check_stop(); };
    output.advance = [&](std::uint64_t faces) { context.advance(faces); };
    const MeshStoreOutputReport report = write_mesh_store_as(store_, output, [&](const MeshHeader& header) {
      return create_textured_mesh(
          state_.output, header, names, [&](std::size_t faces) { return textures_of(patch++, faces, open); },
          normal_map_ ? FaceNormals([&] { return open.normals_of_patch; }) : FaceNormals());
    });
    context.count_written(report.bytes);
    result["vertices"] = report.vertices;
    result["bytes"] = report.bytes;
    result["images"] = names;
    if (normal_map_) result["normal_maps"] = normal_names;
    return result;
  }

 private:
  /// A block with the textures of its faces, in their order.
  struct OpenBlock {
    std::size_t number = ~std::size_t{0};
    MeshBlock block;
    std::vector<FaceTexture> textures;
    std::vector<Double3> normals;                          ///< of vertices, for normal maps
    std::vector<std::array<Double3, 3>> normals_of_patch;  ///< that came last
  };

  std::vector<Double3> normals_of(std::size_t number, const MeshBlock& block) const {
    if (!normal_map_) return {};
    return star_normals(block, store_.load_near(blocks_[number].patches, 0.0).block);
  }

  void open_block(std::size_t number, OpenBlock& open) const {
    if (open.number == number) return;
    open.number = number;
    open.block = store_.load(blocks_[number].patches);
    open.normals = normals_of(number, open.block);
    open.textures.assign(open.block.faces.size(), {});
    const ChartFile file(chart_file(state_.work, number), pages_.texel_scale, margin_);
    for (std::size_t c = 0; c < file.entries().size(); ++c) {
      const ChartSpot& spot = pages_.spots[pages_.first_chart[number] + c];
      const MeshChart chart = file.load(c);
      for (std::size_t i = 0; i < chart.faces.size(); ++i) {
        FaceTexture& t = open.textures[chart.faces[i]];
        t.page = spot.page;
        for (std::size_t k = 0; k < 3; ++k)
          t.uv[k] = page_uv(file.entries()[c], spot, pages_.pages[spot.page], margin_,
                            chart.uv[chart.corners[i][k]]);
      }
    }
  }

  /// Blocks hold patches in their order. Faces of a patch and of its block ascend by the keys of their vertices.
  std::vector<FaceTexture> textures_of(std::size_t patch, std::size_t faces, OpenBlock& open) const {
    std::size_t number = open.number < blocks_.size() ? open.number : 0;
    while (!std::binary_search(blocks_[number].patches.begin(), blocks_[number].patches.end(), patch))
      if (++number == blocks_.size()) number = 0;
    open_block(number, open);
    const MeshBlock own = store_.load(std::array{patch});
    if (own.faces.size() != faces) throw std::logic_error("bake: a patch has other faces than are written");
    std::vector<std::uint32_t> in_block;
    for (const std::uint64_t key : own.key)
      in_block.push_back(static_cast<std::uint32_t>(
          std::lower_bound(open.block.key.begin(), open.block.key.end(), key) - open.block.key.begin()));
    std::vector<FaceTexture> out;
    open.normals_of_patch.clear();
    for (const auto& f : own.faces) {
      const std::array<std::uint32_t, 3> wanted = {in_block[f[0]], in_block[f[1]], in_block[f[2]]};
      const auto at = std::lower_bound(open.block.faces.begin(), open.block.faces.end(), wanted);
      if (at == open.block.faces.end() || *at != wanted)
        throw std::logic_error("bake: a face of a patch is not in its block");
      if (normal_map_)
        open.normals_of_patch.push_back(
            {open.normals[wanted[0]], open.normals[wanted[1]], open.normals[wanted[2]]});
      out.push_back(open.textures[static_cast<std::size_t>(at - open.block.faces.begin())]);
    }
    return out;
  }

  /// use(chart, entry, spot, block, its normals) for every chart of a page.
  template <class Use>
  void for_each_chart(std::uint32_t page, TaskContext& context, const Use& use) const {
    std::size_t open = ~std::size_t{0};
    MeshBlock block;
    std::vector<Double3> normals;
    std::unique_ptr<ChartFile> file;
    for (const std::uint64_t chart : pages_.charts_of(page)) {
      if (const std::size_t number = pages_.block_of(chart); number != open) {
        context.check_stop();
        open = number;
        block = store_.load(blocks_[number].patches);
        normals = normals_of(number, block);
        file = std::make_unique<ChartFile>(chart_file(state_.work, number), pages_.texel_scale, margin_);
      }
      const auto c = static_cast<std::size_t>(chart - pages_.first_chart[open]);
      use(file->load(c), file->entries()[c], pages_.spots[chart], block, normals);
    }
  }

  static std::vector<TexturedGlb::Frame> frames_of(const TriangleSpan& mesh, const MeshChart& chart,
                                                   const std::vector<Double3>& normals, std::uint32_t turns) {
    const std::vector<Double3> tangents = chart_tangents(mesh, chart, normals, turns);
    std::vector<TexturedGlb::Frame> frames;
    for (std::size_t v = 0; v < tangents.size(); ++v) {
      const Double3& n = normals[chart.vertices[v]];
      // Where the faces around cancel out any frame will do.
      frames.push_back(n == Double3{} ? TexturedGlb::Frame{{0, 0, 1}, {1, 0, 0}}
                                      : TexturedGlb::Frame{n, tangents[v]});
    }
    return frames;
  }

  void write_glb(const Double3& origin, TaskContext& context, Json& result) const {
    std::vector<TexturedGlb::Page> pages(pages_.pages.size());
    for (std::uint32_t p = 0; p < pages.size(); ++p) {
      TexturedGlb::Page& page = pages[p];
      constexpr float kHuge = std::numeric_limits<float>::infinity();
      page.min = {kHuge, kHuge, kHuge}, page.max = {-kHuge, -kHuge, -kHuge};
      page.image = state_.work / page_image_file(p, jpeg_);
      if (normal_map_) page.normals = state_.work / page_normals_file(p);
      for_each_chart(p, context,
                     [&](const MeshChart& chart, const ChartEntry&, const ChartSpot&, const MeshBlock& block,
                         const std::vector<Double3>&) {
                       page.vertices += chart.vertices.size(), page.faces += chart.faces.size();
                       for (const std::uint32_t v : chart.vertices) {
                         const Float3 at = TexturedGlb::file_position(block.position[v], origin);
                         for (std::size_t k = 0; k < 3; ++k)
                           page.min[k] = std::min(page.min[k], at[k]),
                           page.max[k] = std::max(page.max[k], at[k]);
                       }
                     });
    }
    MeshHeader header;
    header.origin = origin, header.shift = store_.info().shift, header.comments = {comment_};
    TexturedGlb glb(state_.output, header, pages);
    std::uint64_t vertices = 0;
    for (std::uint32_t p = 0; p < pages.size(); ++p)
      for_each_chart(p, context,
                     [&](const MeshChart& chart, const ChartEntry& entry, const ChartSpot& spot,
                         const MeshBlock& block, const std::vector<Double3>& normals) {
                       std::vector<Double3> position;
                       std::vector<Double2> uv;
                       for (std::size_t v = 0; v < chart.vertices.size(); ++v) {
                         position.push_back(block.position[chart.vertices[v]]);
                         uv.push_back(page_uv(entry, spot, pages_.pages[p], margin_, chart.uv[v]));
                       }
                       std::vector<TexturedGlb::Frame> frames;
                       if (normal_map_)
                         frames = frames_of({block.position, block.faces}, chart, normals, spot.turns);
                       glb.vertices(position, uv, frames);
                       vertices += position.size();
                     });
    for (std::uint32_t p = 0; p < pages.size(); ++p) {
      std::uint32_t first = 0;
      for_each_chart(p, context,
                     [&](const MeshChart& chart, const ChartEntry&, const ChartSpot&, const MeshBlock&,
                         const std::vector<Double3>&) {
                       std::vector<std::array<std::uint32_t, 3>> faces = chart.corners;
                       for (auto& f : faces)
                         for (std::uint32_t& v : f) v += first;
                       glb.faces(faces);
                       first += static_cast<std::uint32_t>(chart.vertices.size());
                       context.advance(faces.size());
                     });
    }
    const std::uint64_t bytes = glb.finish();
    context.count_written(bytes);
    result["vertices"] = vertices, result["bytes"] = bytes;
    if (origin != Double3{0, 0, 0}) result["origin"] = origin;
  }

  JobState state_;
  int margin_;
  bool jpeg_, normal_map_;
  std::function<MeshPlacement(const JobState&)> placement_;
  std::string comment_;
  MeshStore store_;
  std::vector<MeshBlockCut> blocks_;
  BakePages pages_;
};

}  // namespace

std::unique_ptr<Stage> make_bake_write_stage(const JobState& state, const BakeOptions& options,
                                             const BakeStores& stores) {
  return std::make_unique<BakeWriteStage>(state, options, stores);
}

}  // namespace tessera
