/// \file sample_clusters.h
/// Splits the samples around one node into clusters of alike normals, and clusters into parallel layers.
///
/// Every sum runs over the samples in canonical order, in eight interleaved partial sums that are joined by a
/// fixed tree: results are pure functions of the list.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

inline constexpr int kMaxSheets = 4;

/// Samples around one node, relative to it, canonical order, padded with weight 0 to whole registers.
struct LocalSamples {
  std::vector<float> x, y, z, nx, ny, nz, w;
  std::vector<std::int32_t> label;  ///< cluster of each sample; -1 for padding
  std::size_t size = 0;             ///< samples
  void clear() { size = 0; }
  void reserve(std::size_t n);  ///< room for n samples and the padding, keeps the content
  /// Becomes every n-th sample of another list, padded.
  void take_every(std::size_t n, const LocalSamples& from);
  void pad();
};

/// Weighted sums of one cluster; additive, so clusters merge by adding.
struct Moments {
  // w, w p (3), w n (3), w p p (xx xy xz yy yz zz), w n p (row n, column p)
  std::array<float, 22> s{};
  int hits = 0;
  [[nodiscard]] float w() const { return s[0]; }
  [[nodiscard]] Float3 p() const { return {s[1], s[2], s[3]}; }
  [[nodiscard]] Float3 n() const { return {s[4], s[5], s[6]}; }
};

[[nodiscard]] Moments merged(const Moments& a, const Moments& b);

/// Directions that start the clusters.
struct NormalSeeds {
  std::array<Float3, kMaxSheets> normal{};
  int count = 1;  ///< 1: no two normals differ by more than the angle
};

/// Gives the normals length 1.
void make_unit(LocalSamples& samples);

/// Picks normals far from each other, nearer samples first: of samples, or of mean normals around the node
/// (see average_normals).
[[nodiscard]] NormalSeeds seed_normals(const LocalSamples& from, float cos_seed);

/// Labels the samples by their nearest direction: two Lloyd rounds from the seeds. \pre seeds.count > 1
void cluster_normals(LocalSamples& samples, const NormalSeeds& seeds);

/// Sums over the samples with a label.
[[nodiscard]] Moments sum_moments(const LocalSamples& samples, std::int32_t label);

/// Gives every sample the label map[label].
void relabel(LocalSamples& samples, const std::array<std::int32_t, kMaxSheets>& map);

/// Looks for two layers in one cluster, along its normal n through c: halves it at the mean height, three
/// rounds of moving the cut half-way between the layers. If they lie at least `min_gap` apart and well
/// beyond their own spread, the upper one gets `new_label` and the answer is true.
bool split_layers(LocalSamples& samples, std::int32_t label, std::int32_t new_label, const Float3& c,
                  const Float3& n, float min_gap);

}  // namespace tessera
