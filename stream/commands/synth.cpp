#include "stream/commands/synth.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "kernels/scene/sample_source.h"
#include "kernels/scene/scene.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "stream/files/json.h"
#include "stream/files/output_file.h"
#include "stream/files/path_text.h"
#include "stream/files/planned_writes.h"
#include "stream/formats/points/point_writer.h"
#include "stream/meshes/scene_file.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

using synth::Box3;
using synth::SampleBatch;
using synth::SampleSource;
using synth::ScanInfo;
using synth::Scene;
using synth::SurfaceBatch;

// Streams of random numbers, so that no two uses share one.
enum : std::uint64_t { kNoiseStream = 11, kOutlierStream = 13, kMissingStream = 17, kCorrelatedStream = 19 };

void validate(const SynthOptions& o) {
  const auto refuse = [](const std::string& message) { throw UsageError("synth: " + message); };
  if (o.spacing < 0.0 || !std::isfinite(o.spacing)) refuse("--spacing must be positive");
  if (o.spacing == 0.0 && o.points == 0) refuse("--points must be at least 1");
  if (o.points > 100000000000ULL) refuse("--points must be at most 1e11");
  if (o.mode != "surface" && o.mode != "terrestrial" && o.mode != "airborne" &&
      o.mode != "structured-light") {
    refuse("--mode must be surface, terrestrial, airborne or structured-light, not '" + o.mode + "'");
  }
  if (o.mode == "surface" && o.per_scan) refuse("--per-scan needs a sensor: --mode surface has no scans");
  if (!(o.flying >= 0.0 && o.flying <= 1.0)) refuse("--flying must be a share from 0 to 1");
  if (o.views < 0 || o.views > 255) refuse("--views must be 0 to 255");
  if (o.noise < 0.0 || !std::isfinite(o.noise)) refuse("--noise must not be negative");
  if (o.noise_length < 0.0 || !std::isfinite(o.noise_length)) refuse("--noise-length must not be negative");
  if (o.noise_length > 0.0 && o.noise == 0.0) refuse("--noise-length needs --noise");
  if (!(o.outliers >= 0.0 && o.outliers < 1.0)) refuse("--outliers must be a share from 0 to below 1");
  if (!(o.missing >= 0.0 && o.missing < 1.0)) refuse("--missing must be a share from 0 to below 1");
  if (o.missing_spots < 1 || o.missing_spots > 1000) refuse("--missing-spots must be 1 to 1000");
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

/// The balls in which the surface stays unseen. Their centres are samples, each as far as can be from those before;
/// one radius for all, so that they hold the share that was asked for.
class MissingSpots {
 public:
  MissingSpots(const SynthOptions& o, const SampleSource& source) {
    if (o.missing == 0.0) return;
    constexpr std::uint64_t kLookedUnits = 256;
    std::vector<Double3> looked;
    const std::uint64_t step = source.unit_count() / kLookedUnits + 1;
    SampleBatch batch;
    for (std::uint64_t unit = 0; unit < source.unit_count(); unit += step) {
      source.sample(unit, batch);
      for (std::size_t i = 0; i < batch.surface.size(); ++i)
        if (!std::isnan(batch.surface.x[i]))
          looked.push_back({batch.surface.x[i], batch.surface.y[i], batch.surface.z[i]});
    }
    if (looked.empty()) return;
    std::vector<double> distance2(looked.size(), 1e300);
    std::size_t next = static_cast<std::size_t>(to_unit(random_bits(o.seed, kMissingStream, 0)) *
                                                static_cast<double>(looked.size()));
    for (int spot = 0; spot < o.missing_spots; ++spot) {
      centres_.push_back(looked[next]);
      for (std::size_t i = 0; i < looked.size(); ++i) {
        distance2[i] = std::min(distance2[i], squared_distance(looked[i], centres_.back()));
        if (distance2[i] > distance2[next]) next = i;
      }
    }
    const auto share = static_cast<std::ptrdiff_t>(o.missing * static_cast<double>(looked.size()));
    std::nth_element(distance2.begin(), distance2.begin() + share, distance2.end());
    radius2_ = distance2[static_cast<std::size_t>(share)];
  }

  void drop(SampleBatch& batch) const {
    if (centres_.empty()) return;
    SurfaceBatch& s = batch.surface;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < s.size(); ++i) {
      const Double3 p = {s.x[i], s.y[i], s.z[i]};
      if (std::any_of(centres_.begin(), centres_.end(),
                      [&](const Double3& c) { return squared_distance(p, c) < radius2_; }))
        continue;
      for (std::vector<double>* v : {&s.x, &s.y, &s.z, &s.nx, &s.ny, &s.nz, &batch.dx, &batch.dy, &batch.dz})
        if (!v->empty()) (*v)[kept] = (*v)[i];
      batch.key[kept] = batch.key[i];
      ++kept;
    }
    for (std::vector<double>* v : {&batch.dx, &batch.dy, &batch.dz})
      if (!v->empty()) v->resize(kept);
    s.resize(kept);
    batch.key.resize(kept);
  }
  const std::vector<Double3>& centres() const { return centres_; }
  double radius() const { return std::sqrt(radius2_); }

 private:
  std::vector<Double3> centres_;
  double radius2_ = 0.0;
};

