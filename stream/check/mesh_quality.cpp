#include "stream/check/mesh_quality.h"

#include <xxhash.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "kernels/solid/wall_balls.h"
#include "octree/portable_math.h"
#include "octree/vector.h"
#include "stream/files/spill_buckets.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

using Corners = std::array<Double3, 3>;
constexpr double kDegreesPerRadian = 180.0 / kPi;

/// A face at one of its edges. The edge runs from the lower end to the higher one.
struct EdgeSide {
  std::array<std::uint64_t, 2> key;  ///< hash of both ends
  Float3 normal, along, middle;      ///< units; relative to the centre of the mesh
  bool forwards = false;             ///< the face runs along it
};

std::array<std::uint64_t, 2> edge_key(const Double3& low, const Double3& high) {
  std::array<double, 6> bytes;
  for (std::size_t k = 0; k < 3; ++k) bytes[k] = low[k] + 0.0, bytes[3 + k] = high[k] + 0.0;  // no -0
  const XXH128_hash_t hash = XXH3_128bits(bytes.data(), sizeof bytes);
  return {hash.high64, hash.low64};
}

/// Through the inside, degrees. \param a  runs along the edge; \param b  against it
double dihedral_angle(const EdgeSide& a, const EdgeSide& b) {
  const Double3 na = wide(a.normal), nb = wide(b.normal);
  return 180.0 - kDegreesPerRadian * std::atan2(dot(wide(a.along), cross(na, nb)), dot(na, nb));
}

/// Numbers in [0, 1) that hang on the corners of a face alone.
std::array<double, 3> numbers_of(const Corners& sorted) {
  const XXH128_hash_t hash = XXH3_128bits(sorted.data(), sizeof sorted);
  const auto share = [](std::uint64_t bits) { return static_cast<double>(bits >> 11) * 0x1p-53; };
  return {share(hash.low64), share(hash.high64), share(hash.low64 * 0x9e3779b97f4a7c15ULL ^ hash.high64)};
}

double fraction(double x) {
  return x - std::floor(x);
}

}  // namespace

struct MeshQualityPass::State {
  State(std::uint64_t most_faces, const Double3& middle, MeshQualityOptions given)
      : options(std::move(given)),
        centre(middle),
        pool(options.temp, options.memory_bytes / 2),
        edges(
            pool,
            static_cast<std::size_t>(3 * most_faces * sizeof(EdgeSide) / (options.memory_bytes / 8 + 1) + 1),
            std::clamp<std::uint64_t>(
                options.memory_bytes / 8 /
                    (3 * most_faces * sizeof(EdgeSide) / (options.memory_bytes / 8 + 1) + 1),
                4096, 1u << 18)),
        faces(pool, 1, std::clamp<std::uint64_t>(options.memory_bytes / 8, 4096, 1u << 20)) {}

  void stop_point() const {
    if (options.check_stop) options.check_stop();
  }
  MeshQuality::Dihedral dihedrals(bool inwards);
  std::vector<WallSample> samples(double area, bool inwards) const;
  MeshQuality::Walls walls(double area, bool inwards) const;

  MeshQualityOptions options;
  Double3 centre;
  SpillPool pool;
  SpillBuckets<EdgeSide> edges;  ///< by their key
  SpillBuckets<Corners> faces;
  std::uint64_t count = 0;
};

MeshQualityPass::MeshQualityPass(std::uint64_t faces, const Double3& centre,
                                 const MeshQualityOptions& options)
    : state_(std::make_unique<State>(faces, centre, options)) {}
MeshQualityPass::~MeshQualityPass() = default;

