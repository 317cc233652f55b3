#include "stream/stages/solid/csg_job.h"

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/stages/solid/exact_csg.h"
#include "stream/stages/solid/solid_needs.h"

namespace tessera {
namespace {

Placement placement_of(const Json& numbers) {
  Placement p;
  for (std::size_t k = 0; k < 9; ++k) p.matrix[k] = numbers.at(k).get<double>();
  for (std::size_t k = 0; k < 3; ++k) p.shift[k] = numbers.at(9 + k).get<double>();
  return p;
}

SolidTree::Join join_of(const Json& step) {
  const std::string word = step.at("join").get<std::string>();
  return word == "union"          ? SolidTree::Join::kUnite
         : word == "intersection" ? SolidTree::Join::kIntersect
                                  : SolidTree::Join::kSubtract;
}

/// Whether what a tree leaves has an end.
class Bounds {
 public:
  void push(bool bounded) { stack_.push_back(bounded); }
  void join(SolidTree::Join join) {
    const bool b = stack_.back();
    stack_.pop_back();
    const bool a = stack_.back();
    stack_.back() = join == SolidTree::Join::kUnite       ? a && b
                    : join == SolidTree::Join::kIntersect ? a || b
                                                          : a;
  }
  bool all() const { return stack_.size() == 1 && stack_[0]; }

 private:
  std::vector<bool> stack_;
};

PlainShape shape_of(const Json& step) {
  return {step.at("shape").get<std::string>(), step.at("numbers").get<std::vector<double>>(),
          placement_of(step.at("placement"))};
}
bool is_bounded(const PlainShape& shape) {
  return shape.kind != "halfspace";
}

}  // namespace

OptionTable option_table(CsgOptions& o) {
  OptionTable t("What it computes");
  add_surface_options(t, o);
  t.add("exact", &o.exact,
        "cut the faces of the meshes along each other instead of sampling them: faces away from the cut stay "
        "as they "
        "are, to the bit, cuts are those of real numbers. Closed meshes alone that do not cross themselves "
        "(tessera "
        "check --crossings), in memory: about 420 bytes a face");
  t.add("program", &o.program, "the tree as a postfix list").hidden();
  return t;
}

SolidModel csg_model(const CsgOptions& options) {
  SolidModel model;
  // Operands are numbered meshes first.
  const Json program = try_parse_json(options.program);
  if (!program.is_array()) throw InputError("the scene is no tree of solids");
  std::size_t meshes = 0, shapes = 0;
  for (const Json& step : program) meshes += step.contains("mesh");
  Bounds bounds;
  for (const Json& step : program) {
    if (step.contains("mesh")) {
      model.tree.push_operand(static_cast<std::uint8_t>(model.meshes.size()));
      model.meshes.push_back({{step.at("mesh").get<std::size_t>()}, placement_of(step.at("placement"))});
      bounds.push(true);
    } else if (step.contains("mill")) {
      model.tree.push_operand(static_cast<std::uint8_t>(meshes + shapes++));
      model.shapes.push_back(MillShape{step.at("numbers").get<std::vector<double>>(),
                                       placement_of(step.at("placement")),
                                       meshes + step.at("mill").get<std::size_t>()});
      bounds.push(true);
    } else if (step.contains("blend")) {
      model.tree.push_operand(static_cast<std::uint8_t>(meshes + shapes++));
      const Json& both = step.at("blend");
      const BlendShape blend = {shape_of(both.at(0)), shape_of(both.at(1)), join_of(step),
                                step.at("radius").get<double>()};
      bounds.push(is_bounded(blend.first));
      bounds.push(is_bounded(blend.second));
      bounds.join(blend.join);
      model.shapes.push_back(blend);
    } else if (step.contains("shape")) {
      model.tree.push_operand(static_cast<std::uint8_t>(meshes + shapes++));
      const PlainShape shape = shape_of(step);
      bounds.push(is_bounded(shape));
      model.shapes.push_back(shape);
    } else {
      const SolidTree::Join join = join_of(step);
      model.tree.push_join(join);
      bounds.join(join);
    }
  }
  if (meshes + shapes > kMaxOperands)
    throw InputError("the scene has " + std::to_string(meshes + shapes) + " solids, more than " +
                     std::to_string(kMaxOperands) + ": unite some of them first");
  if (!model.tree.is_complete(meshes + shapes)) throw InputError("the scene is no tree of solids");
  if (!bounds.all())
    throw InputError("the scene has no end, half-spaces reach out of it: intersect them with a solid");
  apply(options, model);
  return model;
}

JobDescription csg_job(const CsgOptions& options) {
  if (options.exact) return exact_csg_job(options);
  const SolidModel model = csg_model(options);
  JobDescription job{"csg",
                     solid_stages(model, options.min_component, "tessera csg"),
                     0,
                     summarise_solids,
                     {known_origin()},
                     job_page()};
  job.needs = [model](const JobState& state) { return solid_needs(state, model); };
  return job;
}

}  // namespace tessera
