/// \file reconstruct_options.h
/// What a reconstruction computes: every option changes the result and is part of the job's identity. A new one is a
/// field and a row here.
#pragma once
#include "kernels/decimate/auto_tolerance.h"
#include "kernels/holes/hole_filling.h"
#include "stream/runtime/option_table.h"
#include "stream/runtime/stage.h"

namespace tessera {

struct ReconstructOptions {
  double resolution = 0.0;
  std::uint64_t levels = 1;
  double radius = 0.0;  ///< where measured, at least 3 h
  std::string method = "emc";
  double feature_angle_deg = 25.0;
  double corner_angle_deg = 45.0;
  std::uint64_t min_component = 0;
  std::string max_hole = "auto";
  std::string holes = "keep";
  std::string border = "auto";
  std::string outliers = "auto";
  std::string vegetation = "auto";
  std::string surface = "all";
  std::string normals = "auto";
  std::vector<Double3> viewpoints;
  std::string from = "auto";
  std::optional<Double3> up;
  double max_uncertain = 0.5;
  std::uint64_t max_brick_points = 1u << 22;
  std::vector<std::string> columns;
  std::string crs;                   ///< a code or WKT: of a file, validate() takes its text
  std::string project;               ///< "", auto, off, a code
  std::vector<std::string> classes;  ///< numbers up to 255
  std::string returns = "all";
  std::vector<std::string> bounds;  ///< six numbers, or none
  std::string clip;                 ///< a file
  std::string clip_rings;           ///< what it holds, so that a job does not hang on the file
  double resolution_limit = 0.0;
  double thin = 0.0;
  std::string colour = "rgb";
  double tolerance = 0.0;
  std::string reference = "surface";
  std::string smooth = "off";
  bool keep_raw = false;
  bool local_output = false;

  bool has_levels() const { return levels > 1; }
  /// Whether a surface model may stand in for strewn points: not in columns of the finest of several lattices, and not where
  /// every point of a surface is to be measured, for it replaces some.
  bool models_top() const {
    return surface != "all" || vegetation == "top" ||
           (vegetation == "auto" && !has_levels() && reference != "points");
  }
  bool smooths_border() const {
    return border == "smooth" || (border == "auto" && tolerance == 0.0 && !has_levels());
  }
  /// Whether the result is not the mesh of full resolution.
  bool decimates() const { return tolerance != 0.0; }
  bool smooths() const { return smooth != "off"; }
  /// The N of max_hole, 0 for auto. \throws UsageError for what is neither
  std::uint32_t max_hole_edges() const;
  /// Also reads the files of --clip and --crs. \throws UsageError for options that mean nothing together; InputError
  void validate();
};

/// --columns, for everything that reads text scans.
inline void add_columns(OptionTable& table, std::vector<std::string>& columns) {
  table
      .add("columns", &columns,
           "names of the columns of text scans of any extension, e.g. skip,x,y,z,nx,ny,nz,r,g,b,i; default: "
           "the header "
           "line, else x,y,z")
      .split();
}

inline OptionTable option_table(ReconstructOptions& o) {
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
        "faces; smaller islands are dropped; 0 = measured, and islands that are mostly border go too, 1 = "
        "keep all");
  t.add("max-hole", &o.max_hole,
        "holes with a rim of at most N edges are filled by smooth patches that meet the rim tangentially, "
        "their faces marked (`synthetic` in PLY) and counted, but where they would cross the mesh; 0 = none; "
        "auto: in noisy scans what is narrower than the radius, slits too, from above 20 h with a rim of at "
        "most 60 edges, none with a tolerance")
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
        "but raw with a tolerance, where smooth costs a mesh of full resolution on disk")
      .one_of({"auto", "smooth", "raw"});
  t.add("outliers", &o.outliers,
        "auto: drop points that too few neighbours confirm, a share of the median, or fewer than three where "
        "that would take more than one in twenty; off: keep all")
      .one_of({"auto", "off"});
  t.add("vegetation", &o.vegetation,
        "estimated normals: points that are strewn through space instead of lying on a surface, as leaves, "
        "spray and passers-by; top: the smooth surface that one sees of them from above, down to the ground "
        "beside it; drop: no surface for them; keep: closed bodies around them; surface: as if they lay on "
        "one, which comes out torn; auto: top in scenes from above (drop with "
        "--levels or --reference points), else surface")
      .one_of({"auto", "top", "drop", "keep", "surface"});
  t.add("surface", &o.surface,
        "which surface of a scene from above is wanted; all: every one that was seen; top: one skin (a "
        "digital "
        "surface model), a height everywhere and walls at its steps, nothing below crowns, eaves and roofs; "
        "faces of it that nobody saw are marked (`synthetic` in PLY), e.g. reconstruct town.laz -o dsm.ply "
        "--surface top")
      .one_of({"all", "top"});
  t.add(
       "normals", &o.normals,
       "auto: given normals where at least half of the points have one, those of rows and columns (E57, PTX) "
       "where nine in ten have one; given: either kind; estimate")
      .one_of({"auto", "given", "estimate"});
  t.add("max-uncertain", &o.max_uncertain,
        "estimated normals: share of points whose side may stay in doubt; above it exit code 6, from 0.01 on "
        "a warning; OUT.uncertain.png shows where; 1 = never stop")
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
        "colours of the mesh; rgb: those of the points; intensity: grey, darkest and brightest 2 % cut off; "
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
  t.add("keep-raw", &o.keep_raw,
        "with a tolerance: write the mesh of full resolution too, `site.raw.ply` for `site.ply`");
  t.add("local-output", &o.local_output,
        "write positions relative to the global shift, as floats; the report has the shift");
  return t;
}

/// Of the job at hand. Not for loops: it reads text.
ReconstructOptions reconstruct_options(const JobState& state);

}  // namespace tessera
