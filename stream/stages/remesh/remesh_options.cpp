#include "stream/stages/remesh/remesh_options.h"

#include <string>

#include "octree/error.h"

namespace tessera {
namespace {

constexpr int kMostPasses = 8;  ///< as many as keys of new vertices tell apart
/// Of the tolerance that operations may use: they look at points of a face, the proof at all of it.
constexpr double kLoopShare = 0.75;
/// Of the tolerance that a chord of an adapted length may use. Edges get 4/3 of their length before they are split, and
/// the error grows with the square: so even the longest one leaves faces within what operations may use. With more of it
/// operations would be refused all over, lengths end up shorter by splits at the end, and angles stay poor.
constexpr double kSizingShare = kLoopShare * (3.0 / 4.0) * (3.0 / 4.0);
/// Without a tolerance operations keep within this share of the length: enough for any circle that edges can follow.
constexpr double kShapeShare = 0.2;
/// Where edges follow the surface closely, these and a few splits bring it to a tenth.
constexpr double kFineShare = 0.06, kFineSplitShare = 0.08;
/// Of the presets: more iterations leave more regular vertices, around which angles and areas can be more alike.
constexpr int kTimesForAngles = 2, kTimesForAreas = 4;
/// Squares come near where sizes are least, in fewer sweeps.
constexpr int kSquaresForAngles = 3, kSizesForAngles = 9, kSquaresForAreas = 6, kSizesForAreas = 18;
constexpr double kWeightForAngles = 20.0, kWeightForAreas = 0.8, kSinesForAngles = 1.25,
                 kSinesForAreas = 0.17;
/// Of the length: how far the chord of an edge may leave the crease that it follows. A tenth less than is promised, as the
/// middles of edges alone are asked.
constexpr double kCreaseShare = 0.018;

}  // namespace

OptionTable option_table(RemeshJobOptions& o) {
  OptionTable t("What it computes");
  t.add("edge", &o.edge, "length of the edges, units of the mesh; 0 = from --faces or --tolerance")
      .at_least(0);
  t.add("faces", &o.faces,
        "about so many faces: the length of the edges follows; without --tolerance edges get longer, up to "
        "three "
        "times, where creases, borders and needles keep more than 1.2 times as many, and the exit code is 6 "
        "where "
        "that does not help");
  t.add(
       "tolerance", &o.tolerance,
       "largest distance between result and input, both ways, units of the mesh; alone: the length of the "
       "edges follows from it and the curvature; 0 = the distance is measured and reported, single "
       "operations keep within a fifth of the edges, or so near that the distance comes to about a tenth of "
       "them where they follow nearly all of the surface closely and neither --even nor --min-angle is given")
      .at_least(0);
  t.add(
      "adaptive", &o.adaptive,
      "edges are short where the surface bends and long where it does not, as the tolerance asks for; in two "
      "more passes lengths of neighbours are evened to 1 : 1.5, as far as the tolerance and creases allow, "
      "what is left is told");
  t.add("min-edge", &o.min_edge, "adaptive: shortest length, units of the mesh; 0 = from the curvature")
      .at_least(0);
  t.add("max-edge", &o.max_edge, "adaptive: longest length, units of the mesh; 0 = from the curvature")
      .at_least(0);
  t.add("max-normal-deviation", &o.max_normal_deviation_deg,
        "largest angle in degrees between a new face and the input at its centre; 0 = free")
      .within(0, 180);
  t.add("feature-angle", &o.feature_angle_deg,
        "edges that turn by more degrees are kept as creases; 0 = none")
      .within(0, 180);
  t.add("min-angle", &o.min_angle_deg,
        "faces with a smaller angle than so many degrees are flipped, moved, collapsed or split in two more "
        "passes, as far as the tolerance, or without one a fifth of the edges, and creases allow; what is "
        "left "
        "is told; 0 = none, e.g. remesh mesh.ply --faces 100000 --min-angle 30 -o even.ply")
      .within(0, 40);
  t.add("iterations", &o.iterations, "of splits, collapses, flips and relaxation in each pass").within(1, 50);
  t.add(
       "even", &o.even,
       "what becomes most alike: angles, by twice as many iterations, or areas of the cells around vertices "
       "at the expense of angles, by four times as many, both farther from the input; or both a little, e.g. "
       "remesh mesh.ply --faces 100000 --even areas -o even.ply")
      .one_of({"both", "angles", "areas"});
  t.add(
       "creases", &o.creases,
       "even: edges are as long on creases as elsewhere, and cut the corners of tight bends by their chords; "
       "graded: shorter there and around, down to a tenth, so that chords keep within 0.02 edges of the "
       "crease, e.g. remesh part.stl --edge 0.5 --creases graded -o even.ply")
      .one_of({"even", "graded"});
  t.add("crossings", &o.crossings,
        "refuse: no face comes to cross, overlap or touch others beyond what they share; repair: nor do "
        "those that do as given: they are cut out first and the holes closed anew, and closed bodies that "
        "pass through each other or themselves united")
      .one_of({"refuse", "repair"});
  t.add("passes", &o.passes, "passes over shifted blocks").within(1, kMostPasses);
  t.add("block-faces", &o.block_faces, "most faces of a block").at_least(1024);
  return t;
}

void RemeshJobOptions::validate() const {
  if (edge == 0.0 && faces == 0 && tolerance == 0.0)
    throw UsageError("give --edge, --faces or --tolerance above 0: nothing says how long edges are to be");
  if (all_passes() > kMostPasses)
    throw UsageError(std::string(min_angle_deg > 0.0 && adaptive
                                     ? "--adaptive and --min-angle add two passes each"
                                 : adaptive ? "--adaptive adds two passes"
                                            : "--min-angle adds two passes") +
                     ": give --passes of at most " + std::to_string(kMostPasses - all_passes() + passes));
  if (adaptive && !(tolerance > 0.0))
    throw UsageError("--adaptive wants --tolerance above 0: lengths follow from it and the curvature");
  if (adaptive && (edge > 0.0 || faces > 0))
    throw UsageError(
        "--adaptive finds lengths by itself: give --min-edge and --max-edge instead of --edge or --faces");
  if (adaptive && creases == "graded")
    throw UsageError("--adaptive makes edges short where creases bend by itself: leave out --creases graded");
  if (!adaptive && (min_edge > 0.0 || max_edge > 0.0))
    throw UsageError("--min-edge and --max-edge are for --adaptive: add it, or give --edge");
  if (min_edge > 0.0 && max_edge > 0.0 && min_edge > max_edge)
    throw UsageError("--min-edge is above --max-edge: swap them");
  if (edge > 0.0 && faces > 0)
    throw UsageError("--edge and --faces both say how long edges are to be: give one of them");
}

RemeshOptions RemeshJobOptions::kernel(double length, double shortest, bool fine,
                                       bool float_positions) const {
  RemeshOptions k;
  k.edge = length;
  k.min_edge = shortest;
  if (adaptive) k.sizing_tolerance = kSizingShare * tolerance;
  k.tolerance = tolerance > 0.0 ? kLoopShare * tolerance : (fine ? kFineShare : kShapeShare) * length;
  if (fine) k.refine_within = kFineSplitShare * length;
  if (creases == "graded") k.crease_tolerance = kCreaseShare * length;
  k.refine_beyond = tolerance > 0.0;
  k.collapse_needles = !k.refine_beyond;
  k.max_normal_deviation_deg = max_normal_deviation_deg;
  k.feature_angle_deg = feature_angle_deg;
  k.iterations = iterations;
  k.float_positions = float_positions;
  if (even != "both") {
    const bool angles = even == "angles";
    k.iterations *= angles ? kTimesForAngles : kTimesForAreas;
    k.angle_weight = angles ? kWeightForAngles : kWeightForAreas;
    k.last_relaxations = angles ? kSquaresForAngles : kSquaresForAreas;
    k.size_relaxations = angles ? kSizesForAngles : kSizesForAreas;
    k.sine_weight = angles ? kSinesForAngles : kSinesForAreas;
  }
  return k;
}

}  // namespace tessera
