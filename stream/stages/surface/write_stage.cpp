#include "stream/stages/surface/write_stage.h"

#include <algorithm>

#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/formats/mesh_parts.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/meshes/parts_at_once.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/points/plan.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/surface/hole_files.h"
#include "stream/stages/surface/output_frame.h"
#include "stream/stages/weld/numbered_patches.h"

namespace tessera {
namespace {

constexpr const char* kReconstruct = "tessera reconstruct";

/// Of a patch on its way, as it is loaded and as it is written.
std::uint64_t write_patch_bytes(const PatchEntry& e) {
  return 48ull * e.vertices + 40ull * e.faces + 16ull * e.foreign;
}

/// Of one more patch on its way at once.
std::uint64_t write_lane_bytes(std::span<const PatchEntry> patches) {
  std::uint64_t largest = 0;
  for (const PatchEntry& e : patches) largest = std::max(largest, write_patch_bytes(e));
  return 2 * largest + NumberedPatches::kCacheBytes;
}

class WriteStage : public SerialStage {
 public:
  WriteStage(const JobState& state, bool raw, std::string maker)
      : state_(state),
        raw_(raw),
        maker_(std::move(maker)),
        plan_(Plan::of_work(state.work)),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)),
        fillings_(list_filling_files(state.work)),
        positions_(std::make_shared<PatchPositions>(state.work, store_)),
        lanes_(
            parts_at_once(state.run, write_bytes(store_.patches(), 0), write_lane_bytes(store_.patches()))) {}

