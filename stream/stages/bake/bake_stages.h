/// \file bake_stages.h
/// Textures for a mesh of any size from points or a finer mesh, block by block:
///
///   texture-points   coloured points near the mesh, sorted by cells (texture_points.h)
///   texture-scale    areas of patches, the width of a texel, how far points may lie off (bake_scale.h)
///   texture-charts   faces of blocks into charts in the plane (chart_files.h)
///   texture-pack     charts of all blocks onto pages (bake_pages.h)
///   texture-texels   colours of charts; the error of colours at the points
///   texture-pages    charts on pages, gaps between them filled; PNG
///   write            the mesh with its texture coordinates (textured_mesh_writer.h)
///
/// Blocks, charts and pages are functions of mesh, points and options alone.
#pragma once
#include <functional>
#include <memory>
#include <string>

#include "stream/formats/meshes/mesh_precision.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/job.h"
#include "stream/runtime/stage.h"
#include "stream/stages/bake/bake_colours.h"
#include "stream/stages/bake/bake_options.h"

namespace tessera {

/// Where mesh and colours come from.
struct BakeStores {
  std::function<MeshStore(const JobState&)> mesh;
  std::function<std::unique_ptr<BakeColours>(const JobState&)> colours;
  std::function<std::string(const JobState&)> comment;  ///< in the output
  /// Where positions of the output count from, if a proof before it counts on that; empty: the store's own.
  std::function<MeshPlacement(const JobState&)> placement = {};
};

// Names of files in the work directory.
inline constexpr const char* kBakePoints = "bake/points.ttp";
inline constexpr const char* kBakeScale = "bake/scale.json";
inline constexpr const char* kBakeCharts = "bake/charts/";
inline constexpr const char* kBakePages = "bake/pages.json";
inline constexpr const char* kBakeSpots = "bake/spots.bin";
inline constexpr const char* kBakeTexels = "bake/texels/";
inline constexpr const char* kBakeImages = "bake/images/";

/// All of them, in order.
std::vector<StageEntry> bake_stages(const BakeOptions& options, const BakeStores& stores);

/// `texture` of a report: what they say, by stage without "texture-"; nothing without them.
void summarise_texture(Json& report);
/// Files beside an output with textures. \param wanted  false: none
void add_texture_sidecars(JobDescription& job, const BakeOptions& options, bool wanted = true);

std::unique_ptr<Stage> make_bake_points_stage(const JobState& state, const BakeStores& stores);
std::unique_ptr<Stage> make_bake_scale_stage(const JobState& state, const BakeOptions& options,
                                             const BakeStores& stores);
std::unique_ptr<Stage> make_bake_charts_stage(const JobState& state, const BakeOptions& options,
                                              const BakeStores& stores);
std::unique_ptr<Stage> make_bake_pack_stage(const JobState& state, const BakeOptions& options);
std::unique_ptr<Stage> make_bake_texels_stage(const JobState& state, const BakeOptions& options,
                                              const BakeStores& stores);
std::unique_ptr<Stage> make_bake_pages_stage(const JobState& state, const BakeOptions& options);
std::unique_ptr<Stage> make_bake_write_stage(const JobState& state, const BakeOptions& options,
                                             const BakeStores& stores);

}  // namespace tessera
