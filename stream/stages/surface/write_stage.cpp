#include "stream/stages/surface/write_stage.h"

#include <algorithm>

#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/points/plan.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/surface/hole_files.h"
#include "stream/stages/surface/output_frame.h"
#include "stream/stages/weld/numbered_patches.h"

namespace tessera {
namespace {

constexpr const char* kReconstruct = "tessera reconstruct";

class WriteStage : public SerialStage {
 public:
  WriteStage(const JobState& state, bool raw, std::string maker)
      : state_(state),
        raw_(raw),
        maker_(std::move(maker)),
        plan_(Plan::of_work(state.work)),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)),
        fillings_(list_filling_files(state.work)) {}

  std::string name() const override { return raw_ ? "raw" : "write"; }
  std::uint64_t units() const override { return numbering_.faces; }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t finish_bytes() const override {
    std::uint64_t filling = 0;
    for (const auto& file : fillings_)
      filling = std::max<std::uint64_t>(filling, std::filesystem::file_size(file));
    return write_bytes(store_.patches(), filling) +
           rounding_check_bytes(state_.output, !raw_, numbering_.vertices);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const MeshHeader header = make_header();
    // The format goes by the extension, which the name of an uncommitted file has not.
    const std::filesystem::path committed = raw_ ? context.create(kRawMeshFile) : state_.output;
    const std::filesystem::path path = raw_ ? std::filesystem::path(committed.string() + ".ply") : committed;
    const auto writer = create_mesh_file(path, header);
    write_vertices(*writer, header, context);
    write_new_vertices(*writer, header, context);
    std::uint64_t synthetic = write_faces(*writer, header.synthetic, context);
    synthetic += write_fillings(*writer, context);
    writer->finish();
    const MeshRounding rounding = writer->rounding();
    if (raw_) std::filesystem::rename(path, committed);
    context.count_written(writer->bytes_written());
    Json result = {{"path", json_text(state_.output)},
                   {"vertices", header.vertices},
                   {"faces", header.faces},
                   {"synthetic_faces", synthetic},
                   {"bytes", writer->bytes_written()},
                   {"double_positions", header.double_positions},
                   {"shift", header.shift}};
    tell_rounding(result, path, header.origin, rounding);
    return result;
  }

 private:
  MeshHeader make_header() const {
    MeshHeader header;
    header.vertices = numbering_.vertices;
    header.faces = numbering_.faces;
    for (const auto& file : fillings_) {
      const HoleFillingsHead head = load_fillings_head(file);
      header.vertices += head.vertices;
      header.faces += head.faces;
      header.synthetic |= head.faces > 0;
    }
    for (const PatchEntry& e : store_.patches()) header.synthetic |= e.has_synthetic != 0;
    const auto [frame, written] = patch_frame(state_, plan_, store_, maker_ == kReconstruct);
    header.colour = frame.colour;
    header.double_positions = frame.double_positions;
    header.shift = frame.shift;
    if (!raw_) {
      header.origin = written.origin;
      header.check_rounding = holds_floats_only(state_.output);
    }
    header.comments.push_back("made by " + maker_ + ", lattice spacing " + dump_json(Json(plan_.lattice.h)));
    return header;
  }

  void write_vertices(MeshWriter& writer, const MeshHeader& header, TaskContext& context) const {
    NumberedPatches numbered(state_.work, store_, numbering_);
    std::vector<Float3> local;
    std::vector<std::uint32_t> rgba;
    std::vector<Double3> world;
    for (std::size_t p = 0; p < store_.patches().size(); ++p) {
      context.check_stop();
      if (numbering_.patches[p].kept_vertices == 0) continue;
      numbered.load_kept_vertices(p, local, rgba);
      if (header.colour) rgba.resize(local.size(), 0);
      const Int3 brick = brick_of_key(store_.patches()[p].key);
      world.resize(local.size());
      for (std::size_t a = 0; a < 3; ++a) {
        const double corner = brick[a] * double{kBrickCells};
        for (std::size_t v = 0; v < local.size(); ++v)
          world[v][a] =
              plan_.lattice.world(static_cast<int>(a), corner + double{local[v][a]}) - header.shift[a];
      }
      writer.vertices(
          world, header.colour ? std::span<const std::uint32_t>(rgba) : std::span<const std::uint32_t>());
      context.count_read(16 * local.size());
    }
  }

