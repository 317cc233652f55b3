/// \file plan.h
/// What the survey decided: the lattice, what the points carry, and the buckets they are sorted in.
/// Lattice, radii, attributes, sensors, fates and bricks are functions of the points and the options that change the
/// result alone: not of the order, the files, the slices, the threads or the cap. Buckets, forecasts and warnings are
/// about execution and may follow the cap; no byte of a result depends on them.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "octree/lattice.h"
#include "stream/files/json.h"

namespace tessera {

/// Where every point that was read went; read = kept + other_class + other_return + outside +
/// thinned + non_finite + absurd.
struct PointDispositions {
  std::uint64_t read = 0;          ///< handed over by the readers
  std::uint64_t withheld = 0;      ///< flagged withheld by the format, never handed over
  std::uint64_t empty = 0;         ///< placeholders for "no return", never handed over
  std::uint64_t missing = 0;       ///< declared by a header, not in the file
  std::uint64_t other_class = 0;   ///< not of the --classes wanted, left out
  std::uint64_t other_return = 0;  ///< else not of the --returns wanted, left out
  std::uint64_t outside = 0;       ///< else outside --bounds or --clip, left out
  std::uint64_t thinned = 0;       ///< else not the point of its cube that --thin keeps, left out
  std::uint64_t non_finite = 0;    ///< NaN or infinite coordinates, dropped
  std::uint64_t absurd = 0;        ///< far outside everything else, dropped
  std::uint64_t kept = 0;          ///< what distribute writes (duplicates and hot bricks come off in order)

  static void fields(auto& self, auto&& field) {
    field("read", self.read);
    field("withheld", self.withheld);
    field("empty", self.empty);
    field("missing", self.missing);
    field("other_class", self.other_class);
    field("other_return", self.other_return);
    field("outside", self.outside);
    field("thinned", self.thinned);
    field("non_finite", self.non_finite);
    field("absurd", self.absurd);
    field("kept", self.kept);
  }
  void add(const PointDispositions& part) {
    read += part.read, withheld += part.withheld, empty += part.empty, missing += part.missing;
    other_class += part.other_class, other_return += part.other_return, outside += part.outside;
    thinned += part.thinned, non_finite += part.non_finite, absurd += part.absurd, kept += part.kept;
  }
};

/// An occupied brick of the lattice, as surveyed: before duplicates and thinning.
struct PlanBrick {
  std::uint64_t key = 0;  ///< Morton code of the brick
  std::uint64_t points = 0;
  std::uint64_t blocks = 0;  ///< of 8^3 cells that hold a point
  bool operator==(const PlanBrick&) const = default;
};

/// Consecutive bricks that are sorted by one task.
struct PlanBucket {
  std::uint64_t first_key = 0;    ///< key of its first brick; it ends before the next bucket's
  std::uint64_t first_brick = 0;  ///< index into the brick list
  std::uint64_t bricks = 0;
  std::uint64_t points = 0;
};

struct Plan {
  Lattice lattice;
  double radius_cells = 3.0;  ///< support radius in cells, within [1, 4]
  double noise_cells = 0.0;   ///< standard deviation of the points along the normal, in cells
  double metres = 0.0;        ///< of a unit of the scan; 0 = it does not say
  double spacing = 0.0;  ///< measured distance to the next sample (high percentile), scan units; 0 = unknown
  bool auto_resolution = false;  ///< h was chosen by measurement
  std::string resolution_reason = "given";
  bool has_colour = false;                      ///< points have colours: their own, or what --colour makes
  std::array<double, 2> colour_range = {0, 1};  ///< of heights in quanta, or intensities (--colour)
  double normal_fraction = 0.0;                 ///< share of the kept points that carry a usable normal
  bool grid_normals = false;  ///< these, or some of them, are made from the rows and columns of scans
  double multi_return_fraction =
      0.0;                       ///< share of them that come from pulses of several returns; 0 = unknown
  std::vector<Double3> sensors;  ///< PointRecord::sensor indexes it; ascending, no repeats; scan frame
  Int3 brick_min = {0, 0, 0};    ///< smallest and largest occupied brick coordinates per axis, lattice frame
  Int3 brick_max = {0, 0, 0};
  std::uint64_t bricks = 0;          ///< occupied bricks
  std::uint64_t faces_estimate = 0;  ///< of the raw mesh, from the cells that the sampled points occupy
  PointDispositions dispositions;
  std::vector<PlanBucket> buckets;
  std::vector<std::string> warnings;  ///< one sentence each

  static void fields(auto& self, auto&& field) {
    field("h", self.lattice.h);
    field("origin_brick", self.lattice.origin_brick);
    field("radius_cells", self.radius_cells);
    field("noise_cells", self.noise_cells);
    field("metres", self.metres);
    field("spacing", self.spacing);
    field("auto_resolution", self.auto_resolution);
    field("resolution_reason", self.resolution_reason);
    field("has_colour", self.has_colour);
    field("colour_range", self.colour_range);
    field("normal_fraction", self.normal_fraction);
    field("grid_normals", self.grid_normals);
    field("multi_return_fraction", self.multi_return_fraction);
    field("sensors", self.sensors);
    field("brick_min", self.brick_min);
    field("brick_max", self.brick_max);
    field("bricks", self.bricks);
    field("faces_estimate", self.faces_estimate);
    field("points", self.dispositions);
    field("warnings", self.warnings);
  }

  bool has_normals() const { return normal_fraction > 0.0; }
  std::uint64_t points() const { return dispositions.kept; }
  /// Whether so few points show a whole object that cells had to be finer than points lie apart, to tell its limbs.
  bool is_sparse() const;

  Json to_json() const;
  void save(const std::filesystem::path& file) const;
  /// \throws InputError naming the file when it is missing, damaged or of another version
  static Plan load(const std::filesystem::path& file);
  /// The plan of a work directory: <work>/plan.json.
  static Plan of_work(const std::filesystem::path& work) { return load(work / kFile); }

  static constexpr const char* kFile = "plan.json";
  static constexpr const char* kBrickFile = "bricks.bin";
};

/// The occupied bricks, ascending key: 24 bytes each.
void save_plan_bricks(const std::filesystem::path& file, const std::vector<PlanBrick>& bricks);
/// \throws InputError naming the file when it is missing or damaged
std::vector<PlanBrick> load_plan_bricks(const std::filesystem::path& file);

/// Cuts the bricks into buckets of at most `target_points`; a brick is never cut, so a bucket may be one large brick,
/// and a hot one (over `max_brick_points`) always stands alone.
std::vector<PlanBucket> cut_buckets(const std::vector<PlanBrick>& bricks, std::uint64_t target_points,
                                    std::uint64_t max_brick_points);

}  // namespace tessera
