#include "stream/commands/convert_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "octree/error.h"
#include "stream/commands/break_lines.h"
#include "stream/commands/face_groups.h"
#include "stream/files/durable_file.h"
#include "stream/files/file_extension.h"
#include "stream/files/planned_writes.h"
#include "stream/files/read_file.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/formats/ply_header.h"
#include "stream/meshes/mesh_store.h"
#include "stream/meshes/mesh_weld.h"

namespace tessera {
namespace {

constexpr double kHuge = std::numeric_limits<double>::infinity();

bool has_origin(const Double3& origin) {
  return origin != Double3{0, 0, 0};
}

bool ply_has_faces(const std::filesystem::path& path) {
  const ReadFile file(path);
  char magic[3] = {};
  if (file.size() < sizeof magic) return false;
  file.read_at(0, magic, sizeof magic);
  if (std::string_view(magic, 3) != "ply") return false;
  const PlyHeader header = read_ply_header(file);
  return std::any_of(header.elements.begin(), header.elements.end(), [](const PlyElement& e) {
    return (e.name == "face" || e.name == "tristrips") && e.count > 0;
  });
}

/// A writer for CAD programs, and the lines that it hands on.
struct TinOutput {
  std::unique_ptr<BreakLines> lines;
  std::unique_ptr<TinWriter> writer;

  TinOutput(MeshReader& mesh, const MeshHeader& header, const MeshBox& box,
            const std::filesystem::path& output, const ConvertMeshOptions& options,
            const std::filesystem::path& temp) {
    const ConvertTinOptions& tin = options.tin;
    if (header.faces == 0)
      throw EmptyError(output.string() + ": the mesh has no faces, and a TIN is nothing else");
    if (tin.max_faces > 0 && header.faces > tin.max_faces)
      throw ValidationError(output.string() + ": the mesh has " + std::to_string(header.faces) +
                            " faces and --max-faces is " + std::to_string(tin.max_faces) +
                            "; make fewer of them with tessera decimate, which proves what that costs");
    TinSettings settings;
    settings.crs = tin.crs, settings.unit = tin.unit, settings.overhangs = tin.overhangs;
    settings.low = box.low, settings.high = box.high;
    if (tin.breaklines > 0.0) {
      lines = std::make_unique<BreakLines>(
          mesh, BreakLineOptions{tin.breaklines, options.memory_bytes, temp, options.check_stop});
      if (lines->lines() > 0) settings.breaklines = [this](const auto& use) { lines->for_each(use); };
    }
    writer = create_tin_file(output, header, settings);
  }
  TinOutput(const TinOutput&) = delete;
  TinOutput& operator=(const TinOutput&) = delete;
};

}  // namespace

bool converts_as_mesh(const std::filesystem::path& input, const std::filesystem::path& output) {
  const std::string to = lower_extension(output);
  if ((is_mesh_extension(to) && to != ".off") || is_tin_file(output)) return true;
  if (to != ".ply") return false;
  const std::string from = lower_extension(input);
  return is_mesh_extension(from) || ply_has_faces(input);
}

ConvertMeshReport convert_mesh(const std::filesystem::path& input, const std::filesystem::path& output,
                               const ConvertMeshOptions& options) {
  check_writes(std::array{input}, std::array{PlannedWrite{output, "-o", PlannedWrite::Existing::kReplace}});
  const auto stop = [&] {
    if (options.check_stop) options.check_stop();
  };
  std::filesystem::path temp = options.temp;
  if (temp.empty()) temp = output.has_parent_path() ? output.parent_path() : ".";
  const auto source = open_mesh_file(input, {.temp = temp});
  ConvertMeshReport report;
  // Normals and texture coordinates are not kept: nothing but colours still tells vertices of one position apart.
  const bool split = source->split_vertices() && !source->header().colour;
  report.welded = (!source->shared_vertices() || split) && lower_extension(output) != ".stl";
  std::unique_ptr<WeldedMesh> welded;
  if (report.welded) {
    welded =
        std::make_unique<WeldedMesh>(*source, WeldOptions{options.memory_bytes, temp, options.check_stop});
  }
  MeshReader& mesh = report.welded ? *welded : *source;

  // Writers want true counts first; headers count polygons, or nothing.
  MeshBox box = {{kHuge, kHuge, kHuge}, {-kHuge, -kHuge, -kHuge}};
  mesh.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
    stop();
    report.vertices += batch.size();
    for (const Double3& p : batch) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (!std::isfinite(p[k])) continue;
        box.low[k] = std::min(box.low[k], p[k]);
        box.high[k] = std::max(box.high[k], p[k]);
      }
    }
  });
  mesh.read_faces([&](std::span<const MeshFace> batch) {
    stop();
    report.faces += batch.size();
  });
  MeshHeader header = mesh.header();
  header.vertices = report.vertices;
  header.faces = report.faces;
  if (options.floats && !holds_floats_only(output)) {
    header.check_rounding = header.double_positions;
    header.double_positions = false;
  }
  if (box.low[0] <= box.high[0])
    header.origin = place_mesh(output, header.double_positions, box.low, box.high,
                               fine_rounding(header.faces, box.low, box.high, 0.0))
                        .origin;
  report.origin = header.origin;
  if (options.unit > 0.0) header.unit = options.unit;
  report.unit = header.unit;
  header.synthetic = mesh.has_synthetic();
  std::unique_ptr<TinOutput> tin;
  std::unique_ptr<MeshWriter> other;
  if (is_tin_file(output))
    tin = std::make_unique<TinOutput>(mesh, header, box, output, options, temp);
  else
    other = create_mesh_file(output, header);
  MeshWriter* const writer = tin ? tin->writer.get() : other.get();
  mesh.read_vertices([&](std::span<const Double3> positions, std::span<const std::uint32_t> rgba) {
    stop();
    writer->vertices(positions, rgba);
  });
  if (options.groups)
    report.groups =
        write_face_groups(mesh, report.vertices, *writer, {options.memory_bytes, temp, options.check_stop});
  else
    mesh.read_flagged_faces([&](std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) {
      stop();
      writer->faces(faces, synthetic);
    });
  writer->finish();
  report.bytes = writer->bytes_written();
  report.rounding = writer->rounding();
  if (tin) report.tin = tin->writer->counts();
  if (tin && tin->lines) report.breaklines = tin->lines->lines(), report.break_edges = tin->lines->edges();
  if (const std::filesystem::path shift = stl_shift_path(output); !shift.empty()) {
    if (has_origin(report.origin)) {
      write_durably(shift, stl_shift_text(report.origin));
    } else {
      std::filesystem::remove(shift);  // that of an earlier file of this name would misplace this one
    }
  }
  report.notes = source->warnings();
  return report;
}

}  // namespace tessera
