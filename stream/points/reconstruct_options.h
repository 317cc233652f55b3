/// \file reconstruct_options.h
/// What a reconstruction computes: every option changes the result and is part of the job's identity. A new one is a
/// field and a row here.
#pragma once
#include "kernels/decimate/auto_tolerance.h"
#include "kernels/holes/hole_filling.h"
#include "stream/runtime/option_table.h"
#include "stream/runtime/stage.h"

namespace tessera {

struct Plan;

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
  double ground_slope = 0.15;
  double ground_window = 0.0;     ///< 18 m
  double ground_threshold = 0.0;  ///< 0.5 m
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
  double texture = 0.0;     ///< texture_option.h: width of a texel, kAutoTexture; 0 = colours of vertices
  bool normal_map = false;  ///< beside it
  double colour_tolerance = kAutoColourTolerance;  ///< levels; DecimateOptions
  bool keep_raw = false;
  bool local_output = false;

  bool has_levels() const { return levels > 1; }
  /// Whether a surface model may stand in for strewn points: with levels where it is asked for, and not where every point of a
  /// surface is to be measured, for it replaces some.
  bool models_top() const {
    return surface != "all" || vegetation == "top" ||
           ((vegetation == "auto" || vegetation == "drop") && !has_levels() && reference != "points");
  }
  /// Whether the ground goes on below strewn points that are left out, in scenes from above.
  bool clears_ground() const { return surface == "all" && vegetation == "drop" && models_top(); }
  bool finds_ground() const { return surface == "ground" || clears_ground(); }
  /// Of noisy scans.
  bool smooths_border() const { return border == "smooth" || (border == "auto" && !has_levels()); }
  /// Whether the result is not the mesh of full resolution.
  bool decimates() const { return tolerance != 0.0; }
  bool smooths() const { return smooth != "off"; }
  bool has_texture() const { return texture != 0.0; }
  /// Whether the surface stage leaves stores that passes read, instead of patches that are welded: the job has levels, or it has
  /// a tolerance, no hole waits to be filled and no border to be smoothed, as in scans with more noise than kExactNoise,
  /// and what the points leave of the tolerance need not be known before.
  bool fuses_stores(const Plan& plan) const;
  /// Whether there are scans of which it does, and scans of which it does not.
  bool may_fuse_stores() const;
  bool may_weld() const;
  /// Whether the first pass of decimation runs there, too, where it does: the mesh need not be smoothed before, and is of one
  /// cell size.
  bool fuses_first_pass() const;
  /// The N of max_hole, 0 for auto. \throws UsageError for what is neither
  std::uint32_t max_hole_edges() const;
  /// Also reads the files of --clip and --crs. \throws UsageError for options that mean nothing together; InputError
  void validate();
};

/// --columns, for everything that reads text scans.
void add_columns(OptionTable& table, std::vector<std::string>& columns);

OptionTable option_table(ReconstructOptions& options);

/// Of the job at hand. Not for loops: it reads text.
ReconstructOptions reconstruct_options(const JobState& state);

}  // namespace tessera