void MeshQualityPass::add(const Double3& a, const Double3& b, const Double3& c, bool flip) {
  State& s = *state_;
  // From the same corner on however the face is written: products round alike.
  Corners corner = flip ? Corners{a, c, b} : Corners{a, b, c};
  std::rotate(corner.begin(), std::min_element(corner.begin(), corner.end()), corner.end());
  const Double3 normal = unit(cross(corner[1] - corner[0], corner[2] - corner[0]));
  for (std::size_t k = 0; k < 3; ++k) {
    const Double3 &from = corner[k], &to = corner[(k + 1) % 3];
    const bool forwards = from < to;
    const Double3 &low = forwards ? from : to, &high = forwards ? to : from;
    const EdgeSide side{edge_key(low, high), narrow(normal), narrow(unit(high - low)),
                        narrow((low + high) * 0.5 - s.centre), forwards};
    s.edges.add(static_cast<std::size_t>(side.key[0] % s.edges.size()), side);
  }
  s.faces.add(0, corner);
  ++s.count;
}

MeshQuality::Dihedral MeshQualityPass::State::dihedrals(bool inwards) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  MeshQuality::Dihedral out;
  std::pair<double, Double3> least{kNone, {}}, most{-kNone, {}};
  std::vector<EdgeSide> some;
  for (std::size_t bucket = 0; bucket < edges.size(); ++bucket) {
    stop_point();
    some.clear();
    some.reserve(edges.count(bucket));
    edges.for_each(bucket, [&](std::span<const EdgeSide> sides) {
      some.insert(some.end(), sides.begin(), sides.end());
    });
    edges.release(bucket);
    std::sort(some.begin(), some.end(), [](const EdgeSide& a, const EdgeSide& b) {
      return std::tie(a.key, b.forwards) < std::tie(b.key, a.forwards);
    });
    for (std::size_t i = 0, j = 0; i < some.size(); i = j) {
      for (j = i + 1; j < some.size() && some[j].key == some[i].key;) ++j;
      if (j - i != 2 || some[i].forwards == some[i + 1].forwards) continue;
      double angle = dihedral_angle(some[i], some[i + 1]);
      if (inwards) angle = 360.0 - angle;
      const Double3 at = centre + wide(some[i].middle);
      ++out.edges;
      least = std::min(least, {angle, at});
      if (angle > most.first || (angle == most.first && at < most.second)) most = {angle, at};
    }
  }
  if (out.edges == 0) return out;
  std::tie(out.min, out.min_at) = least;
  std::tie(out.max, out.max_at) = most;
  return out;
}

/// Half of them by area, half by faces: each face has as many as its share says, rounded by its own number, so that neither the
/// order of faces nor of their corners matters. In it they follow Roberts' R2 sequence.
std::vector<WallSample> MeshQualityPass::State::samples(double area, bool inwards) const {
  std::vector<WallSample> out;
  out.reserve(kWallSamples + kWallSamples / 8);
  faces.for_each(0, [&](std::span<const Corners> some) {
    stop_point();
    for (const Corners& f : some) {
      Corners sorted = f;
      std::sort(sorted.begin(), sorted.end());
      const Double3 twice = cross(f[1] - f[0], f[2] - f[0]);
      const std::array<double, 3> own = numbers_of(sorted);
      const double share = 0.5 * (0.5 * norm(twice) / area + 1.0 / static_cast<double>(count));
      const auto wanted = static_cast<std::uint64_t>(static_cast<double>(kWallSamples) * share + own[0]);
      for (std::uint64_t i = 0; i < wanted; ++i) {
        double s = fraction(own[1] + static_cast<double>(i) * 0.7548776662466927);
        double t = fraction(own[2] + static_cast<double>(i) * 0.5698402909980532);
        if (s + t > 1.0) s = 1.0 - s, t = 1.0 - t;
        const Double3 at = sorted[0] + (sorted[1] - sorted[0]) * s + (sorted[2] - sorted[0]) * t;
        out.push_back({at, unit(twice) * (inwards ? 1.0 : -1.0)});
      }
    }
  });
  return out;
}