/// Gaussian noise of unit variance that is correlated over a length: a lattice of independent values, blended between its
/// nodes so that the variance is the same everywhere (K. Perlin, "An Image Synthesizer", 1985).
class CorrelatedNoise {
 public:
  CorrelatedNoise(std::uint64_t seed, double length) : seed_(seed), length_(length) {}
  double at(const Double3& p, std::size_t scan) const {
    if (!std::isfinite(p[0] + p[1] + p[2])) return 0.0;  // a ray that met nothing
    Int3 cell{};
    Double3 share{};
    for (std::size_t a = 0; a < 3; ++a) {
      const double place = p[a] / length_, low = std::floor(place), t = place - low;
      // Far beyond any scene the lattice repeats.
      cell[a] = static_cast<std::int32_t>(std::fmod(low, 1e9));
      share[a] = t * t * (3.0 - 2.0 * t);
    }
    double sum = 0.0, squares = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
      double weight = 1.0;
      std::uint64_t bits = mix(scan);
      for (std::size_t a = 0; a < 3; ++a) {
        const int side = corner >> a & 1;
        weight *= side == 1 ? share[a] : 1.0 - share[a];
        bits = mix(bits ^ static_cast<std::uint32_t>(cell[a] + side));
      }
      bits = random_bits(seed_, kCorrelatedStream, bits);
      sum += weight * gaussian(bits, mix(bits));
      squares += weight * weight;
    }
    return sum / std::sqrt(squares);
  }

 private:
  std::uint64_t seed_;
  double length_;
};

