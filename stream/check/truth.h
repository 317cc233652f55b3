/// \file truth.h
/// A mesh against the surface that its scan was simulated from: distances, normals, creases. Exact where the
/// scene is; streaming in the mesh; the same numbers on any number of threads.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "kernels/scene/scene.h"
#include "octree/lattice.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

/// What `tessera synth` wrote beside a scan.
struct TruthFile {
  synth::SceneOptions scene;
  double spacing = 0.0;  ///< of the samples
  double noise = 0.0;    ///< standard deviation, scene units
  Double3 shift = {0, 0, 0};
};
/// \throws InputError naming the file and what is wrong with it
TruthFile read_truth(const std::filesystem::path& path);

struct TruthOptions {
  double h = 0.0;                 ///< lattice spacing of the mesh; 0 = the sample spacing
  double sharp_angle_deg = 30.0;  ///< a mesh edge is sharp from this angle between its faces
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;  ///< for vertex positions; more go to disk
  std::filesystem::path temp;                           ///< folder for scratch; empty = the system's
  int threads = 0;                                      ///< 0 = all cores
  std::uint64_t coverage_samples = 100000;              ///< of the truth, looked for on the mesh; 0 = skip
};

/// Distances of a set of places, scene units.
class DeviationStats {
 public:
  explicit DeviationStats(double limit) : limit_(limit) {}
  void add(double distance);
  std::uint64_t count() const { return count_; }
  double mean() const { return count_ ? sum_ / static_cast<double>(count_) : 0.0; }
  double rms() const;
  double max() const { return max_; }
  double share_beyond() const;            ///< share with distance > limit
  double percentile(double share) const;  ///< within 4 %, rounded up
 private:
  double limit_;
  std::uint64_t count_ = 0, beyond_ = 0;
  double sum_ = 0.0, squares_ = 0.0, max_ = 0.0;
  std::vector<std::uint64_t> histogram_;  ///< by the leading bits of a float: 32 bins an octave
};

struct TruthReport {
  explicit TruthReport(double spacing_h)
      : h(spacing_h),
        vertices(0.02 * h),
        centres(0.02 * h),
        sharp_vertices(0.02 * h),
        corners(0.02 * h),
        coverage(h) {}
  double h, spacing = 0.0, noise = 0.0;
  DeviationStats vertices;          ///< mesh vertices to truth
  DeviationStats centres;           ///< face centres to truth
  double mean_signed = 0.0;         ///< of vertices, positive outside
  std::uint64_t beyond_border = 0;  ///< vertices and centres past the end of an open truth: in no statistics
  bool has_creases = false;
  DeviationStats sharp_vertices;  ///< ends of sharp mesh edges near a true crease, to the nearest crease
  DeviationStats corners;         ///< true corners to the nearest mesh vertex
  double crease_recovered = 0.0;  ///< share of true crease length with a sharp mesh edge within h/10
  std::uint64_t sharp_edges = 0;
  /// Faces near creases with an altitude below 0.03 h: their normals say nothing, so their edges do not count
  /// as sharp.
  std::uint64_t slivers = 0;
  double normal_near_deg = 0.0;  ///< mean angle of face and truth, by area, centres within h of a crease
  double normal_away_deg = 0.0;  ///< elsewhere
  std::uint64_t faces_near = 0, faces_away = 0;
  DeviationStats coverage;  ///< samples of the truth to the mesh, cut at 3 h; beyond: more than h
};

/// \pre the mesh lies in the frame of the scan
/// \throws InputError from the reader; StoppedError
TruthReport compare_with_truth(MeshReader& mesh, const TruthFile& truth, const TruthOptions& options);

Json to_json(const TruthReport& report);
std::string describe(const TruthReport& report);

}  // namespace tessera
