#include "stream/points/point_summary.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {

namespace {

constexpr std::uint64_t kSliceBytes = std::uint64_t{8} << 20;
constexpr std::size_t kSeeds = 64;
constexpr std::size_t kNeighbours = 4;
constexpr double kInf = std::numeric_limits<double>::infinity();

bool finite(const PointChunk& c, std::size_t i) {
  return std::isfinite(c.x[i]) && std::isfinite(c.y[i]) && std::isfinite(c.z[i]);
}

/// The nearest squared distances to each seed, as far as they are not zero.
struct NearestOfSeeds {
  std::size_t count = 0;
  std::array<double, kSeeds> x{}, y{}, z{};
  std::array<std::array<double, kNeighbours>, kSeeds> squared{};

  void add_seed(const Double3& p) {
    x[count] = p[0], y[count] = p[1], z[count] = p[2];
    squared[count++].fill(kInf);
  }
  void insert(std::size_t seed, double distance) {
    auto& list = squared[seed];
    for (std::size_t i = 0; i < kNeighbours; ++i) {
      if (distance < list[i]) std::swap(distance, list[i]);
    }
  }
  void visit(double px, double py, double pz) {
    std::array<double, kSeeds> distance;
    bool any = false;
    for (std::size_t s = 0; s < count; ++s) {
      const double dx = px - x[s], dy = py - y[s], dz = pz - z[s];
      distance[s] = dx * dx + dy * dy + dz * dz;
      any |= distance[s] < squared[s][kNeighbours - 1];
    }
    if (!any) return;
    for (std::size_t s = 0; s < count; ++s) {
      if (distance[s] > 0 && distance[s] < squared[s][kNeighbours - 1]) insert(s, distance[s]);
    }
  }
  void merge(const NearestOfSeeds& other) {
    for (std::size_t s = 0; s < count; ++s) {
      for (const double d : other.squared[s]) insert(s, d);
    }
  }
  double median() const {
    std::vector<double> found;
    for (std::size_t s = 0; s < count; ++s) {
      if (squared[s].back() < kInf) found.push_back(squared[s].back());
    }
    if (found.empty()) return 0;
    std::nth_element(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2),
                     found.end());
    return std::sqrt(found[found.size() / 2]);
  }
};

/// Sums of one slice; merging them in any order gives the same.
struct Part {
  ReadCounts counts;
  std::uint64_t not_finite = 0;
  std::uint64_t without_normal = 0;
  std::uint64_t without_colour = 0;
  Double3 min = {kInf, kInf, kInf};
  Double3 max = {-kInf, -kInf, -kInf};
  bool exact_in_float = true;
  NearestOfSeeds nearest;

  void add(const PointChunk& c) {
    for (std::size_t i = 0; i < c.size(); ++i) {
      if (!finite(c, i)) {
        ++not_finite;
        continue;
      }
      const Double3 p = {c.x[i], c.y[i], c.z[i]};
      for (std::size_t a = 0; a < 3; ++a) {
        min[a] = std::min(min[a], p[a]);
        max[a] = std::max(max[a], p[a]);
        exact_in_float = exact_in_float && static_cast<double>(static_cast<float>(p[a])) == p[a];
      }
      nearest.visit(p[0], p[1], p[2]);
    }
    for (std::size_t i = 0; i < c.nx.size(); ++i) {
      const float squared = c.nx[i] * c.nx[i] + c.ny[i] * c.ny[i] + c.nz[i] * c.nz[i];
      without_normal += !(squared > 0) || std::isinf(squared) ? 1 : 0;
    }
    for (const std::uint32_t colour : c.rgba) without_colour += colour >> 24 == 0 ? 1 : 0;
  }
  void add(const ReadCounts& c) {
    counts.points += c.points;
    counts.withheld += c.withheld;
    counts.empty += c.empty;
    counts.missing += c.missing;
    counts.surplus += c.surplus;
    counts.warnings.insert(counts.warnings.end(), c.warnings.begin(), c.warnings.end());
  }
  void merge(const Part& other) {
    add(other.counts);
    not_finite += other.not_finite;
    without_normal += other.without_normal;
    without_colour += other.without_colour;
    for (std::size_t a = 0; a < 3; ++a) {
      min[a] = std::min(min[a], other.min[a]);
      max[a] = std::max(max[a], other.max[a]);
    }
    exact_in_float = exact_in_float && other.exact_in_float;
    nearest.merge(other.nearest);
  }
};

/// First finite point of each of 64 slices. Slices depend on the file alone, so the seeds do too.
NearestOfSeeds choose_seeds(const PointFile& file) {
  NearestOfSeeds seeds;
  struct Enough {};
  const std::uint64_t bytes = file.info().planned_bytes();
  const std::vector<InputSlice> slices = file.slices(0, std::max<std::uint64_t>(bytes / kSeeds, 4096));
  for (std::size_t s = 0; s < kSeeds && s < slices.size(); ++s) {
    const InputSlice& slice = slices[slices.size() <= kSeeds ? s : s * slices.size() / kSeeds];
    try {
      file.read(slice, [&](const PointChunk& c) {
        for (std::size_t i = 0; i < c.size(); ++i) {
          if (!finite(c, i)) continue;
          seeds.add_seed({c.x[i], c.y[i], c.z[i]});
          throw Enough();
        }
      });
    } catch (const Enough&) {
      continue;  // the rest of the slice is not needed now
    }
  }
  return seeds;
}

}  // namespace

PointSummary summarize_points(const std::filesystem::path& path, const ReadOptions& options) {
  ReadOptions small = options;
  small.chunk_points = std::min<std::size_t>(options.chunk_points, 16384);
  const auto file = open_point_file(path, small);
  Part total;
  total.nearest = choose_seeds(*file);
  const std::vector<InputSlice> slices = file->slices(0, kSliceBytes);
  // One part per task of a fixed number of slices: few enough to keep all of them.
  const std::size_t step = std::max<std::size_t>(1, slices.size() / 1024);
  std::vector<Part> parts((slices.size() + step - 1) / step);
  parallel_for(parts.size(), [&](std::size_t p) {
    parts[p].nearest = total.nearest;
    for (std::size_t s = p * step; s < std::min(slices.size(), (p + 1) * step); ++s) {
      throw_if_stopped();
      parts[p].add(file->read(slices[s], [&](const PointChunk& c) { parts[p].add(c); }));
    }
  });
  for (const Part& part : parts) total.merge(part);

  PointSummary summary;
  summary.info = file->info();
  summary.counts = total.counts;
  summary.missing = missing_points(summary.info, summary.counts);
  summary.not_finite = total.not_finite;
  summary.without_normal = total.without_normal;
  summary.without_colour = total.without_colour;
  summary.min = total.min;
  summary.max = total.max;
  summary.exact_in_float = total.exact_in_float;
  summary.spacing = total.nearest.median();
  summary.warnings = summary.info.warnings;
  const auto add = [&](const std::vector<std::string>& more) {
    for (const std::string& w : more) {
      const bool known =
          std::find(summary.warnings.begin(), summary.warnings.end(), w) != summary.warnings.end();
      if (!known) summary.warnings.push_back(w);
    }
  };
  add(summary.counts.warnings);
  add(refuted_claims(summary.info, summary.counts, summary.min, summary.max));
  return summary;
}

}  // namespace tessera
