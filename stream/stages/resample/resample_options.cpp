#include "stream/stages/resample/resample_options.h"

#include "octree/error.h"
#include "stream/stages/resample/blend_file.h"

namespace tessera {
namespace {

/// Of the tolerance that a blend may use: the proof at the end is another one, and must not end a job over a last digit.
constexpr double kBlendShare = 0.98;

}  // namespace

OptionTable option_table(ResampleOptions& o) {
  OptionTable t("What it computes");
  t.add("tracks", &o.blends, "the blends as JSON, or auto").hidden();
  t.add("tolerance", &o.tolerance,
        "largest distance between result and input, both ways, units of the mesh: a blend that would be "
        "farther "
        "off stays as it is; 0 = a thousandth of the diagonal")
      .at_least(0);
  t.add("spacing", &o.spacing,
        "between ribs, and between samples of a rib, units of the mesh; 0 = the mean edge around each blend")
      .at_least(0);
  t.add("scale", &o.scale,
        "radius of the balls over which the search measures curvature, units of the mesh: about as wide as "
        "the "
        "blends; 0 = four edges")
      .at_least(0);
  t.add("round", &o.round,
        "blends and sharp edges get this radius, units of the mesh; 0 = the radius they have")
      .at_least(0);
  t.add("sharpen", &o.sharpen, "blends become sharp edges, where their flanks meet");
  t.add("curve", &o.profile, "the knots of a profile as JSON").hidden();
  t.add("block-faces", &o.block_faces, "most faces of a block of the search").at_least(1024);
  return t;
}

void ResampleOptions::validate() const {
  if (sharpen && round > 0.0)
    throw UsageError("--round and --sharpen both say what becomes of blends: give one of them");
  if (sharpen && !profile.empty())
    throw UsageError("--profile and --sharpen both say what becomes of blends: give one of them");
}

BlendOptions ResampleOptions::kernel(double tolerance_of_mesh, bool float_positions) const {
  BlendOptions k;
  k.tolerance = kBlendShare * tolerance_of_mesh;
  k.spacing = spacing;
  k.float_positions = float_positions;
  k.radius = round;
  if (round > 0.0 || sharpen) k.edit = BlendEdit::kRound;
  if (!profile.empty()) {
    k.edit = BlendEdit::kProfile;
    k.profile = parse_profile(profile, "the profile");
  }
  return k;
}

}  // namespace tessera
