#include "stream/stages/solid/exact_csg.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "kernels/boolean/exact_boolean.h"
#include "kernels/mesh/face_components.h"
#include "kernels/mesh/flat_faces.h"
#include "octree/error.h"
#include "octree/placement.h"
#include "stream/files/json.h"
#include "stream/files/output_file.h"
#include "stream/files/path_text.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/import/import_needs.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/runtime/long_call.h"
#include "stream/runtime/report.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/solid/exact_tree.h"

namespace tessera {
namespace {

constexpr const char* kExactStage = "boolean";

bool is_float(double x) {
  return static_cast<double>(static_cast<float>(x)) == x;
}
bool all_floats(const SolidMesh& mesh) {
  return std::all_of(mesh.points.begin(), mesh.points.end(),
                     [](const Double3& p) { return is_float(p[0]) && is_float(p[1]) && is_float(p[2]); });
}

class ExactStage : public SerialStage {
 public:
  ExactStage(const JobState& state, std::string program)
      : inputs_(state.inputs), output_(state.output), temp_(state.work), program_(std::move(program)) {
    for (const std::filesystem::path& input : inputs_) faces_ += claimed_mesh_size(input).faces;
  }

  std::string name() const override { return kExactStage; }
  std::uint64_t units() const override { return faces_; }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t finish_bytes() const override { return bytes_for(output_, faces_); }
  static std::uint64_t bytes_for(const std::filesystem::path& output, std::uint64_t faces) {
    return exact_boolean_bytes(faces) + OutputFile::kBufferBytes + rounding_check_bytes(output, true, faces);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const auto work = std::make_shared<ExactWork>();
    work->steps = exact_steps(program_);
    work->floats = holds_floats_only(output_);
    for (const std::filesystem::path& input : inputs_) {
      work->meshes.push_back(read(input, context));
      work->names.push_back(input.string());
    }
    if (work->floats) require_floats(*work);
    long_call([work] { work->run(); });
    context.check_stop();
    if (work->result.faces.empty())
      throw EmptyError("nothing is left: the solids have no common inside, or all of one was taken away");
    Json result = write(work->result, context);
    tell(*work, result);
    return result;
  }

 private:
  SolidMesh read(const std::filesystem::path& input, TaskContext& context) const {
    const auto reader = open_mesh_file(input, {.temp = temp_});
    SolidMesh mesh;
    reader->read_vertices([&](std::span<const Double3> points, std::span<const std::uint32_t>) {
      context.check_stop();
      for (const Double3& p : points) {
        if (!std::isfinite(p[0] + p[1] + p[2]))
          throw InputError(input.string() + ": vertex " + std::to_string(mesh.points.size()) +
                           " is not finite: --exact needs all of them");
        mesh.points.push_back(p);
      }
    });
    if (mesh.points.size() > 0x7fffffffULL)
      throw ResourceError(input.string() +
                          ": more than 2^31 vertices: --exact holds fewer; csg without it takes them");
    reader->read_faces([&](std::span<const MeshFace> faces) {
      context.check_stop();
      for (const MeshFace& f : faces)
        mesh.faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                              static_cast<std::uint32_t>(f[2])});
    });
    return canonical_solid(mesh);
  }

  void require_floats(const ExactWork& work) const {
    for (std::size_t i = 0; i < work.meshes.size(); ++i)
      if (!all_floats(work.meshes[i]))
        throw UsageError(work.names[i] + ": its positions need doubles, which " +
                         output_.extension().string() +
                         " cannot hold as they are: write .ply or .obj with --exact");
    for (const ExactStep& step : work.steps)
      if (step.input && step.placement != Placement{})
        throw UsageError("meshes that the scene moves need doubles, which " + output_.extension().string() +
                         " cannot hold: write .ply or .obj with --exact");
  }

