#include <algorithm>
#include <array>
#include <limits>

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
    std::vector<std::string> names;
    for (std::size_t p = 0; p < pages_.pages.size(); ++p) {
      context.check_stop();
      names.push_back(page_image_name(state_.output, p, jpeg_));
      std::filesystem::copy_file(state_.work / page_image_file(p, jpeg_),
                                 context.create(kSidecarName + names.back()),
                                 std::filesystem::copy_options::overwrite_existing);
    }
    if (const std::filesystem::path material = material_path(state_.output); !material.empty())
      write_durably(context.create(kSidecarName + material.filename().string()), material_text(names));
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
      return create_textured_mesh(state_.output, header, names,
                                  [&](std::size_t faces) { return textures_of(patch++, faces, open); });
    });
    context.count_written(report.bytes);
    result["vertices"] = report.vertices;
    result["bytes"] = report.bytes;
    result["images"] = names;
    return result;
  }

 private:
  /// A block with the textures of its faces, in their order.
  struct OpenBlock {
    std::size_t number = ~std::size_t{0};
    MeshBlock block;
    std::vector<FaceTexture> textures;
  };

  void open_block(std::size_t number, OpenBlock& open) const {
    if (open.number == number) return;
    open.number = number;
    open.block = store_.load(blocks_[number].patches);
    open.textures.assign(open.block.faces.size(), {});
    const ChartFile file(chart_file(state_.work, number));
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
    for (const auto& f : own.faces) {
      const std::array<std::uint32_t, 3> wanted = {in_block[f[0]], in_block[f[1]], in_block[f[2]]};
      const auto at = std::lower_bound(open.block.faces.begin(), open.block.faces.end(), wanted);
      if (at == open.block.faces.end() || *at != wanted)
        throw std::logic_error("bake: a face of a patch is not in its block");
      out.push_back(open.textures[static_cast<std::size_t>(at - open.block.faces.begin())]);
    }
    return out;
  }

  /// use(chart, entry, spot, block) for every chart of a page.
  template <class Use>
  void for_each_chart(std::uint32_t page, TaskContext& context, const Use& use) const {
    std::size_t open = ~std::size_t{0};
    MeshBlock block;
    std::unique_ptr<ChartFile> file;
    for (const std::uint64_t chart : pages_.charts_of(page)) {
      if (const std::size_t number = pages_.block_of(chart); number != open) {
        context.check_stop();
        open = number;
        block = store_.load(blocks_[number].patches);
        file = std::make_unique<ChartFile>(chart_file(state_.work, number));
      }
      const auto c = static_cast<std::size_t>(chart - pages_.first_chart[open]);
      use(file->load(c), file->entries()[c], pages_.spots[chart], block);
    }
  }

  void write_glb(const Double3& origin, TaskContext& context, Json& result) const {
    std::vector<TexturedGlb::Page> pages(pages_.pages.size());
    for (std::uint32_t p = 0; p < pages.size(); ++p) {
      TexturedGlb::Page& page = pages[p];
      constexpr float kHuge = std::numeric_limits<float>::infinity();
      page.min = {kHuge, kHuge, kHuge}, page.max = {-kHuge, -kHuge, -kHuge};
      page.image = state_.work / page_image_file(p, jpeg_);
      for_each_chart(
          p, context,
          [&](const MeshChart& chart, const ChartEntry&, const ChartSpot&, const MeshBlock& block) {
            page.vertices += chart.vertices.size(), page.faces += chart.faces.size();
            for (const std::uint32_t v : chart.vertices) {
              const Float3 at = TexturedGlb::file_position(block.position[v], origin);
              for (std::size_t k = 0; k < 3; ++k)
                page.min[k] = std::min(page.min[k], at[k]), page.max[k] = std::max(page.max[k], at[k]);
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
                         const MeshBlock& block) {
                       std::vector<Double3> position;
                       std::vector<Double2> uv;
                       for (std::size_t v = 0; v < chart.vertices.size(); ++v) {
                         position.push_back(block.position[chart.vertices[v]]);
                         uv.push_back(page_uv(entry, spot, pages_.pages[p], margin_, chart.uv[v]));
                       }
                       glb.vertices(position, uv);
                       vertices += position.size();
                     });
    for (std::uint32_t p = 0; p < pages.size(); ++p) {
      std::uint32_t first = 0;
      for_each_chart(p, context,
                     [&](const MeshChart& chart, const ChartEntry&, const ChartSpot&, const MeshBlock&) {
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
  bool jpeg_;
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
