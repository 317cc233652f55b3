/// \file render.h
/// `tessera render`: meshes and point clouds of any size to shaded PNG pictures.
///
/// Files are streamed. A mesh needs its vertices by index: they stay in memory as floats when they fit the
/// cap; otherwise the corners of all faces are gathered into one temporary file, in as many passes over
/// ranges of vertices as the cap asks for, and the picture is drawn from that file. Points are streamed
/// twice. What the cap changes is the way, not the picture (but for borders, see RenderOptions::borders).
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// A place that is ringed in the views that show it: a sample of the scene tells whether something lies before it.
struct RenderMark {
  Double3 at{};       ///< scan units
  std::string label;  ///< ASCII, beside the ring
};

struct RenderOptions {
  std::vector<std::string> inputs;   ///< drawn together in one picture: meshes, point files, or both
  std::vector<std::string> compare;  ///< each one more picture, same camera, to the right
  std::filesystem::path output;      ///< .png

  std::vector<std::string> views;  ///< names for parse_view, or custom; empty = iso, iso2, front, top
  int width = 1600;                ///< of the whole picture, pixels
  int height = 1200;
  int samples = 3;                     ///< per pixel and axis, 1..4
  double zoom = 1.0;                   ///< enlarges after the fit
  std::vector<double> focus;           ///< x, y, z, radius of what to look at, scan units; empty = everything
  std::optional<Double3> eye, target;  ///< view custom: from one to the other; both or none
  Double3 up = {0, 0, 1};              ///< which way is up in the views

  std::filesystem::path deviation;  ///< mesh to colour the distance to; empty = no such colours
  double tolerance = 0.0;           ///< scan units, end of the scale of colours; 0 = the 99th percentile
  bool with_sign = false;           ///< deviation in front of or behind the reference, not only how far

  /// A scan: its points farther from the meshes than missing_distance are drawn over them in magenta, of a sample of at most
  /// 524,288. Empty = none.
  std::filesystem::path missing;
  double missing_distance = 0.0;  ///< scan units; 0 = two spacings of the scan

  /// texture, vertex, clay, height or auto: texture where the mesh has pages of textures, else vertex where the file has
  /// colours, else clay; points that have neither colours nor normals by height. Pages are in memory one at a time; auto leaves
  /// out, and says so, those that the cap does not hold or that are in a form that is not read.
  std::string colour = "auto";
  bool pages =
      true;  ///< of textures are shown where colour says so; render() clears it where the cap does not hold them
  /// on, off or auto: border edges red, non-manifold edges magenta; auto leaves them out, and says so, where
  /// the edge table does not fit the cap in one pass, and the red ones where red means doubt.
  std::string borders = "auto";
  /// OUT.uncertain.ply of a reconstruction: meshes are red where the sides of its points were in doubt.
  std::filesystem::path uncertain;
  bool crossings = false;  ///< faces that cross, overlap or touch others in green, outlined: mesh_crossings.h
  bool synthetic = false;  ///< faces that close holes in blue over any colour, not over clay alone
  /// Faces seen from behind: show (orange), cut (left out), or auto: cut where the mesh is a room, one that has openings
  /// and looks inwards, so that its near walls do not hide it.
  std::string backs = "auto";
  /// plain, gloss or lines: Shade. What it shows is as smooth as the normals are, see `smooth`.
  std::string shade = "plain";
  bool smooth = false;     ///< interpolate normals of vertices instead of one normal per face
  bool wire = false;       ///< draw the edges of all faces
  double occlusion = 1.0;  ///< strength of ambient occlusion, 0..2
  double splat = 0.0;      ///< diameter of points, scan units; 0 = from their spacing
  bool captions = true;    ///< names, counts, scale bars
  bool titles = true;      ///< of captions: the line with names and counts
  std::vector<RenderMark> marks;

  std::vector<std::string> columns;  ///< names of text columns of point files
  std::uint64_t memory_bytes = 0;    ///< cap on peak RSS; 0 = none
  std::filesystem::path temp;        ///< folder of the temporary file; empty = beside the output
  /// Called every few hundred distances of `deviation` with the share of the area that is coloured; may throw, and render()
  /// then ends with that. May be empty.
  std::function<void(double share)> check_deviation;

  /// \throws UsageError naming the option and its range
  void validate() const;
};

struct RenderReport {
  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;
  std::uint64_t points = 0;
  std::uint64_t border_edges = 0;
  std::uint64_t non_manifold_edges = 0;
  std::uint64_t pages = 0;            ///< of textures that are shown
  std::uint64_t crossing_faces = 0;   ///< with RenderOptions::crossings
  std::uint64_t measured_points = 0;  ///< of RenderOptions::missing
  std::uint64_t missing_points = 0;   ///< of these, farther from the meshes than
  double missing_distance = 0.0;
  std::uint64_t temp_bytes = 0;  ///< of the corner file; 0 = vertices were in memory
  std::string renderer;
  std::vector<std::string> notices;  ///< what the user should know, one sentence each
};

/// Draws and writes options.output.
/// \throws UsageError; InputError; EmptyError when there is nothing to draw; ResourceError when the cap is too
///   small, naming the smallest that would do, when the disk is full, or when OSMesa is missing
RenderReport render(const RenderOptions& options);

}  // namespace tessera
