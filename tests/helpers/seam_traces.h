/// \file seam_traces.h
/// Do blocks of remeshing leave a trace? Faces near the seams of a pass against faces near the same planes moved by 0.2,
/// 0.4, 0.6 and 0.8 of a block: Kolmogorov-Smirnov distances of angles, lengths and areas. Streams, patch by patch.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "octree/portable_math.h"
#include "octree/vector.h"
#include "stream/runtime/option_table.h"
#include "stream/runtime/work_dir.h"
#include "stream/stages/decimate/decimate_job.h"
#include "stream/stages/remesh/remesh_stage.h"

namespace tessera::test {

/// Values from 0 to `top` in bins so narrow that distances between distributions come out the same.
class Distribution {
 public:
  explicit Distribution(double top) : top_(top) {}
  void add(double value) {
    ++bins_[std::min(kBins - 1, static_cast<std::size_t>(value / top_ * static_cast<double>(kBins)))];
    ++count_;
    sum_ += value;
  }
  double mean() const { return count_ > 0 ? sum_ / static_cast<double>(count_) : 0.0; }
  void merge(const Distribution& o) {
    for (std::size_t i = 0; i < kBins; ++i) bins_[i] += o.bins_[i];
    count_ += o.count_;
    sum_ += o.sum_;
  }
  /// Largest difference of the two distribution functions.
  static double distance(const Distribution& a, const Distribution& b) {
    if (a.count_ == 0 || b.count_ == 0) return 0.0;
    double worst = 0.0;
    std::uint64_t x = 0, y = 0;
    for (std::size_t i = 0; i < kBins; ++i) {
      x += a.bins_[i], y += b.bins_[i];
      worst = std::fmax(worst, std::fabs(static_cast<double>(x) / static_cast<double>(a.count_) -
                                         static_cast<double>(y) / static_cast<double>(b.count_)));
    }
    return worst;
  }

 private:
  static constexpr std::size_t kBins = 4096;
  double top_;
  std::vector<std::uint64_t> bins_ = std::vector<std::uint64_t>(kBins, 0);
  std::uint64_t count_ = 0;
  double sum_ = 0.0;
};

/// Of faces: least angles, all angles, edges and areas in those of the target.
struct FaceShapes {
  static constexpr std::array<const char*, 4> kNames = {"least angle", "angles", "edges", "areas"};
  std::array<Distribution, 4> of = {Distribution(60.1), Distribution(180.1), Distribution(3.0),
                                    Distribution(5.0)};
  std::uint64_t faces = 0;

  void add(const std::array<Double3, 3>& p, double target) {
    double minimum = 180.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const Double3 u = p[(i + 1) % 3] - p[i], v = p[(i + 2) % 3] - p[i];
      const double angle = std::atan2(norm(cross(u, v)), dot(u, v)) * (180.0 / kPi);
      of[1].add(angle);
      of[2].add(norm(u) / target);
      minimum = std::fmin(minimum, angle);
    }
    of[0].add(minimum);
    of[3].add(norm(cross(p[1] - p[0], p[2] - p[0])) / (std::sqrt(0.75) * target * target));
    ++faces;
  }
  void merge(const FaceShapes& o) {
    for (std::size_t i = 0; i < of.size(); ++i) of[i].merge(o.of[i]);
    faces += o.faces;
  }
};

struct SeamTrace {
  std::string where;
  std::uint64_t seam_faces = 0, control_faces = 0;
  double critical = 0.0;  ///< what chance alone exceeds in 5 of 100 draws of so many faces
  // Of FaceShapes::kNames.
  std::array<double, 4> distance{};  ///< seams to controls
  std::array<double, 4> among{};     ///< the largest of one control to the others
  std::array<double, 4> seam_mean{}, control_mean{};

  bool seen() const {
    for (std::size_t i = 0; i < distance.size(); ++i)
      if (distance[i] > std::fmax(critical, among[i])) return true;
    return false;
  }
};

/// What is gathered beside the seams of one pass.
class SeamBand {
 public:
  /// \param width  edges to either side
  SeamBand(std::string where, double width) : where_(std::move(where)), width_(width) {}
  /// \param off  distance to the nearest plane in edges: the seams', then the controls'
  void add(const std::array<double, 5>& off, const std::array<Double3, 3>& p, double target) {
    if (off[0] <= width_) return seam_.add(p, target);
    for (std::size_t c = 0; c < 4; ++c)
      if (off[c + 1] <= width_) return controls_[c].add(p, target);
  }
  double width() const { return width_; }
  SeamTrace trace() const {
    SeamTrace out;
    out.where = where_;
    FaceShapes all;
    for (const FaceShapes& c : controls_) all.merge(c);
    out.seam_faces = seam_.faces, out.control_faces = all.faces;
    const double n = static_cast<double>(seam_.faces), m = static_cast<double>(all.faces);
    out.critical = n * m > 0.0 ? 1.358 * std::sqrt((n + m) / (n * m)) : 1.0;
    for (std::size_t i = 0; i < out.distance.size(); ++i) {
      out.seam_mean[i] = seam_.of[i].mean(), out.control_mean[i] = all.of[i].mean();
      out.distance[i] = Distribution::distance(seam_.of[i], all.of[i]);
      for (std::size_t c = 0; c < 4; ++c) {
        FaceShapes others;
        for (std::size_t d = 0; d < 4; ++d)
          if (d != c) others.merge(controls_[d]);
        out.among[i] = std::fmax(out.among[i], Distribution::distance(controls_[c].of[i], others.of[i]));
      }
    }
    return out;
  }

