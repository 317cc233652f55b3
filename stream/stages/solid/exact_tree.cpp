#include "stream/stages/solid/exact_tree.h"

#include <algorithm>
#include <utility>

#include "octree/error.h"
#include "stream/files/json.h"

namespace tessera {
namespace {

/// Whether the faces of a closed mesh look inward as a whole.
bool is_inside_out(const SolidMesh& mesh) {
  double sum = 0.0;
  for (const auto& f : mesh.faces) {
    const Double3& from = mesh.points[0];
    sum += dot(mesh.points[f[0]] - from, cross(mesh.points[f[1]] - from, mesh.points[f[2]] - from));
  }
  return sum < 0.0;
}
void reverse_faces(SolidMesh& mesh) {
  for (auto& f : mesh.faces) std::swap(f[1], f[2]);
}

std::string advice_for(const std::string& file) {
  return ": --exact takes closed meshes that do not cross themselves; tessera check --closed --crossings " +
         file +
         " lists what is wrong, tessera resurface makes a solid of it, csg without --exact takes it as it is";
}

SolidMesh placed(SolidMesh mesh, const Placement& placement) {
  if (placement == Placement{}) return mesh;
  for (Double3& p : mesh.points) p = placement.apply(p);
  if (placement.determinant() < 0.0) reverse_faces(mesh);
  return mesh;
}

}  // namespace

std::vector<ExactStep> exact_steps(const std::string& program) {
  const Json steps = try_parse_json(program);
  if (!steps.is_array()) throw InputError("the scene is no tree of solids");
  std::vector<ExactStep> out;
  std::size_t deep = 0;
  for (const Json& step : steps) {
    ExactStep here;
    if (step.contains("mesh")) {
      here.input = step.at("mesh").get<std::size_t>();
      const std::vector<double> numbers = step.at("placement").get<std::vector<double>>();
      for (std::size_t k = 0; k < 9; ++k) here.placement.matrix[k] = numbers.at(k);
      for (std::size_t k = 0; k < 3; ++k) here.placement.shift[k] = numbers.at(9 + k);
    } else if (step.contains("join") && !step.contains("blend")) {
      const std::string word = step.at("join").get<std::string>();
      here.join = word == "union"          ? BooleanJoin::kUnite
                  : word == "intersection" ? BooleanJoin::kIntersect
                                           : BooleanJoin::kSubtract;
    } else {
      throw UsageError(
          "--exact joins meshes alone, the scene has shapes too: leave --exact out, or make meshes of them "
          "first "
          "with tessera csg");
    }
    out.push_back(here);
    if (!here.input && deep < 2) throw InputError("the scene is no tree of solids");
    deep = here.input ? deep + 1 : deep - 1;
  }
  if (deep != 1) throw InputError("the scene is no tree of solids");
  return out;
}

void ExactWork::run() {
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (is_inside_out(meshes[i])) {
      reverse_faces(meshes[i]);
      turned.push_back(names[i]);
    }
    if (const auto fault = solid_fault(meshes[i]))
      throw InputError(names[i] + ": " + *fault + advice_for(names[i]));
  }
  std::vector<SolidMesh> stack;
  for (const ExactStep& step : steps) {
    if (step.input) {
      stack.push_back(canonical_solid(placed(meshes.at(*step.input), step.placement)));
      if (step.placement != Placement{})
        if (const auto fault = solid_fault(stack.back()))
          throw InputError(names[*step.input] + ": where the scene puts it, rounded to doubles, " + *fault +
                           ": scale it less, or put it nearer to the origin");
      continue;
    }
    const SolidMesh second = std::move(stack.back());
    stack.pop_back();
    const SolidMesh first = canonical_solid(stack.back());
    stack.back() = joined(first, canonical_solid(second), step.join);
  }
  result = std::move(stack.back());
}

SolidMesh ExactWork::joined(const SolidMesh& first, const SolidMesh& second, BooleanJoin join) {
  BooleanResult out = exact_boolean(first, second, join);
  const RoundingStats rounding = settle_rounding(out, floats ? PositionStep::kFloat : PositionStep::kDouble);
  if (rounding.left > 0) {
    const Double3& p = *rounding.where;
    throw ValidationError("the cut cannot be written exactly: rounded to " +
                          std::string(floats ? "floats" : "doubles") + ", " + std::to_string(rounding.left) +
                          " faces still cross or have no area, the first at " + std::to_string(p[0]) + " " +
                          std::to_string(p[1]) + " " + std::to_string(p[2]) +
                          (floats ? "; write a .ply, which holds doubles"
                                  : "; move one of the meshes a little, or use csg without --exact"));
  }
  sum.add(out.stats, rounding);
  return std::move(out.mesh);
}

}  // namespace tessera
