#include <algorithm>
#include <cmath>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/file_extension.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/planned_writes.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/meshes/mesh_weld.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/runtime/serial_stage.h"
#include "stream/runtime/work_dir.h"
#include "stream/stages/deform/deform_crossings.h"
#include "stream/stages/deform/deform_files.h"
#include "stream/stages/deform/deform_needs.h"
#include "stream/stages/deform/deform_output.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/edit_script.h"
#include "stream/stages/deform/pose_base.h"
#include "stream/stages/deform/vertex_batches.h"

namespace tessera {
namespace {

constexpr std::uint64_t kManyVertices = std::uint64_t{1} << 32;  ///< headers of text tell none

/// As PointRecord::rgba.
std::uint32_t colour_of(std::int32_t role) {
  constexpr std::uint32_t kBlue = 0xffd07030u, kGreen = 0xff40b040u, kGrey = 0xffb0b0b0u;
  return role == kSupportVertex ? kBlue : role == kFixedVertex ? kGrey : kGreen;
}

class DeformWriteStage : public SerialStage {
 public:
  DeformWriteStage(const JobState& state, const DeformOptions& options)
      : options_(options),
        applies_(options.mode == "apply"),
        prepares_(options.mode == "prepare"),
        mesh_(state.inputs.at(applies_ ? 1 : 0)),
        output_(state.output),
        temp_(state.work),
        run_(state.run),
        weld_bytes_(sort_bytes(state.run)),
        window_(vertex_window(state.run)),
        file_(applies_ ? state.inputs.at(0) : state.work / kBasisFile),
        script_(parse_edit(options.edit, applies_ ? "the pose" : "the edit")) {}

  std::string name() const override { return "write"; }
  std::uint64_t units() const override { return open_mesh_file(mesh_)->header().vertices; }
  std::string unit_name() const override { return "vertices"; }
  std::uint64_t finish_bytes() const override {
    return write_stage_bytes(basis_size(file_, !prepares_), run_) +
           (prepares_ ? 0 : rounding_check_bytes(output_, true, kManyVertices));
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    Json out = write(context);
    if (prepares_ || options_.dry_run || options_.crossings == "keep") return out;
    add_deform_crossings(out, mesh_, output_,
                         {weld_bytes_, temp_, run_.threads, [&] { context.check_stop(); }});
    return out;
  }

 private:
  Json write(TaskContext& context) const {
    DeformBasis basis = file_.load();
    const BaseState rest(basis.base.position, basis.base.faces);
    return prepares_ ? prepare(basis, rest, context) : deform(basis, rest, context);
  }

  /// The mesh as it is read: welded where its file has corners of its own for every face.
  struct Source {
    std::unique_ptr<MeshReader> file;
    std::unique_ptr<WeldedMesh> welded;
    MeshReader& mesh() { return welded ? *welded : *file; }
  };
  Source open_source(TaskContext& context) const {
    Source source{open_mesh_file(mesh_), nullptr};
    if (!source.file->shared_vertices() && (prepares_ || lower_extension(output_) != ".stl"))
      source.welded = std::make_unique<WeldedMesh>(
          *source.file, WeldOptions{weld_bytes_, temp_, [&context] { context.check_stop(); }});
    return source;
  }

  /// Where vertices stream past the base, its basis functions need no room.
  static void drop_functions(DeformBasis& basis) {
    basis.edit.columns = {};
    basis.edit.rotation_columns = {};
    basis.edit.active = {};
    basis.edit.target = {};
    basis.levels = {};
  }

  static void encode(const DisplacementEncoder& encoder, double diagonal, DisplacedBatch& b) {
    b.displaced.of.assign(b.position.size(), {});
    b.displaced.rest.clear();
    for (std::uint32_t i = 0; i < b.position.size(); ++i) {
      if (!finite(b.position[i])) continue;
      TangentRest rest;
      b.displaced.of[i] = encoder.encode(b.position[i], diagonal, rest);
      if ((b.displaced.of[i].face & kHasTangent) == 0) continue;
      rest.point = i;
      b.displaced.rest.push_back(rest);
    }
  }