  Json write(const SolidMesh& mesh, TaskContext& context) const {
    MeshHeader header;
    header.vertices = mesh.points.size();
    header.faces = mesh.faces.size();
    header.double_positions = !all_floats(mesh);
    header.comments = {"tessera csg --exact"};
    const auto writer = create_mesh_file(output_, header);
    writer->vertices(mesh.points, {});
    std::vector<MeshFace> batch;
    constexpr std::size_t kBatch = 1u << 16;
    for (std::size_t f = 0; f < mesh.faces.size(); f += kBatch) {
      context.check_stop();
      batch.clear();
      for (std::size_t i = f; i < std::min(mesh.faces.size(), f + kBatch); ++i)
        batch.push_back({mesh.faces[i][0], mesh.faces[i][1], mesh.faces[i][2]});
      writer->faces(batch);
    }
    writer->finish();
    context.count_written(writer->bytes_written());
    Json result = {{"path", json_text(output_)},
                   {"vertices", mesh.points.size()},
                   {"faces", mesh.faces.size()},
                   {"bytes", writer->bytes_written()},
                   {"double_positions", header.double_positions}};
    tell_rounding(result, output_, {0, 0, 0}, writer->rounding());
    return result;
  }

  static void tell(const ExactWork& work, Json& result) {
    const FaceComponents parts = find_components(work.result.points.size(), work.result.faces);
    result["components"] = parts.faces.size();
    const BooleanStats& s = work.sum.stats;
    result["kept_faces"] = s.kept_faces;
    result["made_faces"] = s.made_faces;
    result["made_vertices"] = s.made_vertices;
    result["cut_faces"] = s.cut_faces;
    result["face_pairs"] = s.face_pairs;
    result["coplanar_pairs"] = s.coplanar_pairs;
    result["split_vertices"] = s.split_vertices;
    result["rounding_met"] = work.sum.rounding.met;
    result["rounding_moved"] = work.sum.rounding.moved;
    result["rounding_farthest"] = work.sum.rounding.farthest;
    const SolidMesh& mesh = work.result;
    const auto flat = std::count_if(mesh.faces.begin(), mesh.faces.end(), [&](const auto& f) {
      return face_extent(mesh.points[f[0]], mesh.points[f[1]], mesh.points[f[2]]).is_flat();
    });
    result["flat_faces"] = flat;
    if (flat > 0)
      result["warnings"].push_back(std::to_string(flat) +
                                   " of the faces written are so thin that tessera check --strict takes them "
                                   "for lines: surfaces nearly "
                                   "coincide there; tessera decimate drops them");
    for (const std::string& name : work.turned)
      result["warnings"].push_back(json_text(name) + " is inside out: its faces were turned");
    if (s.split_vertices > 0)
      result["warnings"].push_back("the result touches itself: " + std::to_string(s.split_vertices) +
                                   " vertices stand in it more than once, so that every edge has two faces; "
                                   "tessera check --crossings tells "
                                   "of these touches");
  }

  const std::vector<std::filesystem::path> inputs_;
  const std::filesystem::path output_, temp_;
  const std::string program_;
  std::uint64_t faces_ = 0;
};

void refuse_lattice_options(const CsgOptions& options) {
  const CsgOptions plain;
  std::string word;
  if (options.resolution != plain.resolution) word = "--resolution";
  if (options.method != plain.method) word = "--method";
  if (options.feature_angle_deg != plain.feature_angle_deg) word = "--feature-angle";
  if (options.min_component != plain.min_component) word = "--min-component";
  if (options.offset != plain.offset) word = "--offset";
  if (options.corners != plain.corners) word = "--corners";
  if (options.mitre_limit != plain.mitre_limit) word = "--mitre-limit";
  if (options.shell != plain.shell) word = "--shell";
  if (!word.empty())
    throw UsageError(word + " is of the lattice, which --exact does without: leave out one of them");
}

}  // namespace

JobDescription exact_csg_job(const CsgOptions& options) {
  refuse_lattice_options(options);
  exact_steps(options.program);
  JobDescription job{
      "csg",
      {{kExactStage, [program = options.program](
                         const JobState& state) { return std::make_unique<ExactStage>(state, program); }}},
      0,
      [](Json& report) { report["mesh"] = result_of(report, kExactStage); },
      {known_origin()},
      job_page()};
  job.needs = [](const JobState& state) {
    std::uint64_t faces = 0;
    for (const std::filesystem::path& input : state.inputs) faces += claimed_mesh_size(input).faces;
    return std::vector<StageNeed>{{kExactStage, ExactStage::bytes_for(state.output, faces), 0}};
  };
  return job;
}

}  // namespace tessera
