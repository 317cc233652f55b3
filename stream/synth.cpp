#include "stream/synth.h"

#include <chrono>
#include <cmath>
#include <thread>

#include <tbb/global_control.h>
#include <tbb/parallel_pipeline.h>
#include <nlohmann/json.hpp>

#include "kernels/scene.h"
#include "kernels/surface_sampler.h"
#include "octree/error.h"
#include "stream/formats/point_writer.h"
#include "stream/output_file.h"
#include "stream/stop.h"

namespace tessera {
namespace {

using synth::Box3;
using synth::Scene;
using synth::SurfaceBatch;
using synth::SurfaceSampler;
using synth::Vec3;

// Streams of random numbers, so that no two uses share one.
enum : std::uint64_t { kNoiseStream = 11, kOutlierStream = 13 };

void validate(const SynthOptions& o) {
  const auto refuse = [](const std::string& message) { throw UsageError("synth: " + message); };
  if (o.spacing < 0.0 || !std::isfinite(o.spacing)) refuse("--spacing must be positive");
  if (o.spacing == 0.0 && o.points == 0) refuse("--points must be at least 1");
  if (o.points > 100000000000ULL) refuse("--points must be at most 1e11");
  if (o.noise < 0.0 || !std::isfinite(o.noise)) refuse("--noise must not be negative");
  if (!(o.outliers >= 0.0 && o.outliers < 1.0)) refuse("--outliers must be a share from 0 to below 1");
  if (o.octaves < 0 || o.octaves > 16) refuse("--octaves must be 0 to 16");
  for (const double v : o.shift) {
    if (!std::isfinite(v)) refuse("--shift must be finite");
  }
}

bool shifted(const SynthOptions& o) {
  return o.shift != Double3{0, 0, 0};
}

PointFileHeader file_header(const SynthOptions& o, const SynthReport& report) {
  PointFileHeader header;
  header.attributes.normals = o.normals;
  header.attributes.colour = o.colour;
  header.double_positions = o.double_positions || shifted(o);
  header.las_offset = {std::floor(o.shift[0]), std::floor(o.shift[1]), std::floor(o.shift[2])};
  // The power of ten at or below a thousandth of the spacing: rounding stays out of sight.
  header.las_scale = 1.0;
  while (header.las_scale > report.spacing / 1000.0) header.las_scale /= 10.0;
  header.comments.push_back("synthetic scan of scene " + o.scene + ", truth in the .truth.json beside");
  return header;
}

/// Adds noise, outliers, colour and shift to exact samples whose first has index `first`.
class Corrupter {
 public:
  Corrupter(const SynthOptions& o, const Scene& scene, double noise) : o_(o), scene_(scene), noise_(noise) {
    const Box3 box = scene.bounds();
    const Vec3 margin = (box.hi - box.lo) * 0.1;
    lo_ = box.lo - margin;
    size_ = (box.hi - box.lo) * 1.2;
  }
  /// Returns how many points became outliers.
  std::uint64_t apply(std::uint64_t first, const SurfaceBatch& in, PointChunk& out) const {
    const std::size_t n = in.size();
    out.clear();
    out.x.assign(in.x.begin(), in.x.end());
    out.y.assign(in.y.begin(), in.y.end());
    out.z.assign(in.z.begin(), in.z.end());
    if (o_.normals) {
      out.nx.resize(n), out.ny.resize(n), out.nz.resize(n);
      for (std::size_t i = 0; i < n; ++i) {
        out.nx[i] = static_cast<float>(in.nx[i]);
        out.ny[i] = static_cast<float>(in.ny[i]);
        out.nz[i] = static_cast<float>(in.nz[i]);
      }
    }
    if (o_.colour) {
      out.rgba.resize(n);
      for (std::size_t i = 0; i < n; ++i) {
        out.rgba[i] = scene_.colour({{in.x[i], in.y[i], in.z[i]}, {in.nx[i], in.ny[i], in.nz[i]}});
      }
    }
    if (noise_ > 0.0) {
      for (std::size_t i = 0; i < n; ++i) {
        const std::uint64_t bits = synth::random_bits(o_.seed, kNoiseStream, first + i);
        const double d = noise_ * synth::gaussian(bits, synth::mix(bits));
        out.x[i] += d * in.nx[i];
        out.y[i] += d * in.ny[i];
        out.z[i] += d * in.nz[i];
      }
    }
    std::uint64_t outliers = 0;
    if (o_.outliers > 0.0) {
      for (std::size_t i = 0; i < n; ++i) {
        std::uint64_t bits = synth::random_bits(o_.seed, kOutlierStream, first + i);
        if (synth::to_unit(bits) >= o_.outliers) continue;
        ++outliers;
        out.x[i] = lo_.x + size_.x * synth::to_unit(bits = synth::mix(bits));
        out.y[i] = lo_.y + size_.y * synth::to_unit(bits = synth::mix(bits));
        out.z[i] = lo_.z + size_.z * synth::to_unit(bits = synth::mix(bits));
      }
    }
    if (shifted(o_)) {
      for (std::size_t i = 0; i < n; ++i) {
        out.x[i] += o_.shift[0];
        out.y[i] += o_.shift[1];
        out.z[i] += o_.shift[2];
      }
    }
    return outliers;
  }

