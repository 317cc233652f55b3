#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/onto_stages.h"
#include "stream/survey/scan_deviation.h"

namespace tessera {
namespace {

/// Neither figure hangs on the fit: distances are those of `deviate`, of every point, to the files.
class OntoDeviationStage : public SerialStage {
 public:
  OntoDeviationStage(const JobState& state, const DeformOptions& options)
      : scans_(state.inputs.begin() + 1, state.inputs.end()),
        mesh_(state.inputs.at(0)),
        output_(state.output),
        work_(state.work),
        run_(state.run),
        max_distance_(onto_distance(options, open_imported_mesh(state.work, kDeformImport).diagonal())) {}
  std::string name() const override { return "deviation"; }
  std::uint64_t units() const override { return 2; }
  std::string unit_name() const override { return "passes"; }
  std::uint64_t finish_bytes() const override { return onto_deviation_bytes(run_); }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const Json before = measured(mesh_, context), after = measured(output_, context);
    return {{"before", before}, {"after", after}};
  }

 private:
  Json measured(const std::filesystem::path& mesh, TaskContext& context) const {
    context.check_stop();
    ScanDeviationOptions o;
    o.max_distance = max_distance_;
    o.memory_bytes = run_.memory_bytes;
    o.threads = run_.threads;
    o.temp = work_;
    Json out = to_json(measure_deviation(scans_, mesh, o, {}), -1.0);
    context.advance(1);
    return out;
  }

  std::vector<std::filesystem::path> scans_;
  std::filesystem::path mesh_, output_, work_;
  RunOptions run_;
  double max_distance_;
};

}  // namespace

std::unique_ptr<Stage> make_onto_deviation_stage(const JobState& state, const DeformOptions& options) {
  return std::make_unique<OntoDeviationStage>(state, options);
}

}  // namespace tessera
