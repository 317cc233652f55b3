/// \file point_overlay.h
/// What the normals stage knows of every ordered point, kept beside the points so that they are never rewritten:
/// one packed file per point file, eight bytes a point in the same order, and the surfels that orientation links.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "kernels/points/orientation.h"
#include "octree/points.h"
#include "stream/files/packed_file.h"

namespace tessera {

/// Bit of PointOverlayRecord::supporters: the point is strewn, see find_volumetric().
inline constexpr std::uint16_t kVolumetric = 0x8000;
/// It lies among strewn ones, see find_among_volumetric().
inline constexpr std::uint16_t kAmongVolumetric = 0x4000;
inline constexpr std::uint16_t kSupporters = 0x3fff;

struct PointOverlayRecord {
  std::uint32_t normal = kNoNormal;
  std::uint16_t supporters = 0;    ///< neighbours that confirm the point, and kVolumetric, kAmongVolumetric
  std::uint16_t patch = kNoPatch;  ///< orientation patch inside the brick, kNoPatch or kGivenPatch
};
static_assert(sizeof(PointOverlayRecord) == 8);

/// One brick of an overlay file: five sections, one behind the other.
struct OverlayBrick {
  std::uint64_t key = 0;
  std::uint64_t offset = 0;  ///< of its records; then boundary surfels, facts, votes, coarse surfels
  std::array<std::uint64_t, 5> hash{};
  std::uint32_t points = 0;
  std::uint32_t boundary = 0;  ///< boundary surfels
  std::uint32_t patches = 0;
  std::uint32_t votes = 0;   ///< between its patches
  std::uint32_t coarse = 0;  ///< coarse surfels
  std::uint32_t unused = 0;

  enum Part { kRecords, kBoundary, kStats, kVotes, kCoarse };
  Section section(Part part) const;
};

class OverlayFileWriter {
 public:
  explicit OverlayFileWriter(const std::filesystem::path& path);
  /// Bricks in the order of the point file. `orientation` may have no patches.
  void brick(std::uint64_t key, std::span<const PointOverlayRecord> records,
             const BrickOrientation& orientation);
  std::uint64_t finish() { return file_.finish(table_); }

 private:
  PackedWriter file_;
  std::vector<OverlayBrick> table_;
};

/// What the orient stage says of a patch, bits.
enum PatchDecision : std::uint8_t {
  kPatchFlip = 1,       ///< its points' normals turn around
  kPatchUncertain = 2,  ///< the votes were split
};

/// What becomes of strewn points.
enum class VolumetricUse : std::uint32_t {
  kSurface,  ///< as if they lay on a surface
  kDrop,     ///< outliers
  kBodies,   ///< without normal: closed bodies around them, see kernels/field/bodies.h
  kTop,      ///< samples of the top surface stand in for them, see kernels/points/surface_model.h
};

const char* name_of(VolumetricUse volumetric);  ///< "surface", "dropped", "bodies", "top"

/// Decisions of the orient stage, the job's global summary.
struct OverlayDecisions {
  std::uint32_t min_supporters = 0;  ///< points with fewer are outliers
  VolumetricUse volumetric = VolumetricUse::kSurface;
  std::vector<std::uint8_t> patch;  ///< PatchDecision bits of all patches over all bricks, in brick order

  /// Of a point: as a surface unless it is strewn.
  VolumetricUse use_of(const PointOverlayRecord& point) const;
  /// Whether its normal shows a side: it is no outlier, and nothing stands in for it.
  bool shows_side(const PointOverlayRecord& point) const;

  void save(const std::filesystem::path& path) const;
  static OverlayDecisions load(const std::filesystem::path& path);
};

/// All overlay files of a job, in order of the point files. Thread-safe for reading.
class PointOverlay {
 public:
  /// Names inside the work directory.
  static constexpr const char* kFolder = "normals";
  static constexpr const char* kExtension = ".tsn";
  static constexpr const char* kDecisionsFile = "normals/decisions.bin";

  /// \throws InputError naming the file when one is damaged
  explicit PointOverlay(const std::vector<std::filesystem::path>& files);
  ~PointOverlay();
  /// The decided overlay of a work directory; null when the job needs none (given normals, nothing cleaned).
  static std::shared_ptr<const PointOverlay> open(const std::filesystem::path& work);

  std::span<const OverlayBrick> bricks() const;  ///< ascending key
  std::pair<std::size_t, std::size_t> file_range(std::size_t file) const;
  std::size_t file_count() const;
  std::int64_t find(std::uint64_t key) const;
  /// First patch of every brick over all bricks, and their total at the end.
  std::span<const std::uint64_t> first_patch() const;

  std::vector<Surfel> load_boundary(std::size_t brick) const;
  std::vector<PatchStats> load_stats(std::size_t brick) const;
  std::vector<PatchVote> load_votes(std::size_t brick) const;  ///< patches numbered inside the brick
  std::vector<CoarseSurfel> load_coarse(std::size_t brick) const;
  /// Records [first, first + count) of the brick, checked against its hash when all are asked for.
  std::vector<PointOverlayRecord> load_records(std::size_t brick, std::uint64_t first,
                                               std::uint64_t count) const;

  VolumetricUse volumetric() const;

  /// Starts fetching the records of a brick.
  void prefetch(std::uint64_t key) const;
  /// Sets normal and outlier flag of records [first, first + size) of a brick.
  /// \pre opened by open()
  void apply(std::uint64_t key, std::uint64_t first, std::span<PointRecord> records) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