  /// \returns how many of them close holes
  std::uint64_t write_faces(MeshWriter& writer, bool synthetic, TaskContext& context) const {
    NumberedPatches numbered(state_.work, store_, numbering_);
    PatchFaces patch;
    std::vector<MeshFace> faces;
    std::vector<std::uint8_t> flags;
    std::uint64_t closing = 0;
    for (std::size_t p = 0; p < store_.patches().size(); ++p) {
      context.check_stop();
      if (numbering_.patches[p].kept_faces == 0) continue;
      numbered.load_faces(p, patch);
      faces.clear();
      flags.clear();
      for (std::size_t i = 0; i < patch.faces.size(); ++i) {
        const PatchFace& f = patch.faces[i];
        if (!patch.kept(f)) continue;
        faces.push_back({patch.index[f[0]], patch.index[f[1]], patch.index[f[2]]});
        const std::uint8_t flag = patch.synthetic.empty() ? std::uint8_t{0} : patch.synthetic[i];
        closing += flag;
        if (synthetic) flags.push_back(flag);
      }
      writer.faces(faces, flags);
      context.advance(faces.size());
      context.count_read(12 * patch.faces.size() + 8 * patch.foreign.size());
    }
    return closing;
  }

  /// Fillings come behind everything else, in order of their loops.
  void write_new_vertices(MeshWriter& writer, const MeshHeader& header, TaskContext& context) const {
    for (const auto& file : fillings_) {
      context.check_stop();
      HoleFillings fillings = HoleFillings::load(file);
      for (Double3& p : fillings.position)
        for (std::size_t a = 0; a < 3; ++a)
          p[a] = plan_.lattice.world(static_cast<int>(a), p[a]) - header.shift[a];
      if (header.colour) fillings.rgba.resize(fillings.position.size(), 0);
      writer.vertices(fillings.position, header.colour ? std::span<const std::uint32_t>(fillings.rgba)
                                                       : std::span<const std::uint32_t>());
    }
  }

  std::uint64_t write_fillings(MeshWriter& writer, TaskContext& context) const {
    std::uint64_t base = numbering_.vertices, count = 0;
    for (const auto& file : fillings_) {
      context.check_stop();
      HoleFillings fillings = HoleFillings::load(file);
      for (auto& face : fillings.faces)
        for (std::uint64_t& v : face)
          if (v & HoleFillings::kNew) v = base + (v & ~HoleFillings::kNew);
      base += fillings.position.size();
      writer.faces(fillings.faces, std::vector<std::uint8_t>(fillings.faces.size(), 1));
      count += fillings.faces.size();
    }
    return count;
  }

  JobState state_;
  bool raw_;
  std::string maker_;
  Plan plan_;
  PatchStore store_;
  Numbering numbering_;
  std::vector<std::filesystem::path> fillings_;
};

}  // namespace

std::uint64_t write_bytes(std::span<const PatchEntry> patches, std::uint64_t filling_bytes) {
  std::uint64_t largest = filling_bytes;
  for (const PatchEntry& e : patches)
    largest = std::max<std::uint64_t>(largest, 48ull * e.vertices + 40ull * e.faces + 16ull * e.foreign);
  return 2 * largest + NumberedPatches::kCacheBytes + (48u << 20);
}

std::unique_ptr<Stage> make_write_stage(const JobState& state) {
  return std::make_unique<WriteStage>(state, false, kReconstruct);
}
std::unique_ptr<Stage> make_write_stage_of(const JobState& state, const std::string& maker) {
  return std::make_unique<WriteStage>(state, false, maker);
}
std::unique_ptr<Stage> make_raw_write_stage(const JobState& state) {
  return std::make_unique<WriteStage>(state, true, kReconstruct);
}

StageForecast forecast_write(const PlannedScan& scan) {
  return {.finish_bytes = write_bytes(scan.patches.entries, scan.filling_bytes),
          .sure_bytes = write_bytes({}, scan.filling_bytes),
          .disk_bytes = scan.output_bytes,
          .files = 1,
          .processor_us = scan.faces * kWriteFaceTime,
          .moved_bytes = static_cast<double>(scan.surface_bytes + scan.output_bytes)};
}

}  // namespace tessera
