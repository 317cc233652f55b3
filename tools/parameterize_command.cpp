#include <fmt/format.h>

#include <memory>

#include "stream/commands/parameterize_mesh.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

struct ParameterizeArguments {
  std::vector<std::string> inputs;
  std::filesystem::path output;
  std::string method = "lscm";
  std::string border = "circle";
  ParameterizeMeshOptions options;
  bool force = false;
};

void run_parameterize(ParameterizeArguments arguments) {
  cli::require_inputs(arguments.inputs);
  const std::filesystem::path input = cli::one_input(expand_inputs(arguments.inputs), "parameterized");
  std::vector<std::filesystem::path> reads = cli::also_read(arguments.inputs);
  reads.push_back(input);
  cli::require_new_output(arguments.output, arguments.force, reads);
  arguments.options.check_stop = throw_if_stopped;
  ParameterizeOptions& map = arguments.options.map;
  map.method =
      arguments.method == "lscm" ? ParameterMethod::kLeastSquaresConformal : ParameterMethod::kConformal;
  map.border = arguments.border == "circle" ? ParameterBorder::kCircle : ParameterBorder::kSquare;
  const ParameterizeMeshReport report = parameterize_mesh(input, arguments.output, arguments.options);
  const ParameterDistortion& d = report.map.distortion;
  fmt::print("{}: {} vertices, {} faces; read {:.2f} s, map {:.2f} s, write {:.2f} s\n",
             arguments.output.string(), report.vertices, report.faces, report.read_s, report.map_s,
             report.write_s);
  const bool iterated = report.map.solve.iterations > 0;
  fmt::print("{} unknowns, {} {} ({} entries), residual {:.1e}{}\n", report.map.unknowns,
             iterated ? "levels" : "factor", format_bytes(report.map.factor.bytes),
             report.map.factor.factor_entries, report.map.solve.residual,
             iterated ? fmt::format(" in {} cycles", report.map.solve.iterations) : "");
  fmt::print("{}\n", report.map.choice);
  fmt::print("angles change by {:.3f} degrees in the mean, {:.2f} at most; quasi-conformal factor {:.4f}\n",
             d.mean_angle_deg, d.largest_angle_deg, d.mean_quasi_conformal);
  fmt::print("flipped triangles {}, collapsed {}; negative cotangent weights {}\n", d.flipped, d.collapsed,
             report.map.negative_weights);
}

}  // namespace

cli::Command parameterize_command() {
  auto arguments = std::make_shared<ParameterizeArguments>();
  ParameterizeArguments& a = *arguments;
  OptionTable t;
  cli::add_inputs(t, a.inputs);
  cli::add_output(t, a.output, "mesh to write: .obj (vt) or .ply (s, t), coordinates in [0, 1]");
  t.add("method", &a.method,
        "lscm: least-squares conformal, the border is free; conformal: the border is fixed by arc length")
      .one_of({"lscm", "conformal"});
  t.add("border", &a.border, "conformal: shape of the border").one_of({"circle", "square"});
  t.add("clamp-weights", &a.options.map.clamp_weights,
        "conformal: negative cotangents count as 0; no triangle flips, angles suffer a little");
  t.add("memory", &a.options.memory_bytes,
        "cap, e.g. 2G; where a factor would not fit multigrid serves, slower; default: 0.8 of what is there")
      .bytes();
  cli::add_force(t, a.force);
  return {"parameterize", "Texture coordinates for a disk-like mesh, conformal: angles are kept. In core.", t,
          [arguments] { run_parameterize(*arguments); }};
}

}  // namespace tessera
