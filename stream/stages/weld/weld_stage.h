/// \file weld_stage.h
/// Pass "weld": joins the patches of all bricks by vertex key, finds islands across bricks, and gives every kept
/// element its place in the output by prefix sums. No distance tolerance: a name that has no owner is a bug.
#pragma once
#include "stream/meshes/patch_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// A foreign vertex of a patch, found: patch index and own vertex there.
struct VertexSlot {
  std::uint32_t patch = 0;
  std::uint32_t vertex = 0;
};

/// What welding knows of one patch.
struct PatchSpan {
  std::uint64_t first_vertex = 0;     ///< output index of its first kept vertex
  std::uint64_t first_component = 0;  ///< into Numbering::kept
  std::uint64_t foreign_offset = 0;   ///< of its VertexSlots among those of its patch file, bytes
  std::uint32_t kept_vertices = 0;
  std::uint32_t kept_faces = 0;
};

/// The global summary that writing needs: 32 bytes a patch, one byte a patch component.
struct Numbering {
  std::vector<PatchSpan> patches;
  std::vector<std::uint8_t> kept;  ///< per patch component
  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;

  void save(const std::filesystem::path& path) const;
  static Numbering load(const std::filesystem::path& path);
};

inline constexpr const char* kNumberingFile = "weld/numbering.bin";  ///< in the work directory

/// Patch files of the job, in order.
PatchStore open_patches(const std::filesystem::path& work);
/// Weld file of one patch file, and its section of all VertexSlots.
std::string weld_file_name(std::size_t file);
struct WeldFile {
  explicit WeldFile(const std::filesystem::path& path);
  PackedFile file;
  Section slots, links, sizes;
};

/// Islands below this many faces go when --min-component is auto: a five-hundredth of all faces, within [50, 1000].
std::uint64_t automatic_min_component(std::uint64_t faces);

struct IslandShape {
  std::uint64_t faces = 0;
  std::uint64_t border = 0;  ///< edges or vertices at which the surface ends
  std::uint64_t folded = 0;  ///< vertices at which it folds (count_folded)
};
/// With --min-component auto islands go as well that are mostly border and no smooth surface: leaves, spray, rims of passing
/// people. \param size, largest  of this island and of the largest one, which stays: faces of one size
bool is_shred(const IslandShape& island, std::uint64_t size, std::uint64_t largest);
/// Whether an island below the limit is a piece of surface that was seen beyond doubt, as of a facade behind a tree: no
/// crumb, smooth all over, and no strip.
bool is_piece(const IslandShape& island);
/// What --min-component auto says of an island. \param limit  automatic_min_component \param size, largest  as above
bool island_stays(const IslandShape& island, std::uint64_t limit, std::uint64_t size, std::uint64_t largest);

/// What a task over these patches takes at most.
std::uint64_t weld_task_bytes(std::span<const PatchEntry> patches);
/// What the end takes at most. \param components  of all patches
std::uint64_t weld_finish_bytes(std::uint64_t patches, std::uint64_t components);

/// What a weld of patches that are not of points goes by.
struct WeldRules {
  std::uint64_t min_component = 0;  ///< faces; 0 = automatic, and shreds go
  std::string nothing;              ///< what to say where there is no face at all
  std::uint64_t automatic = 0;      ///< if not 0: what 0 above means; then shreds and the largest island stay
  std::string reason = {};          ///< why all islands are small, if that is known
};
/// What is said when no island has as many faces as it must. \param reason  why, or empty
std::string too_small(std::uint64_t limit, const std::string& reason);
/// What is said when there is no face at all.
std::string no_surface(const std::string& reason);
std::unique_ptr<Stage> make_weld_stage(const JobState& state);
StageForecast forecast_weld(const PlannedScan& scan);
std::unique_ptr<Stage> make_weld_stage_by(const JobState& state, const WeldRules& rules);

}  // namespace tessera