  /// Moves by what the base does: what rounding left beside the normal stays as it is.
  /// \param mirrored  the pose lacks a reflection (take_out_mirror())
  static void move(const BaseState& rest, const BaseState& posed, bool mirrored, DisplacedBatch& b) {
    auto tangent = b.displaced.rest.begin();
    b.largest = 0.0;
    for (std::uint32_t i = 0; i < b.position.size(); ++i) {
      const NormalDisplacement& d = b.displaced.of[i];
      const TangentRest* residual = nullptr;
      if ((d.face & kHasTangent) != 0) residual = &*tangent++;
      if (!finite(b.position[i])) continue;
      const Double3 by = posed.decode(d, residual) - rest.decode(d, residual), from = b.position[i];
      b.position[i] = from + by;
      if (mirrored) b.position[i][0] = -b.position[i][0];
      b.largest = std::max(b.largest, mirrored ? squared_distance(from, b.position[i]) : dot(by, by));
    }
  }

  static std::int32_t role_at(const DeformBasis& basis, const NormalDisplacement& d) {
    const auto& f = basis.base.faces[d.face & ~kHasTangent];
    const int w[3] = {65535 - d.u - d.v, d.u, d.v};
    return basis.edit.role[f[static_cast<std::size_t>(std::max_element(w, w + 3) - w)]];
  }

  /// The regions: each vertex by that of the corner nearest to it.
  static void colour(const DeformBasis& basis, DisplacedBatch& b) {
    b.rgba.resize(b.position.size());
    for (std::size_t i = 0; i < b.rgba.size(); ++i) b.rgba[i] = colour_of(role_at(basis, b.displaced.of[i]));
  }

  Json deform(DeformBasis& basis, const BaseState& rest, TaskContext& context) const {
    const Json about = parse_json(basis.about);
    const double diagonal = about.at("diagonal").get<double>();
    const bool colours = options_.dry_run;
    std::vector<Placement> handles = pose_of(script_, about.at("handles").get<std::vector<std::string>>());
    const bool mirrored = take_out_mirror(basis, handles);
    const PosedBase pose = pose_base(basis, handles, [&] { context.check_stop(); });
    const BaseState posed(pose.position, basis.base.faces);
    drop_functions(basis);
    Source source = open_source(context);
    MeshReader& mesh = source.mesh();
    std::unique_ptr<DisplacementEncoder> encoder;
    if (!applies_) encoder = std::make_unique<DisplacementEncoder>(rest);
    context.check_stop();
    const MeshHeader header = header_to_write(mesh, basis, about, context);
    const auto writer = create_mesh_file(output_, header);
    const Displaced displaced = write_vertices(
        mesh, encoder.get(), diagonal,
        [&](DisplacedBatch& b) {
          if (colours)
            colour(basis, b);
          else
            move(rest, posed, mirrored, b);
        },
        *writer, context);
    write_deformed_faces(mesh, mirrored && !colours, *writer, context);
    writer->finish();
    context.count_written(writer->bytes_written());
    Json out = {{"path", json_text(output_)},
                {"vertices", header.vertices},
                {"faces", header.faces},
                {"bytes", writer->bytes_written()},
                {"double_positions", header.double_positions},
                {"shift", header.shift},
                {"tangent_vertices", displaced.tangents}};
    tell_rounding(out, output_, header.origin, writer->rounding());
    if (colours) return out;
    if (const Json targets = residuals(rest, posed, encoder.get(), diagonal); !targets.is_null())
      out["targets"] = targets;
    out["largest_move"] = std::sqrt(displaced.largest) + writer->rounding().largest;
    if (mirrored) out["mirrored"] = true;
    out.update(pose_json(pose));
    for (const std::string& warning : pose_warnings(pose, basis.base.faces.size()))
      out["warnings"].push_back(warning);
    return out;
  }

  MeshHeader header_to_write(MeshReader& mesh, const DeformBasis& basis, const Json& about,
                             TaskContext& context) const {
    MeshHeader header = mesh.header();
    if (applies_) {
      header.vertices = about.at("mesh").at("vertices").get<std::uint64_t>();
      header.faces = about.at("mesh").at("faces").get<std::uint64_t>();
    } else {
      const MeshCounts n = count_mesh(mesh, context);
      header.vertices = n.vertices;
      header.faces = n.faces;
    }
    if (!basis.base.position.empty())
      place_output(header, output_, bounds_of(basis.base.position), options_.dry_run);
    header.synthetic = mesh.has_synthetic();
    if (options_.dry_run) header.colour = true;
    return header;
  }

