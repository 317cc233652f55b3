#include "stream/points/reconstruct_options.h"

#include <algorithm>
#include <charconv>
#include <filesystem>

#include "octree/error.h"
#include "stream/files/read_file.h"
#include "stream/formats/points/projection.h"
#include "stream/points/clip_polygon.h"
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

namespace {

/// \throws UsageError for what levels cannot do
void validate_levels(const ReconstructOptions& o) {
  const auto refuse = [&](const std::string& option, const std::string& why) {
    throw UsageError("--levels " + std::to_string(o.levels) + " with " + option + ": " + why +
                     "; leave one of them out");
  };
  if (o.holes != "keep") refuse("--holes " + o.holes, "holes are closed in lattices of one cell size only");
  if (o.max_hole_edges() > 0)
    refuse("--max-hole " + o.max_hole, "holes are filled in lattices of one cell size only");
  if (o.border == "smooth")
    refuse("--border smooth", "borders are smoothed in lattices of one cell size only");
  if (o.vegetation == "keep")
    refuse("--vegetation keep", "strewn points get bodies in lattices of one cell size only");
  if (o.vegetation == "top")
    refuse("--vegetation top",
           "a surface model stands in for strewn points in lattices of one cell size only");
  if (o.reference == "points")
    refuse("--reference points", "points are measured in lattices of one cell size only");
}

/// \throws UsageError for what excludes one product of a scene from above
void validate_surface(const ReconstructOptions& o) {
  const auto refuse = [&](const std::string& option, const std::string& why) {
    throw UsageError("--surface " + o.surface + " with " + option + ": " + why + "; leave one of them out");
  };
  if (o.has_levels())
    refuse("--levels " + std::to_string(o.levels),
           "the surface model is made in lattices of one cell size only");
  if (o.from != "auto" && o.from != "above")
    refuse("--from " + o.from, "the surface model is of scenes seen from above");
  if (o.normals == "given") refuse("--normals given", "the surface model comes with estimated normals");
  if (o.vegetation != "auto" && o.vegetation != "top")
    refuse("--vegetation " + o.vegetation, "the surface model stands in for strewn points");
  if (o.reference == "points")
    refuse("--reference points", "the surface model replaces points that were to be measured");
}

}  // namespace

void ReconstructOptions::validate() {
  max_hole_edges();
  if (has_levels()) validate_levels(*this);
  if (surface != "all") validate_surface(*this);
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
  if (tolerance == 0.0 && smooths())
    throw UsageError(
        "--smooth: means something with --tolerance only, which bounds how far vertices move; tessera smooth "
        "smooths a mesh without a bound");
}

ReconstructOptions reconstruct_options(const JobState& state) {
  return from_settings<ReconstructOptions>(state.settings);
}

}  // namespace tessera