/// Adds noise, outliers, colour and shift to exact samples.
class Corrupter {
 public:
  Corrupter(const SynthOptions& o, const Scene& scene, const SynthReport& report)
      : o_(o), scene_(scene), noise_(report.noise), correlated_(o.seed, report.noise_length) {
    const Box3 box = scene.bounds();
    const Double3 margin = (box.hi - box.lo) * 0.1;
    lo_ = box.lo - margin;
    size_ = (box.hi - box.lo) * 1.2;
  }
  /// Returns how many points became outliers.
  std::uint64_t apply(const SampleBatch& batch, std::size_t scan, PointChunk& out) const {
    const SurfaceBatch& in = batch.surface;
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
      const bool along_ray = !batch.dx.empty();
      const double* dx = along_ray ? batch.dx.data() : in.nx.data();
      const double* dy = along_ray ? batch.dy.data() : in.ny.data();
      const double* dz = along_ray ? batch.dz.data() : in.nz.data();
      for (std::size_t i = 0; i < n; ++i) {
        const std::uint64_t bits = random_bits(o_.seed, kNoiseStream, batch.key[i]);
        const double d = noise_ * (o_.noise_length > 0.0 ? correlated_.at({in.x[i], in.y[i], in.z[i]}, scan)
                                                         : gaussian(bits, mix(bits)));
        out.x[i] += d * dx[i];
        out.y[i] += d * dy[i];
        out.z[i] += d * dz[i];
      }
    }
    std::uint64_t outliers = 0;
    if (o_.outliers > 0.0) {
      for (std::size_t i = 0; i < n; ++i) {
        std::uint64_t bits = random_bits(o_.seed, kOutlierStream, batch.key[i]);
        if (to_unit(bits) >= o_.outliers || std::isnan(in.x[i])) continue;
        ++outliers;
        out.x[i] = lo_[0] + size_[0] * to_unit(bits = mix(bits));
        out.y[i] = lo_[1] + size_[1] * to_unit(bits = mix(bits));
        out.z[i] = lo_[2] + size_[2] * to_unit(bits = mix(bits));
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
  CorrelatedNoise correlated_;
  Double3 lo_{}, size_{};
};

void write_truth(const SynthOptions& o, const SynthReport& report, const std::vector<ScanInfo>& scans,
                 const std::filesystem::path& path) {
  Json truth;
  truth["schema"] = 1;
  truth["scene"] = o.scene;
  truth["octaves"] = o.octaves;
  truth["mode"] = o.mode;
  truth["options"] = {{"noise", o.noise},       {"noise_in_spacings", o.noise_in_spacings},
                      {"outliers", o.outliers}, {"flying", o.flying},
                      {"normals", o.normals},   {"colour", o.colour}};
  if (o.noise_length > 0.0) {
    truth["options"]["noise_length"] = o.noise_length;
    truth["options"]["noise_length_in_spacings"] = o.noise_length_in_spacings;
  }
  if (o.missing > 0.0) truth["options"]["missing"] = {{"share", o.missing}, {"spots", o.missing_spots}};
  truth["seed"] = o.seed;
  truth["points"] = report.points;
  truth["outliers"] = report.outliers;
  truth["flying"] = report.flying;
  truth["area"] = report.area;
  truth["spacing"] = report.spacing;
  truth["noise"] = report.noise;
  truth["shift"] = o.shift;
  for (const auto& file : report.files) truth["files"].push_back(json_text(file.filename()));
  for (const ScanInfo& scan : scans) {
    if (scan.columns == 0) continue;
    truth["scans"].push_back(
        {{"origin", scan.origin + o.shift}, {"columns", scan.columns}, {"rows", scan.rows}});
  }
  OutputFile out(path);
  out.append(dump_json(truth, 2) + "\n");
  out.finish();
}

std::unique_ptr<SampleSource> make_source(const SynthOptions& o, const Scene& scene, bool gaps) {
  if (o.mode == "surface") {
    std::uint64_t points = o.points;
    if (o.spacing > 0.0) points = synth::points_for_spacing(scene, o.spacing);
    if (points == 0) throw UsageError("synth: --spacing is larger than the scene");
    return synth::sample_surface(scene, points, o.seed);
  }
  synth::SensorOptions sensor;
  sensor.kind = o.mode == "terrestrial" ? synth::SensorKind::kTerrestrial
                : o.mode == "airborne"  ? synth::SensorKind::kAirborne
                                        : synth::SensorKind::kStructuredLight;
  sensor.points = o.points;
  sensor.spacing = o.spacing;
  sensor.views = o.views;
  sensor.flying = o.flying;
  sensor.gaps = gaps;
  sensor.seed = o.seed;
  auto source = synth::sample_by_sensor(scene, sensor);
  if (!(source->spacing() > 0.0))
    throw EmptyError("synth: no ray of the sensor hits the scene; choose another --mode");
  return source;
}

/// NAME_007.EXT
std::filesystem::path scan_path(const std::filesystem::path& output, std::size_t scan) {
  std::string number = std::to_string(scan + 1);
  number.insert(0, number.size() < 3 ? 3 - number.size() : 0, '0');
  return output.parent_path() / (output.stem().string() + "_" + number + output.extension().string());
}

/// Writes the units as they come, in order, into one file or one per scan.
class ScanFiles {
 public:
  ScanFiles(const SynthOptions& o, const std::filesystem::path& output, const PointFileHeader& header,
            const std::vector<ScanInfo>& scans, SynthReport& report)
      : o_(o), output_(output), header_(header), scans_(scans), report_(report) {}
  PtxScan ptx(std::size_t scan) const {
    const ScanInfo& info = scans_[scan];
    return {info.columns, info.rows, info.origin + o_.shift};
  }
  void append(std::size_t scan, const EncodedPoints& points) {
    while (next_scan_ <= scan) open(next_scan_++);
    writer_->append(points);
  }
  void finish() {
    while (next_scan_ < scans_.size()) open(next_scan_++);
    writer_->finish();
  }

 private:
  void open(std::size_t scan) {
    if (!writer_ || o_.per_scan) {
      if (writer_) writer_->finish();
      report_.files.push_back(o_.per_scan ? scan_path(output_, scan) : output_);
      writer_ = create_point_file(report_.files.back(), header_);
    }
    writer_->begin_scan(ptx(scan));
  }

  const SynthOptions& o_;
  const std::filesystem::path& output_;
  const PointFileHeader& header_;
  const std::vector<ScanInfo>& scans_;
  SynthReport& report_;
  std::unique_ptr<PointWriter> writer_;
  std::size_t next_scan_ = 0;
};

}  // namespace

SynthReport synthesize(const SynthOptions& requested, const std::filesystem::path& output) {
  validate(requested);
  const auto start = std::chrono::steady_clock::now();
  SynthOptions o = requested;
  synth::SceneOptions scene_options{o.scene, o.octaves, o.spacing};
  if (o.spacing == 0.0) {
    // The terrain's detail follows the spacing; its area hardly depends on detail.
    scene_options.spacing = std::sqrt(1.05e6 / static_cast<double>(o.points));
  }
  if (is_mesh_scene(o.scene))
    scene_options.name = o.scene = std::filesystem::absolute(o.scene).lexically_normal().string();
  const auto scene =
      open_scene(scene_options, o.memory_bytes > 0 ? o.memory_bytes : detect_memory_cap().bytes);
  o.octaves = scene->octaves();
  const bool ptx = output.extension() == ".ptx";
  if (ptx && o.mode != "terrestrial" && o.mode != "structured-light") {
    throw UsageError(
        "synth: .ptx holds grids seen from one place: use --mode terrestrial, or write .ply, .las, .laz or "
        ".xyz");
  }
  if (ptx && o.missing > 0.0)
    throw UsageError("synth: --missing leaves no whole grids, which .ptx needs; write .ply");
  const auto source = make_source(o, *scene, ptx);
  SynthReport report;
  report.area = source->area();
  report.spacing = source->spacing();
  report.noise = o.noise_in_spacings ? o.noise * report.spacing : o.noise;
  report.noise_length = o.noise_length_in_spacings ? o.noise_length * report.spacing : o.noise_length;
  report.truth = o.per_scan ? output.parent_path() / output.stem() : output;
  report.truth += ".truth.json";
  std::vector<PlannedWrite> writes = {{report.truth, "the truth beside -o", existing_by(o.force)}};
  for (std::size_t scan = 0; scan < (o.per_scan ? source->scans().size() : 1); ++scan)
    writes.push_back({o.per_scan ? scan_path(output, scan) : output, "-o", existing_by(o.force)});
  std::vector<std::filesystem::path> read;
  if (is_mesh_scene(o.scene)) read.emplace_back(o.scene);
  check_writes(read, writes);
  const PointFileHeader header = file_header(o, report);
  const auto encoder = make_point_encoder(output, header);
  ScanFiles files(o, output, header, source->scans(), report);

  const MissingSpots missing(o, *source);
  const Corrupter corrupter(o, *scene, report);
  struct Unit {
    std::size_t scan = 0;
    std::uint64_t outliers = 0, flying = 0;
    EncodedPoints encoded;
  };
  const auto scan_of = [&](std::uint64_t unit) {
    const auto after =
        std::upper_bound(source->scans().begin(), source->scans().end(), unit,
                         [](std::uint64_t u, const ScanInfo& s) { return u < s.first_unit + s.units; });
    return static_cast<std::size_t>(after - source->scans().begin());
  };
  WorkerPool pool(o.threads);
  // Units in flight are bounded, and so is memory: a unit is at most 65,000 points.
  std::vector<Unit> ring(static_cast<std::size_t>(pool.threads()) + 1);
  const auto make = [&](std::size_t number) {
    Unit& unit = ring[number % ring.size()];
    SampleBatch batch;
    PointChunk chunk;
    unit.scan = scan_of(number);
    source->sample(number, batch);
    missing.drop(batch);
    unit.outliers = corrupter.apply(batch, unit.scan, chunk);
    unit.flying = batch.flying;
    encoder->encode(chunk, files.ptx(unit.scan), unit.encoded);
  };
  const auto write = [&](std::size_t number) {
    const Unit& unit = ring[number % ring.size()];
    files.append(unit.scan, unit.encoded);
    report.points += unit.encoded.points;
    report.outliers += unit.outliers;
    report.flying += unit.flying;
  };
  pool.run_here([&] { parallel_in_order(source->unit_count(), ring.size(), make, write); });
  files.finish();
  write_truth(o, report, source->scans(), report.truth);
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace tessera
