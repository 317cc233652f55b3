#include "stream/points/reconstruct_options.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <utility>

#include "kernels/field/field.h"
#include "octree/error.h"
#include "stream/files/read_file.h"
#include "stream/formats/points/projection.h"
#include "stream/meshes/texture_option.h"
#include "stream/points/clip_polygon.h"
#include "stream/points/plan.h"
#include "stream/points/point_filter.h"

namespace tessera {

std::uint32_t ReconstructOptions::max_hole_edges() const {
  if (max_hole == "auto") return 0;
  std::uint32_t edges = 0;
  const char* end = max_hole.data() + max_hole.size();
  const auto [at, error] = std::from_chars(max_hole.data(), end, edges);
  if (error != std::errc() || at != end || edges > kMaxHoleEdges)
    throw UsageError("--max-hole " + max_hole + ": not auto or a number of edges up to " +
                     std::to_string(kMaxHoleEdges));
  return edges;
}

bool ReconstructOptions::may_fuse_stores() const {
  if (has_levels()) return true;
  return decimates() && max_hole_edges() == 0 && border != "smooth" && reference == "surface";
}

bool ReconstructOptions::may_weld() const {
  return !has_levels() && (!may_fuse_stores() || smooths_border());
}

bool ReconstructOptions::fuses_stores(const Plan& plan) const {
  return may_fuse_stores() && (has_levels() || !(smooths_border() && plan.noise_cells > kExactNoise));
}

bool ReconstructOptions::fuses_first_pass() const {
  return may_fuse_stores() && !smooths() && !has_levels();
}

namespace {

/// \throws UsageError for what levels cannot do
void validate_levels(const ReconstructOptions& o) {
  const auto refuse = [&](const std::string& option, const std::string& why) {
    throw UsageError("--levels " + std::to_string(o.levels) + " with " + option + ": " + why +
                     "; leave one of them out");
  };
  if (o.holes != "keep")
    refuse("--holes " + o.holes,
           "the surface that closes holes is made of cells of one size, and would not meet that of smaller "
           "ones; --max-hole fills them on the mesh");
  if (o.vegetation == "keep")
    refuse("--vegetation keep",
           "a body is where cells hold enough strewn points, which smaller ones in its midst never do");
}

/// \throws UsageError for options of a product that is not wanted
void validate_ground(const ReconstructOptions& o) {
  const ReconstructOptions defaults;
  for (const auto& [name, given] : {std::pair{"--ground-slope", o.ground_slope != defaults.ground_slope},
                                    {"--ground-window", o.ground_window != defaults.ground_window},
                                    {"--ground-threshold", o.ground_threshold != defaults.ground_threshold}})
    if (given && !o.finds_ground())
      throw UsageError(std::string(name) +
                       ": means something with --surface ground or --vegetation drop only");
}

/// \throws UsageError for what excludes one product of a scene from above
void validate_surface(const ReconstructOptions& o) {
  const auto refuse = [&](const std::string& option, const std::string& why) {
    throw UsageError("--surface " + o.surface + " with " + option + ": " + why + "; leave one of them out");
  };
  if (o.from != "auto" && o.from != "above")
    refuse("--from " + o.from, "the surface model is of scenes seen from above");
  if (o.normals == "given") refuse("--normals given", "the surface model comes with estimated normals");
  if (o.vegetation != "auto" && o.vegetation != "top")
    refuse("--vegetation " + o.vegetation, "the surface model stands in for strewn points");
  if (o.reference == "points")
    refuse("--reference points", "the surface model replaces points that were to be measured");
}

}  // namespace

void add_columns(OptionTable& table, std::vector<std::string>& columns) {
  table
      .add("columns", &columns,
           "names of the columns of text scans of any extension, e.g. skip,x,y,z,nx,ny,nz,r,g,b,i; default: "
           "the header "
           "line, else x,y,z")
      .split();
}

OptionTable option_table(ReconstructOptions& o) {
  OptionTable t("What it computes");
  t.add("resolution,voxel", &o.resolution,
        "lattice spacing h, scan units; about 1.5 times the point spacing keeps what the scan holds; 0 = "
        "measured")
      .at_least(0);
  t.add("levels", &o.levels,
        "sizes of cells: where points lie densely enough they are h/2, h/4, ..., h/2^(N-1), h where they are "
        "sparsest; the mesh stays one, without seams; 1 = h everywhere")
      .within(1, 6);
  t.add("radius", &o.radius,
        "support radius of a sample, scan units: gaps up to about as wide are bridged, up to 1.8 times as "
        "wide among sparse samples; anything wider stays a border; 0 = measured, 3 h")
      .at_least(0);
  t.add("method", &o.method,
        "emc: extended marching cubes with sharp edges and corners; mc: plain marching cubes on the same "
        "field")
      .one_of({"emc", "mc"});
  t.add("feature-angle", &o.feature_angle_deg, "degrees between normals from which a cell holds a sharp edge")
      .within(0, 180);
  t.add("corner-angle", &o.corner_angle_deg,
        "degrees out of the plane of the crease from which an edge is a corner")
      .within(0, 180);
  t.add("min-component", &o.min_component,
        "faces; smaller islands are dropped; 0 = measured, but pieces of 100 faces that are smooth all over "
        "stay, and islands that are mostly border and folded go too, 1 = keep all");
  t.add("max-hole", &o.max_hole,
        "holes with a rim of at most N edges are filled by smooth patches that meet the rim tangentially, "
        "their faces marked (`synthetic` in PLY) and counted, but where they would cross the mesh; 0 = none; "
        "auto: in noisy scans what is narrower than the radius, slits too, in rooms 10 h with a rim of at "
        "most 100 edges, from above, and where few points lie farther apart than h, 20 h with one of at most "
        "400, by a membrane or a patch that folds where no smooth one fits; none with --border raw")
      .shown_as("auto|N");
  t.add("holes", &o.holes,
        "keep: the surface ends where the data does; close: an object gets no border at all, open terrain "
        "keeps its outer border and holes that stay within 20 h of the data are closed; fill-to:D: holes "
        "that stay within D (at most 56 h), whole or not at all; faces are marked (`synthetic` in PLY, blue "
        "in pictures) and counted")
      .shown_as("keep|close|fill-to:D");
  t.add("border", &o.border,
        "the line in which a noisy scan ends; raw: where the field does, which wavers from cell to cell; "
        "smooth: its vertices move by at most a cell towards the middle of their neighbours; auto: smooth, "
        "but raw with levels, and with a tolerance where the noise is below 0.03 of the resolution: smooth "
        "costs a mesh of full resolution on disk there")
      .one_of({"auto", "smooth", "raw"});
  t.add("outliers", &o.outliers,
        "auto: drop points that too few neighbours confirm, a share of the median, or fewer than three where "
        "that would take more than one in twenty; off: keep all")
      .one_of({"auto", "off"});
  t.add("vegetation", &o.vegetation,
        "estimated normals: points that are strewn through space instead of lying on a surface, as leaves, "
        "spray and passers-by; top: the smooth surface that one sees of them from above, down to the ground "
        "beside it; drop: no surface for them, and in scenes from above the ground below them, a smooth "
        "membrane, marked, where nobody saw it; keep: closed bodies around them; surface: as if they lay on "
        "one, which comes out torn; auto: top in scenes from above (drop with "
        "--levels or --reference points), else surface")
      .one_of({"auto", "top", "drop", "keep", "surface"});
  t.add("surface", &o.surface,
        "which surface of a scene from above is wanted; all: every one that was seen; top: one skin (a "
        "digital "
        "surface model), a height everywhere and walls at its steps, nothing below crowns, eaves and roofs; "
        "faces of it that nobody saw are marked (`synthetic` in PLY), e.g. reconstruct town.laz -o dsm.ply "
        "--surface top; ground: the bare terrain (a digital terrain model) without crowns, buildings and "
        "cars, one skin too, with a smooth membrane, marked, where they stood")
      .one_of({"all", "top", "ground"});
  t.add("ground-slope", &o.ground_slope,
        "with --surface ground or --vegetation drop: steepest ground, rise over run: steeper steps are "
        "objects")
      .within(0, 10);
  t.add("ground-window", &o.ground_window,
        "with --surface ground or --vegetation drop: half the width of the widest object to take away, scan "
        "units; 0 = 18 m, or less where cells are so small that this would be too many")
      .at_least(0);
  t.add("ground-threshold", &o.ground_threshold,
        "with --surface ground or --vegetation drop: distance from the terrain up to which points of level "
        "ground are ground, "
        "scan units; 0 = 0.5 m")
      .at_least(0);
  t.add(
       "normals", &o.normals,
       "auto: given normals where at least half of the points have one, those of rows and columns (E57, PTX) "
       "where nine in ten have one; given: either kind; estimate")
      .one_of({"auto", "given", "estimate"});
  t.add("max-uncertain", &o.max_uncertain,
        "estimated normals: share of points whose side may stay in doubt, strewn ones (leaves, spray, "
        "edges) with them; above it exit code 6, from 0.01 on a warning; OUT.uncertain.png shows where; "
        "1 = never stop")
      .within(0, 1);
  t.add("viewpoint", &o.viewpoints,
        "estimated normals: position of a scanner, scan units; they point to it (repeatable)");
  t.add(
       "from", &o.from,
       "estimated normals: where the scanner was; above: aircraft, drones, what lies level shows up; around: "
       "an object; inside: rooms; auto: above where LAS pulses have several returns or next to nothing level "
       "lies below something else but crowns, else told by what points see of each other; the report says "
       "which")
      .one_of({"auto", "above", "around", "inside"});
  t.add("up", &o.up, "estimated normals: where the sky is, if not along z");
  add_columns(t, o.columns);
  t.add("crs", &o.crs,
        "coordinate system that the scans are in, EPSG:n, WKT or a file with it (.prj), whatever they say "
        "themselves; "
        "default: what they say")
      .shown_as("EPSG:n|FILE");
  t.add("project", &o.project,
        "projects the scans, in degrees or in other systems, before all else, so that options are in units "
        "of the "
        "result; auto: what is in degrees to its UTM zone; off: coordinates are taken as they are; default: "
        "scans in "
        "degrees are refused")
      .shown_as("auto|EPSG:n|off");
  t.add("classes", &o.classes,
        "LAS, LAZ: classes of points to keep, e.g. 2,6 for ground and buildings; default: all but noise (7, "
        "18)")
      .split();
  t.add(
       "returns", &o.returns,
       "LAS, LAZ: which returns of a pulse to keep; last or first sees one surface where a pulse met several")
      .one_of({"all", "first", "last"});
  t.add("bounds", &o.bounds,
        "box of points to keep, scan units: X0,Y0,Z0,X1,Y1,Z1; of COPC the rest is not read")
      .split()
      .shown_as("BOX");
  t.add("clip", &o.clip,
        "GeoJSON file of polygons in the coordinates of the scan: points outside them, as seen from above, "
        "are left out")
      .shown_as("FILE");
  t.add("clip-rings", &o.clip_rings, "the rings of --clip, filled in from its file").hidden();
  t.add("resolution-limit", &o.resolution_limit,
        "COPC: read the levels of its octree up to the first whose points lie so close, scan units; 0 = all")
      .at_least(0);
  t.add("thin", &o.thin,
        "scan units; one point is kept of every cube of this edge, the one nearest to its middle; 0 = all")
      .at_least(0);
  t.add("colour", &o.colour,
        "colours of the mesh; rgb: those of the points, none where all are black; intensity: grey, darkest "
        "and brightest 2 % cut off; "
        "class: of LAS, LAZ, each in its colour; height: blue to red; none")
      .one_of({"rgb", "intensity", "class", "height", "none"});
  t.add("max-brick-points", &o.max_brick_points, "points; a brick of 64^3 cells with more is thinned to this")
      .at_least(1);
  t.add("tolerance", &o.tolerance,
        "scan units; the mesh is decimated within this proven distance of itself; auto: a fifth of h, and no "
        "less than the noise of the points, the report says which; 0 = every face of the lattice")
      .at_least(0)
      .or_word("auto", kAutoTolerance);
  t.add("reference", &o.reference,
        "with a tolerance, surface: the mesh of full resolution, both ways; points: every point used must "
        "lie within it of the result too: decimation gets what their distance to the surface, measured "
        "first, leaves of it; where that is nothing, exit code 6 names the least tolerance that can do")
      .one_of({"surface", "points"});
  t.add("smooth", &o.smooth,
        "with a tolerance: smooth the mesh of full resolution before it is decimated, by at most half of the "
        "tolerance and the result is proven; implicit: a thin plate, as strong as the noise measured in the "
        "mesh asks for; denoise: fits, 7 times as long, sharp creases (both as of tessera smooth); auto: "
        "denoise from a noise of 0.02 edges on, else implicit")
      .one_of({"off", "implicit", "denoise", "auto"});
  add_colour_tolerance(t, o.colour_tolerance, "0 with --texture");
  add_texture(t, o.texture, "the points, with --tolerance,");
  add_normal_map(t, o.normal_map, "the mesh of full resolution");
  t.add("keep-raw", &o.keep_raw,
        "with a tolerance: write the mesh of full resolution too, `site.raw.ply` for `site.ply`");
  t.add("local-output", &o.local_output,
        "write positions relative to the global shift, as floats; the report has the shift");
  return t;
}

void ReconstructOptions::validate() {
  max_hole_edges();
  if (has_levels()) validate_levels(*this);
  if (surface != "all") validate_surface(*this);
  validate_ground(*this);
  PointFilter{*this};
  if (!clip.empty()) clip_rings = ClipPolygon::text_of_file(clip);
  if (!crs.empty()) crs = crs_text(crs, "--crs");
  if (!project.empty() && project != "auto" && project != "off") user_crs(project, "--project");
  if (!project.empty() && project != "off" && resolution_limit > 0.0)
    throw UsageError(
        "--resolution-limit with --project: octrees are in the units of their files; leave one of them out");
  if (vegetation == "top" && reference == "points")
    throw UsageError(
        "--vegetation top with --reference points: the surface model replaces points that were to be "
        "measured; "
        "leave one of them out");
  if (up == Double3{0, 0, 0}) throw UsageError("--up 0,0,0: has no direction");
  if (tolerance == 0.0 && (keep_raw || reference != "surface"))
    throw UsageError(
        std::string(keep_raw ? "--keep-raw" : "--reference") +
        ": means something with --tolerance only, without it the mesh of full resolution is the result");
  if (tolerance == 0.0 && colour_tolerance > 0.0)
    throw UsageError(
        "--colour-tolerance: means something with --tolerance only, without it every vertex has the colour "
        "of "
        "its points; leave it out");
  if (tolerance == 0.0 && has_texture())
    throw UsageError(
        "--texture: means something with --tolerance only, without it every vertex has the colour of its "
        "points; give --tolerance auto, or see tessera bake");
  validate_normal_map(normal_map, has_texture());
  if (has_texture() && colour == "none")
    throw UsageError("--texture with --colour none: there would be nothing on it; leave one of them out");
  if (tolerance == 0.0 && smooths())
    throw UsageError(
        "--smooth: means something with --tolerance only, which bounds how far vertices move; tessera smooth "
        "smooths a mesh without a bound");
}

ReconstructOptions reconstruct_options(const JobState& state) {
  return from_settings<ReconstructOptions>(state.settings);
}

}  // namespace tessera
