// The exceptions and relations that the gates need to know, each with its reason. A gate speaks of stale lines too.
#include "tests/house/house.h"

namespace tessera::house {

/// file -> the header that declares what it defines
const std::map<std::string, std::string>& parts_of_headers() {
  static const std::map<std::string, std::string> parts = {
      {"kernels/closing/closing_growth.cpp", "kernels/closing/closing.h"},
      {"kernels/decimate/decimator_sweep.cpp", "kernels/decimate/decimator.h"},
      {"kernels/remesh/remesher_angles.cpp", "kernels/remesh/remesher.h"},
      {"kernels/remesh/remesher_areas.cpp", "kernels/remesh/remesher.h"},
      {"kernels/remesh/remesher_checks.cpp", "kernels/remesh/remesher.h"},
      {"kernels/remesh/remesher_finish.cpp", "kernels/remesh/remesher.h"},
      {"kernels/remesh/remesher_needles.cpp", "kernels/remesh/remesher.h"},
      {"kernels/remesh/remesher_ratios.cpp", "kernels/remesh/remesher.h"},
      {"kernels/remesh/remesher_refine.cpp", "kernels/remesh/remesher.h"},
      {"kernels/remesh/remesher_relax.cpp", "kernels/remesh/remesher.h"},
      {"kernels/remesh/remesher_valence.cpp", "kernels/remesh/remesher.h"},
      {"kernels/scene/sensor_source.cpp", "kernels/scene/sample_source.h"},
      {"stream/check/mesh_check_report.cpp", "stream/check/mesh_check.h"},
      {"stream/check/mesh_compare_report.cpp", "stream/check/mesh_compare.h"},
      {"stream/check/mesh_crossings_report.cpp", "stream/check/mesh_crossings.h"},
      {"stream/formats/models/msh_mesh_reader.cpp", "stream/formats/meshes/mesh_reader_base.h"},
      {"stream/formats/models/msh_mesh_writer.cpp", "stream/formats/meshes/mesh_writer_base.h"},
      {"stream/formats/models/threemf_mesh_reader.cpp", "stream/formats/meshes/mesh_reader_base.h"},
      {"stream/formats/models/threemf_mesh_writer.cpp", "stream/formats/meshes/mesh_writer_base.h"},
      {"stream/formats/models/vtu_mesh_reader.cpp", "stream/formats/meshes/mesh_reader_base.h"},
      {"stream/formats/models/vtu_mesh_writer.cpp", "stream/formats/meshes/mesh_writer_base.h"},
      {"stream/formats/meshes/dxf_mesh_writer.cpp", "stream/formats/meshes/tin_writer.h"},
      {"stream/formats/meshes/glb_mesh_reader.cpp", "stream/formats/meshes/mesh_reader_base.h"},
      {"stream/formats/meshes/glb_mesh_writer.cpp", "stream/formats/meshes/mesh_writer_base.h"},
      {"stream/formats/meshes/landxml_mesh_writer.cpp", "stream/formats/meshes/tin_writer.h"},
      {"stream/formats/meshes/obj_mesh_reader.cpp", "stream/formats/meshes/mesh_reader_base.h"},
      {"stream/formats/meshes/obj_mesh_writer.cpp", "stream/formats/meshes/mesh_writer_base.h"},
      {"stream/formats/meshes/off_mesh_reader.cpp", "stream/formats/meshes/mesh_reader_base.h"},
      {"stream/formats/meshes/ply_mesh_reader.cpp", "stream/formats/meshes/mesh_reader_base.h"},
      {"stream/formats/meshes/ply_mesh_writer.cpp", "stream/formats/meshes/mesh_writer_base.h"},
      {"stream/formats/meshes/stl_mesh_reader.cpp", "stream/formats/meshes/mesh_reader_base.h"},
      {"stream/formats/meshes/stl_mesh_writer.cpp", "stream/formats/meshes/mesh_writer_base.h"},
      {"stream/formats/points/inputs.cpp", "stream/formats/points/point_source.h"},
      {"stream/import/import_corners_stage.cpp", "stream/import/import_stages.h"},
      {"stream/import/import_repair_stage.cpp", "stream/import/import_stages.h"},
      {"stream/import/import_tiles_stage.cpp", "stream/import/import_stages.h"},
      {"stream/import/import_vertices_stage.cpp", "stream/import/import_stages.h"},
      {"stream/render/render_deviation.cpp", "stream/render/render_scene.h"},
      {"stream/render/render_mesh.cpp", "stream/render/render_scene.h"},
      {"stream/render/render_missing.cpp", "stream/render/render_scene.h"},
      {"stream/render/render_points.cpp", "stream/render/render_scene.h"},
      {"stream/stages/bake/bake_charts_stage.cpp", "stream/stages/bake/bake_stages.h"},
      {"stream/stages/bake/bake_pack_stage.cpp", "stream/stages/bake/bake_pages.h"},
      {"stream/stages/bake/bake_pages_stage.cpp", "stream/stages/bake/bake_stages.h"},
      {"stream/stages/bake/bake_points_stage.cpp", "stream/stages/bake/bake_stages.h"},
      {"stream/stages/bake/bake_scale_stage.cpp", "stream/stages/bake/bake_scale.h"},
      {"stream/stages/bake/bake_texels_stage.cpp", "stream/stages/bake/texel_files.h"},
      {"stream/stages/bake/bake_write_stage.cpp", "stream/stages/bake/bake_stages.h"},
      {"stream/formats/meshes/textured_glb.cpp", "stream/formats/meshes/textured_mesh_writer.h"},
      {"stream/stages/merge/merge_cover_stage.cpp", "stream/stages/merge/merge_stages.h"},
      {"stream/stages/merge/merge_joints_stage.cpp", "stream/stages/merge/merge_stages.h"},
      {"stream/stages/merge/merge_meshes.cpp", "stream/stages/merge/merge_stages.h"},
      {"stream/stages/merge/merge_scale_stage.cpp", "stream/stages/merge/merge_stages.h"},
      {"stream/stages/merge/merge_strip_stage.cpp", "stream/stages/merge/merge_stages.h"},
      {"stream/stages/merge/merge_zip_stage.cpp", "stream/stages/merge/merge_stages.h"},
      {"stream/stages/coverage/coverage_forecast.cpp", "stream/stages/coverage/coverage_stage.h"},
      {"stream/stages/reconstruct/forecast_job.cpp", "stream/stages/reconstruct/forecast.h"},
      {"stream/stages/resample/bends_stage.cpp", "stream/stages/resample/resample_stages.h"},
      {"stream/stages/resample/blends_stage.cpp", "stream/stages/resample/resample_stages.h"},
      {"stream/stages/resample/resample_apply_stage.cpp", "stream/stages/resample/resample_stages.h"},
      {"stream/stages/resample/resample_scale_stage.cpp", "stream/stages/resample/resample_stages.h"},
      {"stream/stages/crossings/crossing_mend_stage.cpp", "stream/stages/crossings/crossing_parts.h"},
      {"stream/stages/crossings/crossing_search_stage.cpp", "stream/stages/crossings/crossing_parts.h"},
      {"stream/stages/crossings/self_union_stage.cpp", "stream/stages/crossings/crossing_parts.h"},
      {"stream/stages/deform/base_stage.cpp", "stream/stages/deform/deform_stages.h"},
      {"stream/stages/deform/basis_stage.cpp", "stream/stages/deform/deform_stages.h"},
      {"stream/stages/deform/deform_write_stage.cpp", "stream/stages/deform/deform_stages.h"},
      {"stream/stages/deform/shape_stage.cpp", "stream/stages/deform/deform_stages.h"},
      {"stream/stages/deform/onto_cells_stage.cpp", "stream/stages/deform/onto_stages.h"},
      {"stream/stages/deform/onto_deviation_stage.cpp", "stream/stages/deform/onto_stages.h"},
      {"stream/stages/deform/onto_fit_stage.cpp", "stream/stages/deform/onto_stages.h"},
      {"stream/stages/deform/onto_write_stage.cpp", "stream/stages/deform/onto_stages.h"},
      {"stream/stages/scan/links_stage.cpp", "stream/stages/scan/normals_stage.h"},
      {"stream/stages/scan/orient_stage.cpp", "stream/stages/scan/normals_stage.h"},
      {"stream/stages/scan/ground_cells_stage.cpp", "stream/stages/scan/ground_stages.h"},
      {"stream/stages/scan/ground_stage.cpp", "stream/stages/scan/ground_stages.h"},
      {"stream/stages/scan/top_points_stage.cpp", "stream/stages/scan/top_stage.h"},
      {"stream/stages/smooth/coarse_stages.cpp", "stream/stages/smooth/smooth_stages.h"},
      {"stream/stages/smooth/noise_stage.cpp", "stream/stages/smooth/smooth_before.h"},
      {"stream/stages/smooth/range_stage.cpp", "stream/stages/smooth/smooth_stages.h"},
      {"stream/stages/smooth/smooth_stage.cpp", "stream/stages/smooth/smooth_stages.h"},
      {"stream/stages/levels/level_border_stage.cpp", "stream/stages/levels/level_ends.h"},
      {"stream/stages/levels/level_ends_stage.cpp", "stream/stages/levels/level_ends.h"},
      {"stream/stages/levels/level_holes_stage.cpp", "stream/stages/levels/level_ends.h"},
      {"stream/stages/levels/level_loops_stage.cpp", "stream/stages/levels/level_ends.h"},
      {"stream/stages/surface/close_stage.cpp", "stream/stages/surface/closing_stages.h"},
      {"stream/stages/surface/multipole_stage.cpp", "stream/stages/surface/closing_stages.h"},
      {"stream/stages/surface/rims_stage.cpp", "stream/stages/surface/closing_stages.h"},
      {"stream/stages/surface/prune_stage.cpp", "stream/stages/surface/islands_stage.h"},
      {"stream/stages/surface/tiling.cpp", "stream/stages/surface/surface_stage.h"},
      {"stream/stages/solid/csg_scene.cpp", "stream/stages/solid/csg_job.h"},
      {"stream/stages/solid/inside_stage.cpp", "stream/stages/solid/solid_stages.h"},
      {"stream/stages/solid/lattice_stage.cpp", "stream/stages/solid/solid_stages.h"},
      {"stream/stages/solid/lines_stage.cpp", "stream/stages/solid/solid_stages.h"},
      {"stream/stages/solid/far_stages.cpp", "stream/stages/solid/solid_stages.h"},
      {"stream/stages/solid/field_stages.cpp", "stream/stages/solid/solid_stages.h"},
      {"stream/stages/solid/offset_stage.cpp", "stream/stages/solid/solid_stages.h"},
      {"stream/stages/solid/placed_shape.cpp", "stream/stages/solid/solid_stages.h"},
      {"stream/stages/solid/solid_mesh.cpp", "stream/stages/solid/solid_stages.h"},
      {"stream/stages/solid/solid_surface_stage.cpp", "stream/stages/solid/solid_stages.h"},
      {"stream/volume/mesh_volume_report.cpp", "stream/volume/mesh_volume.h"},
      {"tools/queue/cancel_command.cpp", "tools/commands.h"},
      {"tools/survey/bake_command.cpp", "tools/commands.h"},
      {"tools/check_command.cpp", "tools/commands.h"},
      {"tools/convert_command.cpp", "tools/commands.h"},
      {"tools/csg_command.cpp", "tools/commands.h"},
      {"tools/decimate_command.cpp", "tools/commands.h"},
      {"tools/deform_command.cpp", "tools/commands.h"},
      {"tools/doctor_command.cpp", "tools/commands.h"},
      {"tools/field_command.cpp", "tools/commands.h"},
      {"tools/info_command.cpp", "tools/commands.h"},
      {"tools/merge_command.cpp", "tools/commands.h"},
      {"tools/parameterize_command.cpp", "tools/commands.h"},
      {"tools/plan_command.cpp", "tools/commands.h"},
      {"tools/reconstruct_command.cpp", "tools/commands.h"},
      {"tools/remesh_command.cpp", "tools/commands.h"},
      {"tools/render_command.cpp", "tools/commands.h"},
      {"tools/report_command.cpp", "tools/commands.h"},
      {"tools/resample_command.cpp", "tools/commands.h"},
      {"tools/resurface_command.cpp", "tools/commands.h"},
      {"tools/smooth_command.cpp", "tools/commands.h"},
      {"tools/survey/change_command.cpp", "tools/commands.h"},
      {"tools/survey/classify_command.cpp", "tools/commands.h"},
      {"tools/survey/contours_command.cpp", "tools/commands.h"},
      {"tools/survey/deviate_command.cpp", "tools/commands.h"},
      {"tools/survey/raster_command.cpp", "tools/commands.h"},
      {"tools/survey/section_command.cpp", "tools/commands.h"},
      {"tools/survey/volume_command.cpp", "tools/commands.h"},
      {"tools/queue/status_command.cpp", "tools/commands.h"},
      {"tools/queue/submit_command.cpp", "tools/commands.h"},
      {"tools/queue/watch_command.cpp", "tools/commands.h"},
      {"tools/synth_command.cpp", "tools/commands.h"},
      {"tools/task_command.cpp", "tools/commands.h"},
      {"tools/view_command.cpp", "tools/commands.h"},
      {"tools/tiles_command.cpp", "tools/commands.h"},
  };
  return parts;
}

/// stem -> the test that runs it, where it has none of its own
const std::map<std::string, std::string>& covering_tests() {
  static const std::map<std::string, std::string> covered = [] {
    std::map<std::string, std::string> all;
    const auto by = [&](const std::string& test, const std::string& folder,
                        const std::vector<std::string>& stems) {
      for (const std::string& stem : stems) all[folder + "/" + stem] = "tests/" + test + "_test.cpp";
    };
    by("tools/bad_input", "octree", {"error"});  // every kind of error is an exit code there
    by("octree/points", "octree", {"lattice", "morton"});
    by("octree/winding_number", "octree", {"leaf_queries", "multipole"});
    by("kernels/edit/edit_basis", "octree", {"placement"});
    by("kernels/edit/edit_basis", "kernels/edit", {"vertex_rotations"});
    by("kernels/edit/displacement_volumes", "kernels/edit", {"base_volume", "coarse_layer", "layer_levels"});
    by("kernels/scene/scene", "octree", {"portable_math"});

    by("solvers/linear_solver", "solvers",
       {"conjugate_gradients", "multigrid_cycle", "multigrid_interpolation", "multigrid_levels",
        "multigrid_solver", "rcm_ordering", "sparse_matrix"});
    by("solvers/multifrontal_cholesky", "solvers",
       {"dense_front", "factor_store", "front_sweeps", "multifrontal_solver"});
    by("solvers/front_tree", "solvers", {"fill_ordering", "supernodes"});
    by("kernels/holes/hole_filling", "solvers", {"envelope_cholesky"});
    by("solvers/laplacian", "solvers", {"intrinsic_delaunay"});

    by("kernels/blends/resample_blend", "kernels/blends", {"blend_grid", "fishbone_fit", "normal_jumps"});
    by("kernels/boolean/exact_boolean", "kernels/boolean",
       {"cut_face", "exact_winding", "mesh_cuts", "settle_rounding"});
    by("kernels/boolean/self_union", "kernels/boolean", {"self_cuts", "solid_fans"});
    by("kernels/certify/certificate_pair", "kernels/certify",
       {"convex_piece", "overlay_outline", "overlay_proof"});
    by("kernels/closing/closing", "kernels/closing", {"closing_field", "closing_growth"});
    by("kernels/decimate/crossing_guard", "kernels/decimate", {"sheet_marks"});
    by("kernels/decimate/decimate", "kernels/decimate",
       {"collapse_deviation", "decimator", "decimator_sweep", "feature_edges", "quadric"});
    by("kernels/extract/extended_marching_cubes", "kernels/extract",
       {"brick_band", "cell_loops", "feature_sample", "loop_triangulation", "tangent_planes"});
    by("kernels/solid/mesh_creases", "kernels/extract", {"crease_cells", "crease_lines"});
    by("kernels/extract/level_cells", "kernels/extract", {"brick_levels", "level_faces"});
    by("kernels/field/band_vdb", "kernels/field", {"band_leaf", "vdb_leaf"});
    by("kernels/field/field", "kernels/field",
       {"band", "bodies", "border", "coarse_normals", "crease_evidence", "directed_field", "edge_roots",
        "node_fit", "node_sums", "point_leaves", "root_colour", "row_samples", "sample_clusters",
        "sample_list", "sheets"});
    by("kernels/field/coarser_fits", "kernels/field", {"sparse_nodes"});
    by("kernels/solid/offset_field", "kernels/field", {"sampled_field"});
    by("kernels/holes/hole_filling", "kernels/holes", {"hole_mesh", "hole_triangulation"});
    by("kernels/maps/parameterize", "kernels/maps", {"disk_topology"});
    by("kernels/smooth/denoise", "kernels/mesh", {"face_corners"});
    by("kernels/mesh/block_components", "kernels/mesh", {"face_components"});
    by("kernels/mesh/face_contact", "kernels/mesh", {"face_planes", "orientation_sign"});
    by("stream/meshes/patch_store", "kernels/mesh", {"patch", "patch_components"});
    by("stream/meshes/mesh_store", "kernels/mesh", {"mesh_block", "mesh_block_ops"});
    by("tools/render", "kernels/picture",
       {"caption", "gl_functions", "picture", "picture_shaders", "rasterizer"});
    by("kernels/points/orientation", "kernels/points", {"sign_solver"});
    by("kernels/remesh/remesh", "kernels/remesh",
       {"reference_surface", "remesher", "remesher_angles", "remesher_areas", "remesher_finish",
        "remesher_relax", "remesher_valence"});
    by("kernels/scene/scene", "kernels/scene",
       {"fractal_noise", "implicit_scene", "sample_source", "scene_models", "scene_smooth", "scene_solid",
        "sensor_source", "solid", "surface_sampler"});
    by("kernels/smooth/coarse_level", "kernels/smooth", {"coarse_system"});
    by("kernels/smooth/smooth", "kernels/smooth", {"normal_filter", "polynomial_filter", "surface_rows"});
    by("kernels/smooth/denoise", "kernels/smooth", {"star_sides", "surface_window", "window_fit"});

    by("kernels/solid/offset_field", "kernels/solid", {"row_signs"});
    by("kernels/solid/solid_field", "kernels/solid",
       {"lattice_crossings", "line_windings", "mesh_solid", "solid_tree"});
    by("kernels/decimate/vertex_clustering", "kernels/decimate", {"cluster_vertex"});
    by("kernels/solid/border_winding", "kernels/solid",
       {"border_leaf", "border_points", "border_region", "ribbon_angles"});
    by("kernels/mesh/signed_distance", "kernels/mesh", {"triangle_foot"});
    by("tools/merge", "kernels/merge", {"blend_field", "merge_sheet"});
    by("tools/merge", "stream/stages/merge",
       {"merge_cover_stage", "merge_job", "merge_joints_stage", "merge_meshes", "merge_scale_stage",
        "merge_stages", "merge_strip_stage", "merge_zip_stage"});
    by("tools/solids", "kernels/solid", {"solid_shape"});
    by("tools/solids", "stream/stages/solid",
       {"csg_job", "csg_scene", "distance_tiles", "inside_stage", "lattice_stage", "lines_stage",
        "offset_stage", "placed_shape", "resurface_job", "solid_mesh", "solid_stages", "solid_surface_stage",
        "solid_tiles"});

    by("tools/exact_csg", "stream/stages/solid", {"exact_csg", "exact_tree"});
    by("tools/field", "stream/stages/solid", {"far_stages", "field_job", "field_stages", "surface_distance"});
    by("stream/import/mesh_import", "stream/import",
       {"import_corners_stage", "import_repair_stage", "import_tiles_stage", "import_vertices_stage"});
    by("stream/stages/coverage/coverage", "stream/stages/coverage",
       {"coverage_stage", "face_source", "missing_picture", "seen_stages"});
    by("tools/decimate", "stream/meshes", {"store_write_stage"});
    by("tools/decimate", "stream/stages/decimate",
       {"certify_stage", "decimate_job", "pass_blocks", "round_before", "simplify_stage",
        "unsettled_region"});
    by("tools/decimate", "stream/runtime", {"serial_stage"});
    by("stream/runtime/option_table", "stream/stages/decimate", {"simplify_options"});
    by("tools/onto", "stream/stages/deform",
       {"onto_cells_stage", "onto_deviation_stage", "onto_files", "onto_fit_stage", "onto_stages",
        "onto_write_stage"});
    by("tools/deform", "stream/stages/deform",
       {"base_stage", "basis_stage", "deform_files", "deform_job", "deform_needs", "deform_options",
        "deform_crossings", "deform_output", "deform_stages", "deform_write_stage", "edit_roles",
        "edit_script", "pose_base", "shape_stage", "vertex_batches"});
    by("stream/runtime/option_table", "stream/stages", {"jobs"});
    by("tools/remesh", "stream/stages/remesh",
       {"quality_report", "remesh_job", "remesh_options", "remesh_region", "remesh_stage", "remesh_verdict",
        "sizing_stage"});
    by("tools/resample", "stream/stages/resample",
       {"bends_stage", "blend_file", "blends_stage", "resample_apply_stage", "resample_files", "resample_job",
        "resample_options", "resample_scale_stage", "resample_stages"});
    by("stream/stages/reconstruct/forecast", "stream/stages/reconstruct", {"forecast_job"});
    by("stream/stages/reconstruct/forecast", "stream/stages/coverage", {"coverage_forecast"});
    by("stream/stages/reconstruct/forecast", "stream/stages/plan",
       {"forecast_rates", "planned_patches", "planned_scan", "stage_forecast", "tile"});
    by("tools/reconstruct", "stream/stages/reconstruct",
       {"coverage_check", "forecast_stage", "reconstruct_job"});
    by("tools/level_ends", "stream/stages/levels",
       {"level_border_stage", "level_ends", "level_ends_stage", "level_holes_stage", "level_loops_stage",
        "moved_patches"});
    by("tools/levels", "stream/stages/surface",
       {"level_fields", "level_files", "level_surface_stage", "levels_stage"});
    by("tools/decimate", "stream/stages/reconstruct", {"weld_stages"});
    by("tools/site", "stream/stages/reconstruct", {"site_after"});
    by("tools/site", "stream/stages/tiles", {"tiles_needs"});
    by("stream/stages/scan/distribute", "stream/stages/scan", {"distribute_stage"});
    by("stream/stages/scan/order", "stream/stages/scan", {"order_stage"});
    by("tools/caps", "stream/stages/decimate", {"simplify_needs"});
    by("tools/caps", "stream/stages/merge", {"merge_needs"});
    by("tools/caps", "stream/stages/resample", {"resample_needs"});
    by("tools/caps", "stream/stages/solid", {"solid_needs"});
    by("stream/stages/scan/survey", "stream/stages/scan", {"probe_stage", "survey_stage"});
    by("stream/stages/scan/thin", "stream/stages/scan", {"thin_stage"});
    by("stream/stages/scan/unpack", "stream/stages/scan", {"unpack_stage"});
    by("tools/orient", "stream/stages/scan",
       {"links_stage", "normals_mode", "normals_stage", "orient_anchors", "orient_groups", "orient_needs",
        "orient_sight", "orient_solution", "orient_stage", "orient_viewers", "uncertain_picture"});
    by("tools/top_surface_model", "stream/stages/scan", {"brick_columns", "top_points_stage", "top_stage"});
    by("tools/ground_surface", "stream/stages/scan", {"ground_cells_stage", "ground_stage", "ground_stages"});
    by("tools/smooth_before", "stream/stages/smooth", {"noise_stage", "smooth_before", "smooth_needs"});
    by("tools/smooth_command", "stream/stages/smooth",
       {"coarse_files", "coarse_stages", "patch_range", "range_stage", "smooth_job", "smooth_plan",
        "smooth_stage", "smooth_stages", "smooth_tiles"});
    by("kernels/holes/crossing_mend", "kernels/holes", {"border_retreat"});
    by("tools/mend_crossings", "stream/stages/crossings",
       {"crossing_mend_stage", "crossing_pairs", "crossing_parts", "crossing_search_stage", "crossing_stages",
        "mended_mesh", "self_union_stage"});
    by("tools/mend_crossings", "stream/stages/decimate", {"result_mend"});
    by("tools/untangle", "stream/stages/smooth",
       {"contact_regions", "tangled_tile", "untangle_stages", "vertices_back"});
    by("tools/reconstruct_tolerance", "stream/stages/surface",
       {"first_pass", "islands_stage", "samples_stage"});
    by("stream/stages/surface/surface", "stream/stages/surface",
       {"dense_bricks", "close_stage", "closing_stages", "hole_limit", "holes_stage", "loops_stage",
        "multipole_stage", "output_frame", "rims_stage", "surface_stage", "tiling", "write_stage"});
    by("tools/top_surface_model", "stream/stages/surface", {"hole_rounding", "loop_batches"});
    by("tools/uncross", "stream/stages/surface", {"prune_stage", "sides_stage", "uncross_holes_stage"});
    by("tools/top_surface_model", "stream/stages/weld", {"blunt_reader", "blunt_stage"});
    by("tools/uncross", "stream/stages/weld",
       {"border_moves", "border_stage", "border_strip", "mesh_around", "near_faces", "numbered_patches",
        "patch_positions", "uncross_stage", "weld_stage", "written_positions"});
    by("tools/bake", "stream/stages/bake",
       {"bake_charts_stage", "bake_colours", "bake_job", "bake_needs", "bake_options", "bake_pack_stage",
        "bake_pages", "bake_scale", "bake_pages_stage", "bake_points_stage", "bake_scale_stage",
        "bake_stages", "bake_texels_stage", "bake_write_stage", "chart_files", "texel_files",
        "texture_colours", "texture_points", "full_page"});
    by("tools/texture_jobs", "stream/stages/reconstruct", {"scan_colours"});
    by("tools/tiles", "stream/stages/tiles",
       {"cluster_stage", "colour_stage", "folder_stage", "grid_stage", "level_stage", "tile_levels",
        "tiles_job", "tiles_options", "tiles_stage", "tileset_stage"});
    by("tools/tile_textures", "stream/stages/tiles", {"tile_points_stage", "tile_texture"});
    return all;
  }();
  return covered;
}

/// "path word" -> why it may stand there
const std::map<std::string, std::string>& allowed_words() {
  static const std::string loader =
      "a picture needs OpenGL, nothing else does: linked, Mesa and LLVM would cost every command 100 MB and "
      "a start";
  static const std::map<std::string, std::string> allowed = {
      {"kernels/picture/rasterizer.cpp <dlfcn.h>", loader},
      {"kernels/picture/rasterizer.cpp dlopen(", loader},
      {"kernels/edit/edit_basis.cpp <cstdio>", "snprintf"},
      {"solvers/multigrid_solver.cpp <cstdio>", "snprintf"},
  };
  return allowed;
}

/// "path word": headers that may hand on a heavy one
const std::set<std::string>& allowed_heavy_headers() {
  static const std::set<std::string> allowed = {
      "kernels/field/band_leaf.h <openvdb/",  // its version alone, to name the leaf
      "kernels/field/vdb_leaf.h <openvdb/",   // its subject: for the .cpp files that touch leaves
  };
  return allowed;
}

const std::set<std::string>& linked_with_readers() {
  static const std::set<std::string> stems = {"stream/commands/break_lines", "stream/commands/convert_mesh",
                                              "stream/commands/face_groups", "stream/stages/tiles/tile_mesh"};
  return stems;
}

const std::set<std::string>& apart_from_readers() {
  static const std::set<std::string> stems = {"tests/stream/formats/points/packed_points_test"};
  return stems;
}

}  // namespace tessera::house