MeshQuality::Walls MeshQualityPass::State::walls(double area, bool inwards) const {
  std::vector<WallSample> sample = samples(area, inwards);
  MeshQuality::Walls out;
  out.samples = sample.size();
  const std::size_t at_once = static_cast<std::size_t>(
      std::max<std::uint64_t>(4096, options.walls_bytes / WallFaces::bytes_per_face()));
  std::vector<Corners> some;
  some.reserve(std::min<std::uint64_t>(at_once, count));
  const auto shrink = [&] {
    const WallFaces wall(std::exchange(some, {}));
    constexpr std::size_t kBatch = 512;
    parallel_for((sample.size() + kBatch - 1) / kBatch, [&](std::size_t batch) {
      stop_point();
      for (std::size_t i = batch * kBatch; i < std::min(sample.size(), (batch + 1) * kBatch); ++i)
        wall.shrink(sample[i]);
    });
  };
  faces.for_each(0, [&](std::span<const Corners> next) {
    for (Corners f : next) {
      if (inwards) std::swap(f[1], f[2]);
      some.push_back(f);
      if (some.size() == at_once) shrink();
    }
  });
  if (!some.empty()) shrink();
  std::erase_if(sample, [](const WallSample& s) { return !std::isfinite(s.radius); });
  out.facing = sample.size();
  if (sample.empty()) return out;
  std::sort(sample.begin(), sample.end(), [](const WallSample& a, const WallSample& b) {
    return std::tie(a.radius, a.position) < std::tie(b.radius, b.position);
  });
  out.thinnest = 2.0 * sample.front().radius;
  out.thinnest_at = sample.front().position;
  out.percent = 2.0 * sample[(sample.size() - 1) / 100].radius;
  out.median = 2.0 * sample[(sample.size() - 1) / 2].radius;
  return out;
}

MeshQuality MeshQualityPass::finish(double area, bool inwards) {
  MeshQuality out;
  if (state_->count == 0) return out;
  out.dihedral = state_->dihedrals(inwards);
  WorkerPool pool(state_->options.threads);
  pool.run_here([&] { out.walls = state_->walls(area, inwards); });
  return out;
}

Json to_json(const MeshQuality& q) {
  Json dihedral = {{"edges", q.dihedral.edges}};
  if (q.dihedral.edges > 0) {
    dihedral["min_deg"] = q.dihedral.min;
    dihedral["min_at"] = q.dihedral.min_at;
    dihedral["max_deg"] = q.dihedral.max;
    dihedral["max_at"] = q.dihedral.max_at;
  }
  Json walls = {{"samples", q.walls.samples}, {"facing", q.walls.facing}};
  if (q.walls.facing > 0) {
    walls["thinnest"] = q.walls.thinnest;
    walls["thinnest_at"] = q.walls.thinnest_at;
    walls["first_percentile"] = q.walls.percent;
    walls["median"] = q.walls.median;
  }
  return {{"dihedral", dihedral}, {"walls", walls}};
}

std::vector<std::pair<std::string, std::string>> quality_lines(const MeshQuality& q) {
  const auto place = [](const Double3& p) {
    return number_text(p[0]) + " " + number_text(p[1]) + " " + number_text(p[2]);
  };
  std::vector<std::pair<std::string, std::string>> lines;
  if (q.dihedral.edges > 0)
    lines.emplace_back("dihedral", number_text(q.dihedral.min) + " (at " + place(q.dihedral.min_at) +
                                       ") to " + number_text(q.dihedral.max) + " (at " +
                                       place(q.dihedral.max_at) + ") degrees, measured inside");
  if (q.walls.facing == 0) {
    lines.emplace_back("walls", "no face has another on the other side");
  } else {
    lines.emplace_back("walls", "thinnest " + number_text(q.walls.thinnest) + " (at " +
                                    place(q.walls.thinnest_at) + "), 1 % below " +
                                    number_text(q.walls.percent) + ", half below " +
                                    number_text(q.walls.median) + "; " + std::to_string(q.walls.facing) +
                                    " of " + std::to_string(q.walls.samples) + " samples have another side");
  }
  return lines;
}

}  // namespace tessera
