#include "stream/stages/decimate_job.h"

#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/mesh_store_output.h"
#include "stream/stages/certify_stage.h"
#include "stream/stages/import_stages.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint64_t kSortBytes = std::uint64_t{64} << 20;

class MeshWriteStage : public Stage {
 public:
  MeshWriteStage(const JobState& state, const SimplifyOptions& options, std::string made_by)
      : state_(state),
        options_(options),
        made_by_(std::move(made_by)),
        store_(open_pass_input(state, options.passes)) {}
  std::string name() const override { return "write"; }
  std::size_t task_count() const override { return 0; }
  std::uint64_t task_bytes(std::size_t) const override { return 0; }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  json run(std::size_t, TaskContext&) const override { return {}; }
  std::uint64_t finish_bytes() const override { return write_mesh_store_bytes(store_, sort_bytes()); }

  json finish(const std::vector<json>&, TaskContext& context) const override {
    MeshStoreOutput output;
    output.path = state_.output;
    output.temp = state_.work;
    output.memory_bytes = sort_bytes();
    output.check_stop = [&] { context.check_stop(); };
    output.advance = [&](std::uint64_t faces) { context.advance(faces); };
    output.comments = {"made by " + made_by_ + ", tolerance " + json(options_.tolerance).dump()};
    const MeshStoreOutputReport report = write_mesh_store(store_, output);
    context.count_written(report.bytes);
    return {{"path", state_.output.string()},
            {"vertices", report.vertices},
            {"faces", report.faces},
            {"bytes", report.bytes},
            {"double_positions", store_.info().double_positions},
            {"shift", store_.info().shift}};
  }

 private:
  std::uint64_t sort_bytes() const { return std::min(kSortBytes, state_.run.memory_bytes / 8); }

  JobState state_;
  SimplifyOptions options_;
  std::string made_by_;
  MeshStore store_;
};

json result_of(const json& report, const std::string& stage) {
  for (const json& entry : report.at("stages"))
    if (entry.at("name") == stage) return entry.at("result");
  return json::object();
}

void summarise(json& report) {
  const json read = result_of(report, "mesh-read");
  const json welded = result_of(report, "mesh-vertices");
  const json corners = result_of(report, "mesh-corners");
  json repair = result_of(report, "mesh-tiles");
  repair["nonfinite_vertices"] = read.value("nonfinite_vertices", 0);
  repair["welded_vertices"] = welded.value("welded", 0);
  repair["bad_faces"] = corners.value("bad_faces", 0);
  repair["degenerate_faces"] = corners.value("degenerate_faces", 0);
  repair.erase("fixes");
  report["input"] = {{"format", read.value("format", "")},
                     {"vertices", read.value("vertices", 0)},
                     {"faces", corners.value("faces", 0)},
                     {"repair", repair}};
  report["mesh"] = result_of(report, "write");
  report["certificate"] = result_of(report, "certify");
}

}  // namespace

std::vector<StageEntry> simplify_stages(const SimplifyOptions& options, const std::string& made_by) {
  std::vector<StageEntry> stages;
  for (int p = 0; p < options.passes; ++p) {
    if (options.target_faces > 0)
      stages.push_back({"costs-" + std::to_string(p + 1), [=](const JobState& state) {
                          return make_simplify_stage(state, options, {p, true});
                        }});
    stages.push_back({"pass-" + std::to_string(p + 1), [=](const JobState& state) {
                        return make_simplify_stage(state, options, {p, false});
                      }});
  }
  const bool own = options.reference == "surface";
  if (!own)
    for (StageEntry& entry : import_stages({1, "reference"})) stages.push_back(std::move(entry));
  stages.push_back({"certify", [=](const JobState& state) {
                      CertifyRequest request;
                      request.name = "certify";
                      request.tolerance = options.tolerance;
                      request.mesh = [=](const JobState& s) { return open_pass_input(s, options.passes); };
                      request.reference = [=](const JobState& s) {
                        return open_imported_mesh(s.work, own ? "mesh" : "reference");
                      };
                      return make_certify_stage(state, request);
                    }});
  stages.push_back({"write", [=](const JobState& state) {
                      return std::make_unique<MeshWriteStage>(state, options, made_by);
                    }});
  return stages;
}

JobDescription decimate_job(const SimplifyOptions& options) {
  std::vector<StageEntry> stages = import_stages({0, "mesh"});
  for (StageEntry& entry : simplify_stages(options, "tessera decimate")) stages.push_back(std::move(entry));
  return {"decimate", std::move(stages), 0, summarise};
}

JobDescription decimate_job(const std::string& settings) {
  return decimate_job(simplify_options_from_json(json::parse(settings)));
}

}  // namespace tessera