  struct Displaced {
    double largest = 0.0;  ///< move, squared
    std::uint64_t tangents = 0;
  };
  /// \param encoder  null: the basis has where vertices stand   \param change  what happens to a batch
  Displaced write_vertices(MeshReader& mesh, const DisplacementEncoder* encoder, double diagonal,
                           const std::function<void(DisplacedBatch&)>& change, MeshWriter& writer,
                           TaskContext& context) const {
    Displaced out;
    stream_vertices(
        mesh, window_, context,
        [&](std::uint64_t number, DisplacedBatch& b) {
          if (encoder) {
            encode(*encoder, diagonal, b);
          } else {
            b.displaced = file_.batch(number);
            if (b.displaced.of.size() != b.position.size())
              throw InputError(mesh_.string() + ": it is not the mesh that the basis was prepared for");
          }
          change(b);
        },
        [&](DisplacedBatch& b) {
          out.largest = std::max(out.largest, b.largest);
          out.tangents += b.displaced.rest.size();
          writer.vertices(b.position, b.rgba);
        });
    return out;
  }

  /// How far points with targets were from them, and are.
  Json residuals(const BaseState& rest, const BaseState& posed, const DisplacementEncoder* encoder,
                 double diagonal) const {
    std::uint64_t count = 0;
    double before = 0.0, after = 0.0, max_before = 0.0, max_after = 0.0;
    for (const EditRegion& r : script_.regions)
      for (std::size_t k = 0; k < r.targets.size() && k < r.points.size() && encoder != nullptr; ++k) {
        TangentRest tangent;
        const NormalDisplacement d = encoder->encode(r.points[k], diagonal, tangent);
        const TangentRest* residual = (d.face & kHasTangent) != 0 ? &tangent : nullptr;
        const Double3 now = r.points[k] + (posed.decode(d, residual) - rest.decode(d, residual));
        const double was = squared_distance(r.points[k], r.targets[k]),
                     is = squared_distance(now, r.targets[k]);
        ++count;
        before += was, after += is;
        max_before = std::max(max_before, was), max_after = std::max(max_after, is);
      }
    if (count == 0) return {};
    const auto n = static_cast<double>(count);
    return {{"count", count},
            {"rms_before", std::sqrt(before / n)},
            {"largest_before", std::sqrt(max_before)},
            {"rms_after", std::sqrt(after / n)},
            {"largest_after", std::sqrt(max_after)}};
  }

  Json prepare(DeformBasis& basis, const BaseState& rest, TaskContext& context) const {
    Json about = parse_json(basis.about);
    const double diagonal = about.at("diagonal").get<double>();
    const std::filesystem::path aside = output_aside(output_);
    BasisWriter writer(aside, basis);
    drop_functions(basis);
    Source source = open_source(context);
    MeshReader& mesh = source.mesh();
    const DisplacementEncoder encoder(rest);
    const MeshCounts n = count_mesh(mesh, context);
    const InputFingerprint print = fingerprint_input(mesh_);
    std::uint64_t tangents = 0;
    double worst = 0.0;
    stream_vertices(
        mesh, window_, context,
        [&](std::uint64_t, DisplacedBatch& b) {
          encode(encoder, diagonal, b);
          b.largest = 0.0;
          auto tangent = b.displaced.rest.begin();
          for (std::size_t i = 0; i < b.position.size(); ++i) {
            const NormalDisplacement& d = b.displaced.of[i];
            const TangentRest* residual = (d.face & kHasTangent) != 0 ? &*tangent++ : nullptr;
            if (finite(b.position[i]))
              b.largest = std::max(b.largest, squared_distance(rest.decode(d, residual), b.position[i]));
          }
        },
        [&](DisplacedBatch& b) {
          worst = std::max(worst, b.largest);
          tangents += b.displaced.rest.size();
          writer.add(b.displaced);
        });
    about["mesh"] = {{"path", json_text(std::filesystem::absolute(mesh_))},
                     {"bytes", print.bytes},
                     {"xxh3", hex64(print.xxh3)},
                     {"vertices", n.vertices},
                     {"faces", n.faces}};
    const std::uint64_t bytes = writer.finish(dump_json(about));
    sync_file(aside);
    rename_durably(aside, output_);
    context.count_written(bytes);
    return {{"path", json_text(output_)},
            {"vertices", n.vertices},
            {"faces", n.faces},
            {"bytes", bytes},
            {"tangent_vertices", tangents},
            {"reconstruction_error", std::sqrt(worst)},
            {"diagonal", diagonal}};
  }

  DeformOptions options_;
  bool applies_, prepares_;
  std::filesystem::path mesh_, output_, temp_;
  RunOptions run_;
  std::uint64_t weld_bytes_;
  std::size_t window_;
  BasisReader file_;
  EditScript script_;
};

}  // namespace

std::unique_ptr<Stage> make_deform_write_stage(const JobState& state, const DeformOptions& options) {
  return std::make_unique<DeformWriteStage>(state, options);
}

}  // namespace tessera