  std::string name() const override { return raw_ ? "raw" : "write"; }
  std::uint64_t units() const override { return numbering_.faces; }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t finish_bytes() const override {
    std::uint64_t filling = 0;
    for (const auto& file : fillings_)
      filling = std::max<std::uint64_t>(filling, std::filesystem::file_size(file));
    return write_bytes(store_.patches(), filling) + (lanes_ - 1) * write_lane_bytes(store_.patches()) +
           rounding_check_bytes(state_.output, !raw_, numbering_.vertices);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const MeshHeader header = make_header();
    // The format goes by the extension, which the name of an uncommitted file has not.
    const std::filesystem::path committed = raw_ ? context.create(kRawMeshFile) : state_.output;
    const std::filesystem::path path = raw_ ? std::filesystem::path(committed.string() + ".ply") : committed;
    const auto writer = create_mesh_file(path, header);
    std::vector<Slot> slots = make_slots();
    write_vertices(*writer, header, slots, context);
    write_new_vertices(*writer, header, context);
    std::uint64_t synthetic = write_faces(*writer, header.synthetic, slots, context);
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

  /// What one patch needs on its way; slots are used again.
  struct Slot {
    std::unique_ptr<NumberedPatches> numbered;
    std::vector<Float3> local;
    PatchFaces patch;
    MeshVertexPart vertices;
    MeshFacePart faces;
    std::uint64_t closing = 0;
  };

  std::vector<Slot> make_slots() const {
    std::vector<Slot> slots(lanes_);
    for (Slot& slot : slots)
      slot.numbered = std::make_unique<NumberedPatches>(state_.work, store_, numbering_, positions_);
    return slots;
  }

  void write_vertices(MeshWriter& writer, const MeshHeader& header, std::vector<Slot>& slots,
                      TaskContext& context) const {
    auto* parts = dynamic_cast<MeshPartWriter*>(&writer);
    const auto make = [&](std::size_t p) {
      Slot& slot = slots[p % lanes_];
      slot.vertices.position.clear();
      slot.vertices.bytes.clear();
      context.check_stop();
      if (numbering_.patches[p].kept_vertices == 0) return;
      slot.numbered->load_kept_vertices(p, slot.local, slot.vertices.rgba);
      if (header.colour) {
        slot.vertices.rgba.resize(slot.local.size(), 0);
      } else {
        slot.vertices.rgba.clear();
      }
      const Int3 brick = brick_of_key(store_.patches()[p].key);
      std::vector<Double3>& world = slot.vertices.position;
      world.resize(slot.local.size());
      for (std::size_t a = 0; a < 3; ++a) {
        const double corner = brick[a] * double{kBrickCells};
        for (std::size_t v = 0; v < slot.local.size(); ++v)
          world[v][a] =
              plan_.lattice.world(static_cast<int>(a), corner + double{slot.local[v][a]}) - header.shift[a];
      }
      if (parts) parts->encode(slot.vertices);
      context.count_read(16 * world.size());
    };
    const auto use = [&](std::size_t p) {
      if (numbering_.patches[p].kept_vertices == 0) return;
      const MeshVertexPart& part = slots[p % lanes_].vertices;
      if (parts) return parts->append(part);
      writer.vertices(part.position, part.rgba);
    };
    parallel_in_order(store_.patches().size(), lanes_, make, use, [&](std::size_t p) {
      if (parts && numbering_.patches[p].kept_vertices > 0) parts->digest(slots[p % lanes_].vertices.bytes);
    });
  }

  /// \returns how many of them close holes
  std::uint64_t write_faces(MeshWriter& writer, bool synthetic, std::vector<Slot>& slots,
                            TaskContext& context) const {
    auto* parts = dynamic_cast<MeshPartWriter*>(&writer);
    const auto make = [&](std::size_t p) {
      Slot& slot = slots[p % lanes_];
      slot.closing = 0;
      context.check_stop();
      if (numbering_.patches[p].kept_faces == 0) return;
      slot.numbered->load_faces(p, slot.patch);
      slot.faces.faces.clear();
      slot.faces.synthetic.clear();
      for (std::size_t i = 0; i < slot.patch.faces.size(); ++i) {
        const PatchFace& f = slot.patch.faces[i];
        if (!slot.patch.kept(f)) continue;
        slot.faces.faces.push_back({slot.patch.index[f[0]], slot.patch.index[f[1]], slot.patch.index[f[2]]});
        const std::uint8_t flag = slot.patch.synthetic.empty() ? std::uint8_t{0} : slot.patch.synthetic[i];
        slot.closing += flag;
        if (synthetic) slot.faces.synthetic.push_back(flag);
      }
      if (parts) parts->encode(slot.faces);
      context.count_read(12 * slot.patch.faces.size() + 8 * slot.patch.foreign.size());
    };
    std::uint64_t closing = 0;
    const auto use = [&](std::size_t p) {
      const Slot& slot = slots[p % lanes_];
      if (numbering_.patches[p].kept_faces == 0) return;
      closing += slot.closing;
      if (parts) {
        parts->append(slot.faces);
      } else {
        writer.faces(slot.faces.faces, slot.faces.synthetic);
      }
      context.advance(slot.faces.faces.size());
    };
    parallel_in_order(store_.patches().size(), lanes_, make, use, [&](std::size_t p) {
      if (parts && numbering_.patches[p].kept_faces > 0) parts->digest(slots[p % lanes_].faces.bytes);
    });
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
  std::shared_ptr<const PatchPositions> positions_;
  std::size_t lanes_;  ///< patches on their way at once
};

}  // namespace

std::uint64_t write_bytes(std::span<const PatchEntry> patches, std::uint64_t filling_bytes) {
  std::uint64_t largest = filling_bytes;
  for (const PatchEntry& e : patches) largest = std::max<std::uint64_t>(largest, write_patch_bytes(e));
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
  return {.finish_bytes = max_bytes_at_once(scan.run, write_bytes(scan.patches.entries, scan.filling_bytes),
                                            write_lane_bytes(scan.patches.entries)),
          .sure_bytes = write_bytes({}, scan.filling_bytes),
          .disk_bytes = scan.output_bytes,
          .files = 1,
          .processor_us = scan.faces * kWriteFaceTime,
          .moved_bytes = static_cast<double>(scan.surface_bytes + scan.output_bytes)};
}

}  // namespace tessera
