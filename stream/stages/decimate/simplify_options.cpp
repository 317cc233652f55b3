#include "stream/stages/decimate/simplify_options.h"

#include <array>

#include "kernels/certify/certificate.h"
#include "kernels/decimate/auto_tolerance.h"
#include "octree/error.h"
#include "stream/meshes/texture_option.h"

namespace tessera {
namespace {

struct Priority {
  const char* name;
  DecimatePriority value;
};
constexpr std::array<Priority, 6> kPriorities = {{{"quadric", DecimatePriority::kQuadric},
                                                  {"probabilistic", DecimatePriority::kProbabilistic},
                                                  {"samples", DecimatePriority::kSampleDistance},
                                                  {"normal", DecimatePriority::kNormalDeviation},
                                                  {"round", DecimatePriority::kMeanRatio},
                                                  {"length", DecimatePriority::kEdgeLength}}};

}  // namespace

OptionTable option_table(SimplifyOptions& o) {
  OptionTable t("What it computes");
  t.add(
       "tolerance", &o.tolerance,
       "largest distance between result and reference, both ways, in the units of the mesh; auto: a fifth of "
       "its edges (root mean square), and no less than the noise measured in it, the report says which")
      .at_least(0)
      .or_word("auto", kAutoTolerance);
  t.add("target-faces", &o.target_faces, "stop at about so many faces; the tolerance, if any, still holds");
  t.add("reference", &o.reference,
        "surface (the input itself), or a mesh file: then the passes still stay within the tolerance of the "
        "input, only the final proof is against the file (exit code 6 where it fails)")
      .shown_as("surface|FILE");
  t.add("max-normal-deviation", &o.max_normal_deviation_deg,
        "largest angle in degrees between a new face and the faces it stands for (but not where noise turns "
        "a sliver: moving its corner by half the tolerance and a 32nd of the width of the faces around it); "
        "0 = free")
      .within(0, 180);
  t.add("feature-angle", &o.feature_angle_deg,
        "edges that turn by more degrees are kept as creases; 0 = none")
      .within(0, 180);
  std::vector<std::string> priorities;
  for (const Priority& p : kPriorities) priorities.emplace_back(p.name);
  t.add("priority", &o.priority,
        "what goes first: quadric, probabilistic (quadrics of uncertain planes), samples (distance of the "
        "original vertices), normal (deviation), round (worst triangle) or length (shortest edge)")
      .one_of(priorities);
  t.add("placement", &o.placement,
        "endpoint: vertices stay where vertices were; optimal: they may move within the tolerance")
      .one_of({"endpoint", "optimal"});
  t.add("min-roundness", &o.min_mean_ratio, "smallest roundness of a new face: 1 is equilateral, 0 flat")
      .within(0, 1);
  t.add("crossings", &o.crossings,
        "refuse: no face comes to cross, overlap or touch others beyond what they share; repair: nor do "
        "those that do as given: they are cut out first and the holes closed anew, and closed bodies that "
        "pass through each other or themselves united; keep: that is not looked at, which saves a sixth of "
        "the time")
      .one_of({"refuse", "repair", "keep"});
  t.add("colour-weight", &o.colour_weight,
        "length that the full range of a colour is worth, in the units of the mesh; 0 = colours follow")
      .at_least(0);
  add_colour_tolerance(t, o.colour_tolerance, "0 with --target-faces or --texture");
  t.add("smooth", &o.smooth,
        "smooth the mesh before it is decimated, by at most half of the tolerance and the result is proven; "
        "implicit: a thin plate, as strong as the noise measured in the mesh asks for; denoise: fits, 7 "
        "times as long, sharp creases (both as of tessera smooth); auto: denoise from a noise of 0.02 edges "
        "on, else implicit")
      .one_of({"off", "implicit", "denoise", "auto"});
  add_texture(t, o.texture, "the input, of its own textures or its vertices,");
  add_normal_map(t, o.normal_map, "the input");
  t.add("passes", &o.passes, "passes over shifted blocks").within(1, 8);
  t.add("block-faces", &o.block_faces, "most faces of a block").at_least(1024);
  // For tests of the rounds: makes the passes bolder than the certificate allows.
  t.add("loop-share", &o.loop_share, "share of the tolerance that the passes may use")
      .within(1e-3, 4)
      .hidden();
  return t;
}

void SimplifyOptions::validate() const {
  if (tolerance == 0.0 && target_faces == 0)
    throw UsageError("give --tolerance above 0, or --target-faces, or both: nothing says how far to go");
  validate_normal_map(normal_map, has_texture());
  SimplifyOptions known = *this;
  if (tolerance == kAutoTolerance) known.tolerance = 1.0;
  known.kernel(true).validate();
}

DecimateOptions SimplifyOptions::kernel(bool float_positions) const {
  DecimateOptions o;
  o.tolerance = tolerance * loop_share / CertificateOptions{}.tightness;
  for (const Priority& p : kPriorities)
    if (priority == p.name) o.priority = p.value;
  o.placement = placement == "optimal" ? DecimatePlacement::kOptimal : DecimatePlacement::kEndpoint;
  o.float_positions = float_positions;
  o.sweep = target_faces == 0;
  o.feature_angle_deg = feature_angle_deg;
  o.max_normal_deviation_deg = max_normal_deviation_deg;
  o.min_mean_ratio = min_mean_ratio;
  o.allow_crossings = crossings == "keep";
  o.colour_weight = colour_weight;
  // A count of faces is asked for whatever that does to colours, and a texture has them all.
  const bool free = target_faces > 0 || has_texture();
  o.colour_tolerance = colour_tolerance == kAutoColourTolerance && free ? 0.0 : colour_tolerance;
  return o;
}

}  // namespace tessera
