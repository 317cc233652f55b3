#include <algorithm>
#include <cmath>

#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/mesh_weld.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/deform/deform_crossings.h"
#include "stream/stages/deform/deform_output.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/onto_files.h"
#include "stream/stages/deform/onto_stages.h"
#include "stream/stages/deform/vertex_batches.h"

namespace tessera {
namespace {

class OntoWriteStage : public SerialStage {
 public:
  OntoWriteStage(const JobState& state, const DeformOptions& options)
      : options_(options),
        mesh_(state.inputs.at(0)),
        output_(state.output),
        temp_(state.work),
        run_(state.run),
        weld_bytes_(sort_bytes(state.run)),
        bytes_(onto_write_bytes(state)),
        store_(open_imported_mesh(state.work, kDeformImport)),
        lattice_(load_lattice(state.work / kLatticeFile)) {}
  std::string name() const override { return "write"; }
  std::uint64_t units() const override { return open_mesh_file(mesh_)->header().vertices; }
  std::string unit_name() const override { return "vertices"; }
  std::uint64_t finish_bytes() const override { return bytes_; }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    Json out = write(context);
    if (options_.crossings != "keep")
      add_deform_crossings(out, mesh_, output_,
                           {weld_bytes_, temp_, run_.threads, [&] { context.check_stop(); }});
    return out;
  }

 private:
  Json write(TaskContext& context) const {
    const auto source = open_mesh_file(mesh_);
    std::unique_ptr<WeldedMesh> welded;
    if (!source->shared_vertices())
      welded = std::make_unique<WeldedMesh>(*source,
                                            WeldOptions{weld_bytes_, temp_, [&] { context.check_stop(); }});
    MeshReader& mesh = welded ? *welded : *source;
    MeshHeader header = mesh.header();
    const MeshCounts n = count_mesh(mesh, context);
    header.vertices = n.vertices, header.faces = n.faces;
    header.synthetic = mesh.has_synthetic();
    place_output(header, output_, grown(store_.box(), largest_coefficient()), false);
    const auto writer = create_mesh_file(output_, header);
    double largest = 0.0, squares = 0.0;
    std::uint64_t moved = 0;
    stream_vertices(
        mesh, vertex_window(run_), context,
        [&](std::uint64_t, DisplacedBatch& b) {
          b.largest = 0.0;
          b.distance.assign(b.position.size(), 0.0);
          for (std::size_t i = 0; i < b.position.size(); ++i) {
            if (!finite(b.position[i])) continue;
            const Double3 by = lattice_.at(b.position[i]);
            b.position[i] = b.position[i] + by;
            b.distance[i] = dot(by, by);
            b.largest = std::max(b.largest, b.distance[i]);
          }
        },
        [&](DisplacedBatch& b) {
          largest = std::max(largest, b.largest);
          for (const double square : b.distance) squares += square;
          moved += b.distance.size();
          writer->vertices(b.position, b.rgba);
        });
    write_deformed_faces(mesh, false, *writer, context);
    writer->finish();
    context.count_written(writer->bytes_written());
    Json out = {{"path", json_text(output_)},
                {"vertices", header.vertices},
                {"faces", header.faces},
                {"bytes", writer->bytes_written()},
                {"double_positions", header.double_positions},
                {"shift", header.shift},
                {"largest_move", std::sqrt(largest) + writer->rounding().largest},
                {"rms_move", moved > 0 ? std::sqrt(squares / static_cast<double>(moved)) : 0.0}};
    tell_rounding(out, output_, header.origin, writer->rounding());
    return out;
  }

  /// No displacement is larger.
  double largest_coefficient() const {
    double square = 0.0;
    for (const Double3& c : lattice_.coefficient) square = std::max(square, dot(c, c));
    return std::sqrt(square);
  }

  DeformOptions options_;
  std::filesystem::path mesh_, output_, temp_;
  RunOptions run_;
  std::uint64_t weld_bytes_, bytes_;
  MeshStore store_;
  DisplacementLattice lattice_;
};

}  // namespace

std::unique_ptr<Stage> make_onto_write_stage(const JobState& state, const DeformOptions& options) {
  return std::make_unique<OntoWriteStage>(state, options);
}

}  // namespace tessera