 private:
  std::string where_;
  double width_;
  FaceShapes seam_;
  std::array<FaceShapes, 4> controls_;
};

/// \param work  of a finished `tessera remesh` with --keep
inline std::vector<SeamTrace> seam_traces(const std::filesystem::path& work) {
  JobState state = WorkDir::open_existing(work, false).read_state();
  state.work = work;
  const auto options = from_settings<RemeshJobOptions>(state.settings);
  const SimplifyStores stores = imported_stores("mesh");
  const Sizing sizing = Sizing::of_work(work);
  const int round = last_round(work);
  const MeshStore mesh = open_pass_input(state, stores, {options.passes, round, false});
  const MeshStore reference = stores.full(state);
  const Lattice& lattice = mesh.info().lattice;
  const double brick = lattice.h * kBrickCells;

  // An edge to either side, and as far as later passes mend beside a seam.
  constexpr double kNearSeam = 1.0, kMended = 6.0;
  constexpr double kAcross = 0.5;  // planes that the surface all but lies in are no seams of it
  std::vector<std::vector<MeshBlockCut>> blocks;
  std::vector<std::vector<SeamBand>> bands;
  for (int pass = 0; pass < options.passes; ++pass) {
    const MeshStore in = open_pass_input(state, stores, {pass, round, false});
    blocks.push_back(remesh_blocks(in, reference, options, sizing, pass));
    const std::string name =
        "pass " + std::to_string(pass + 1) + " (" + std::to_string(blocks.back().size()) + " blocks)";
    bands.push_back({{name + ", beside seams", kNearSeam}, {name + ", six edges to either side", kMended}});
    if (pass > 0)
      bands.back().emplace_back(name + ", beside seams where the pass before left some", kNearSeam);
  }
  for (std::size_t patch = 0; patch < mesh.patches().size(); ++patch) {
    const Int3 here = brick_of_key(mesh.patches()[patch].key);
    std::vector<const MeshBlockCut*> of_pass;
    for (const auto& cuts : blocks) {
      const auto holds = [&](const MeshBlockCut& b) {
        for (std::size_t a = 0; a < 3; ++a)
          if (here[a] < b.first_brick[a] || here[a] > b.last_brick[a]) return false;
        return true;
      };
      const auto at = std::find_if(cuts.begin(), cuts.end(), holds);
      of_pass.push_back(at == cuts.end() ? nullptr : &*at);
    }
    const MeshBlock block = mesh.load({&patch, 1});
    for (const auto& f : block.faces) {
      const std::array<Double3, 3> p = {block.position[f[0]], block.position[f[1]], block.position[f[2]]};
      const Double3 centre = (p[0] + p[1] + p[2]) * (1.0 / 3.0);
      const Double3 normal = cross(p[1] - p[0], p[2] - p[0]);
      double seam_before = 1e300;
      for (std::size_t pass = 0; pass < of_pass.size(); ++pass) {
        std::array<double, 5> off;
        off.fill(1e300);
        for (std::size_t a = 0; a < 3 && of_pass[pass]; ++a) {
          if (normal[a] * normal[a] > kAcross * kAcross * dot(normal, normal)) continue;
          const double low = of_pass[pass]->first_brick[a], high = of_pass[pass]->last_brick[a] + 1;
          const double at = centre[a] / brick - static_cast<double>(lattice.origin_brick[a]),
                       edges = brick / sizing.edge;
          off[0] = std::fmin(off[0], std::fmin(std::fabs(at - low), std::fabs(high - at)) * edges);
          for (std::size_t c = 1; c < 5; ++c)
            off[c] =
                std::fmin(off[c], std::fabs(at - low - 0.2 * static_cast<double>(c) * (high - low)) * edges);
        }
        bands[pass][0].add(off, p, sizing.edge);
        bands[pass][1].add(off, p, sizing.edge);
        if (pass > 0 && seam_before <= kMended) bands[pass][2].add(off, p, sizing.edge);
        seam_before = off[0];
      }
    }
  }
  std::vector<SeamTrace> traces;
  for (const auto& of_one : bands)
    for (const SeamBand& band : of_one) traces.push_back(band.trace());
  return traces;
}

}  // namespace tessera::test
