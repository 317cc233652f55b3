#include "stream/stages/write_stage.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "stream/mesh_io.h"
#include "stream/plan.h"
#include "stream/read_file.h"
#include "stream/stages/weld_stage.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint32_t kDropped = 0xffffffffu;
constexpr std::size_t kRemapCache = 256;  ///< bricks that lost an island and are named by others, held at once

/// Floats hold the scan's coordinates when their rounding stays below a thousandth of the lattice spacing.
bool float_suffices(double largest_coordinate, double h) { return largest_coordinate * 0x1p-24 <= h * 1e-3; }

class WriteStage : public Stage {
 public:
  explicit WriteStage(const JobState& state)
      : state_(state),
        plan_(Plan::of_work(state.work)),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / "weld/numbering.bin")) {}

  std::string name() const override { return "write"; }
  std::size_t task_count() const override { return 0; }
  std::uint64_t task_bytes(std::size_t) const override { return 0; }
  std::uint64_t units() const override { return numbering_.faces; }
  std::string unit_name() const override { return "faces"; }
  json run(std::size_t, TaskContext&) const override { return {}; }

  std::uint64_t finish_bytes() const override {
    std::uint64_t largest = 0;
    for (const PatchEntry& e : store_.patches())
      largest = std::max<std::uint64_t>(largest, 48ull * e.vertices + 40ull * e.faces + 16ull * e.foreign);
    return 2 * largest + kRemapCache * (64u << 10) + (48u << 20);
  }

  json finish(const std::vector<json>&, TaskContext& context) const override {
    const MeshHeader header = make_header();
    const auto writer = create_mesh_file(state_.output, header);
    write_vertices(*writer, header, context);
    write_faces(*writer, context);
    writer->finish();
    context.count_written(writer->bytes_written());
    return {{"path", state_.output.string()},
            {"vertices", header.vertices},
            {"faces", header.faces},
            {"bytes", writer->bytes_written()},
            {"double_positions", header.double_positions},
            {"shift", header.shift}};
  }

 private:
  MeshHeader make_header() const {
    MeshHeader header;
    header.vertices = numbering_.vertices;
    header.faces = numbering_.faces;
    header.colour = plan_.has_colour;
    // The farthest corner of the used part of the lattice bounds every coordinate.
    double largest = 0.0;
    for (const PatchEntry& e : store_.patches()) {
      const Int3 brick = brick_of_key(e.key);
      for (std::size_t a = 0; a < 3; ++a) {
        const double low = plan_.lattice.world(static_cast<int>(a), brick[a] * double{kBrickCells});
        largest = std::max({largest, std::fabs(low), std::fabs(low + kBrickCells * plan_.lattice.h)});
      }
    }
    const std::string extension = state_.output.extension().string();
    const bool has_double = extension == ".ply" || extension == ".obj";
    const bool local = state_.options.local_output || (!has_double && !float_suffices(largest, plan_.lattice.h));
    header.double_positions = has_double && !local && !float_suffices(largest, plan_.lattice.h);
    if (local)
      for (std::size_t a = 0; a < 3; ++a) header.shift[a] = plan_.lattice.world(static_cast<int>(a), 0.0);
    header.comments.push_back("made by tessera reconstruct, lattice spacing " + json(plan_.lattice.h).dump());
    return header;
  }

  void write_vertices(MeshWriter& writer, const MeshHeader& header, TaskContext& context) const {
    std::vector<Float3> local;
    std::vector<std::uint32_t> rgba;
    std::vector<Double3> world;
    for (std::size_t p = 0; p < store_.patches().size(); ++p) {
      context.check_stop();
      const PatchPlace& place = numbering_.patches[p];
      if (place.kept_vertices == 0) continue;
      store_.load_vertices(p, local, rgba);
      if (header.colour) rgba.resize(local.size(), 0);
      const Int3 brick = brick_of_key(store_.patches()[p].key);
      world.resize(local.size());
      for (std::size_t a = 0; a < 3; ++a) {
        const double corner = brick[a] * double{kBrickCells};
        for (std::size_t v = 0; v < local.size(); ++v)
          world[v][a] = plan_.lattice.world(static_cast<int>(a), corner + double{local[v][a]}) - header.shift[a];
      }
      if (place.kept_vertices != local.size()) {
        const std::vector<std::uint32_t> map = make_remap(p);
        for (std::size_t v = 0; v < map.size(); ++v) {
          if (map[v] == kDropped) continue;
          world[map[v]] = world[v];
          if (header.colour) rgba[map[v]] = rgba[v];
        }
        world.resize(place.kept_vertices);
        if (header.colour) rgba.resize(place.kept_vertices);
      }
      writer.vertices(world, header.colour ? std::span<const std::uint32_t>(rgba) : std::span<const std::uint32_t>());
      context.count_read(16 * local.size());
    }
  }

  void write_faces(MeshWriter& writer, TaskContext& context) const {
    std::vector<PatchFace> local;
    std::vector<VertexPlace> foreign;
    std::vector<std::uint64_t> index;
    std::vector<MeshFace> faces;
    std::map<std::size_t, std::vector<std::uint32_t>> remaps;
    for (std::size_t file = 0; file < store_.file_count(); ++file) {
      const ReadFile places(state_.work / weld_file_name(file));
      const auto [first, last] = store_.file_range(file);
      for (std::size_t p = first; p < last; ++p) {
        context.check_stop();
        const PatchEntry& entry = store_.patches()[p];
        const PatchPlace& place = numbering_.patches[p];
        if (place.kept_faces == 0) continue;
        if (remaps.size() > kRemapCache) remaps.clear();
        store_.load_faces(p, local);
        foreign.resize(entry.foreign);
        places.read_at(place.foreign_offset, foreign.data(), foreign.size() * sizeof(VertexPlace));
        // Output index of every vertex that the patch names.
        index.resize(std::size_t{entry.vertices} + entry.foreign);
        for (std::uint32_t v = 0; v < entry.vertices; ++v)
          index[v] = output_index({static_cast<std::uint32_t>(p), v}, remaps);
        for (std::size_t f = 0; f < foreign.size(); ++f)
          index[entry.vertices + f] = output_index(foreign[f], remaps);
        faces.clear();
        for (const PatchFace& f : local)
          if (index[f[0]] != kNoIndex) faces.push_back({index[f[0]], index[f[1]], index[f[2]]});
        writer.faces(faces);
        context.advance(faces.size());
        context.count_read(12 * local.size() + 8 * foreign.size());
      }
    }
  }

  using Remaps = std::map<std::size_t, std::vector<std::uint32_t>>;

  /// kNoIndex for a vertex of a dropped island.
  std::uint64_t output_index(const VertexPlace& place, Remaps& remaps) const {
    const std::uint64_t base = numbering_.patches[place.patch].first_vertex;
    if (numbering_.patches[place.patch].kept_vertices == store_.patches()[place.patch].vertices)
      return base + place.vertex;
    auto [it, fresh] = remaps.try_emplace(place.patch);
    if (fresh) it->second = make_remap(place.patch);
    const std::uint32_t v = it->second[place.vertex];
    return v == kDropped ? kNoIndex : base + v;
  }

  /// New own index of every vertex of a patch that lost an island.
  std::vector<std::uint32_t> make_remap(std::size_t patch) const {
    const PatchSeam seam = store_.load_seam(patch);
    std::vector<std::uint32_t> map(store_.patches()[patch].vertices);
    std::uint32_t next = 0;
    for (std::size_t v = 0; v < map.size(); ++v) {
      const bool kept = numbering_.kept[numbering_.patches[patch].first_component + seam.components.of_vertex[v]] != 0;
      map[v] = kept ? next++ : kDropped;
    }
    return map;
  }

  static constexpr std::uint64_t kNoIndex = ~std::uint64_t{0};

  JobState state_;
  Plan plan_;
  PatchStore store_;
  Numbering numbering_;
};

}  // namespace

std::unique_ptr<Stage> make_write_stage(const JobState& state) { return std::make_unique<WriteStage>(state); }

}  // namespace tessera