 private:
  const SynthOptions& o_;
  const Scene& scene_;
  double noise_;
  Vec3 lo_, size_;
};

/// Rough area of the parametrised surface, to turn a spacing into a number of points.
double rough_area(const Scene& scene) {
  return SurfaceSampler(scene, 1u << 20, 1).area();
}

void write_truth(const SynthOptions& o, const SynthReport& report, const std::filesystem::path& path) {
  nlohmann::ordered_json truth;
  truth["schema"] = 1;
  truth["scene"] = o.scene;
  truth["octaves"] = o.octaves;
  truth["mode"] = o.mode;
  truth["seed"] = o.seed;
  truth["points"] = report.points;
  truth["outliers"] = report.outliers;
  truth["area"] = report.area;
  truth["spacing"] = report.spacing;
  truth["noise"] = report.noise;
  truth["shift"] = o.shift;
  for (const auto& file : report.files) truth["files"].push_back(file.filename().string());
  OutputFile out(path);
  out.append(truth.dump(2) + "\n");
  out.finish();
}

}  // namespace

SynthReport synthesize(const SynthOptions& asked, const std::filesystem::path& output) {
  validate(asked);
  const auto start = std::chrono::steady_clock::now();
  SynthOptions o = asked;
  synth::SceneOptions scene_options{o.scene, o.octaves, o.spacing};
  if (o.spacing == 0.0) {
    // The terrain's detail follows the spacing; its area hardly depends on detail.
    scene_options.spacing = std::sqrt(1.2e6 / static_cast<double>(o.points));
  }
  const auto scene = synth::make_scene(scene_options);
  if (o.spacing > 0.0) {
    o.points = static_cast<std::uint64_t>(std::floor(rough_area(*scene) / (o.spacing * o.spacing) + 0.5));
    if (o.points == 0) throw UsageError("synth: --spacing is larger than the scene");
  }
  o.octaves = scene->octaves();
  const SurfaceSampler sampler(*scene, o.points, o.seed);
  SynthReport report;
  report.area = sampler.area();
  report.spacing = sampler.spacing();
  report.noise = o.noise_in_spacings ? o.noise * report.spacing : o.noise;
  const auto writer = create_point_file(output, file_header(o, report));
  if (output.extension() == ".ptx") {
    throw UsageError("synth: .ptx needs a terrestrial sensor; use .ply, .las or .xyz with --mode surface");
  }

  const Corrupter corrupter(o, *scene, report.noise);
  const int threads = o.threads > 0 ? o.threads : static_cast<int>(std::thread::hardware_concurrency());
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  struct Piece {
    EncodedPoints encoded;
    std::uint64_t outliers = 0;
  };
  std::size_t next = 0;
  tbb::parallel_pipeline(static_cast<std::size_t>(threads) + 1,
                         tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order,
                                                             [&](tbb::flow_control& control) -> std::size_t {
                                                               throw_if_stopped();
                                                               if (next == sampler.spans().size()) {
                                                                 control.stop();
                                                                 return 0;
                                                               }
                                                               return next++;
                                                             }) &
                             tbb::make_filter<std::size_t, std::shared_ptr<Piece>>(
                                 tbb::filter_mode::parallel,
                                 [&](std::size_t index) {
                                   const auto& span = sampler.spans()[index];
                                   SurfaceBatch batch;
                                   PointChunk chunk;
                                   auto piece = std::make_shared<Piece>();
                                   sampler.sample(span, batch);
                                   piece->outliers = corrupter.apply(span.first_point, batch, chunk);
                                   writer->encode(chunk, {}, piece->encoded);
                                   return piece;
                                 }) &
                             tbb::make_filter<std::shared_ptr<Piece>, void>(
                                 tbb::filter_mode::serial_in_order, [&](const std::shared_ptr<Piece>& piece) {
                                   writer->append(piece->encoded);
                                   report.points += piece->encoded.points;
                                   report.outliers += piece->outliers;
                                 }));
  writer->finish();
  report.files.push_back(output);
  report.truth = output;
  report.truth += ".truth.json";
  write_truth(o, report, report.truth);
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace tessera
