#include "stream/check/truth.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <fmt/format.h>

#include "kernels/scene/sample_source.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "stream/check/truth_features.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/formats/vertex_store.h"
#include "stream/meshes/scene_file.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

using synth::Scene;
using synth::SharpFeature;
using synth::SurfacePoint;

constexpr int kMantissaBits = 5;       // histogram bins per octave: 32, so 3 % wide
constexpr double kSliver = 0.03;       // of h: a vertex kept off a node by the extraction tilts thinner faces
constexpr std::size_t kBlock = 65536;  // queries answered at once
constexpr std::size_t kChunk = 1024;   // by one thread

bool finite(const Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// Answers for a block of queries, by index.
struct Answer {
  SurfacePoint truth;
  double crease = 0.0;  ///< distance of the query to the nearest crease, 1e300 without
};

void answer(const Scene& scene, const std::vector<Double3>& queries, std::vector<Answer>& answers) {
  answers.resize(queries.size());
  parallel_for((queries.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    const std::size_t end = std::min(queries.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      answers[i].truth = scene.closest(queries[i]);
      SharpFeature crease;
      answers[i].crease = scene.nearest_crease(queries[i], crease) ? crease.distance : 1e300;
    }
  });
}

/// One comparison: holds the mesh's vertices and what has been counted.
class Comparison {
 public:
  Comparison(MeshReader& mesh, const TruthFile& truth, const TruthOptions& options)
      : mesh_(mesh),
        scene_(open_scene(truth.scene, options.memory_bytes)),
        h_(options.h > 0.0 ? options.h : truth.spacing),
        o_(options),
        report_(h_),
        vertices_(options.temp.empty() ? std::filesystem::temp_directory_path() : options.temp, true,
                  options.memory_bytes),
        sharp_(cosine_of_degrees(options.sharp_angle_deg)) {
    const Double3 file_shift = mesh.header().shift;
    offset_ = file_shift - truth.shift;
    report_.spacing = truth.spacing;
    report_.noise = truth.noise;
    SharpFeature any;
    report_.has_creases = scene_->nearest_crease({}, any);
  }

  TruthReport run() {
    measure_vertices();
    NearestTracker coverage(coverage_points(), 3.0 * h_);
    NearestTracker corners(scene_->corners(), 3.0 * h_);
    measure_faces(coverage, corners);
    for (std::size_t i = 0; i < coverage.points().size(); ++i) report_.coverage.add(coverage.distance(i));
    for (std::size_t i = 0; i < corners.points().size(); ++i) report_.corners.add(corners.distance(i));
    if (report_.has_creases) measure_creases();
    return report_;
  }

 private:
  Double3 to_truth(const Double3& p) const { return p + offset_; }

  void measure_vertices() {
    std::vector<Double3> queries;
    std::vector<Answer> answers;
    double signed_sum = 0.0;
    const auto flush = [&] {
      answer(*scene_, queries, answers);
      for (std::size_t i = 0; i < queries.size(); ++i) {
        const SurfacePoint& truth = answers[i].truth;
        if (scene_->at_border(truth.position)) {
          ++report_.beyond_border;
          continue;
        }
        const Double3 off = queries[i] - truth.position;
        report_.vertices.add(norm(off));
        signed_sum += dot(off, truth.normal) < 0.0 ? -norm(off) : norm(off);
      }
      queries.clear();
    };
    mesh_.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
      vertices_.append(batch);
      for (const Double3& p : batch) {
        const Double3 q = to_truth(p);
        if (!finite(q)) continue;
        queries.push_back(q);
        if (queries.size() == kBlock) flush();
      }
    });
    flush();
    if (report_.vertices.count() > 0) {
      report_.mean_signed = signed_sum / static_cast<double>(report_.vertices.count());
    }
  }

  void measure_faces(NearestTracker& coverage, NearestTracker& corners) {
    struct Face {
      std::uint64_t corner[3];
      Double3 normal{};
      double area, altitude;
    };
    std::vector<Face> faces;
    std::vector<Double3> queries;
    std::vector<Answer> answers;
    double near_angle = 0.0, near_area = 0.0, away_angle = 0.0, away_area = 0.0;
    const auto flush = [&] {
      answer(*scene_, queries, answers);
      for (std::size_t i = 0; i < faces.size(); ++i) {
        const Face& face = faces[i];
        const SurfacePoint& truth = answers[i].truth;
        if (scene_->at_border(truth.position)) {
          ++report_.beyond_border;
          continue;
        }
        report_.centres.add(norm(queries[i] - truth.position));
        const double angle = angle_between(face.normal, truth.normal);
        const bool near = answers[i].crease <= h_;
        (near ? near_angle : away_angle) += angle * face.area;
        (near ? near_area : away_area) += face.area;
        ++(near ? report_.faces_near : report_.faces_away);
        if (answers[i].crease > 2.0 * h_) continue;
        if (face.altitude < kSliver * h_) {
          ++report_.slivers;
        } else {
          sharp_.add(face.corner, face.normal);
        }
      }
      faces.clear();
      queries.clear();
    };
    mesh_.read_faces([&](std::span<const MeshFace> batch) {
      for (const MeshFace& f : batch) {
        if (f[0] >= vertices_.size() || f[1] >= vertices_.size() || f[2] >= vertices_.size()) continue;
        const Double3 a = to_truth(vertices_.at(f[0])), b = to_truth(vertices_.at(f[1])),
                      c = to_truth(vertices_.at(f[2]));
        if (!finite(a) || !finite(b) || !finite(c)) continue;
        coverage.take(a, b, c);
        for (const Double3& p : {a, b, c}) corners.take(p, p, p);
        const Double3 n = cross(b - a, c - a);
        const double twice = norm(n);
        if (!(twice > 0.0)) continue;
        const double longest = std::max({norm(b - a), norm(c - b), norm(a - c)});
        faces.push_back({{f[0], f[1], f[2]}, n * (1.0 / twice), 0.5 * twice, twice / longest});
        queries.push_back((a + b + c) * (1.0 / 3.0));
        if (faces.size() == kBlock) flush();
      }
    });
    flush();
    constexpr double kDegrees = 180.0 / kPi;
    if (near_area > 0.0) report_.normal_near_deg = near_angle / near_area * kDegrees;
    if (away_area > 0.0) report_.normal_away_deg = away_angle / away_area * kDegrees;
  }

  void measure_creases() {
    const auto edges = sharp_.find();
    report_.sharp_edges = edges.size();
    NearestTracker truth(scene_->crease_points(0.25 * h_), 0.1 * h_);
    std::vector<std::uint64_t> ends;
    for (const auto& edge : edges) {
      ends.push_back(edge.a);
      ends.push_back(edge.b);
      const Double3 a = to_truth(vertices_.at(edge.a)), b = to_truth(vertices_.at(edge.b));
      truth.take(a, b, b);
    }
    std::sort(ends.begin(), ends.end());
    ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
    for (const std::uint64_t v : ends) {
      SharpFeature crease;
      scene_->nearest_crease(to_truth(vertices_.at(v)), crease);
      report_.sharp_vertices.add(crease.distance);
    }
    std::uint64_t found = 0;
    for (std::size_t i = 0; i < truth.points().size(); ++i) found += truth.distance(i) < 0.0999 * h_;
    if (!truth.points().empty()) {
      report_.crease_recovered = static_cast<double>(found) / static_cast<double>(truth.points().size());
    }
  }

  /// Samples of the truth that a scan could see; not those at the end of an open surface.
  std::vector<Double3> coverage_points() const {
    std::vector<Double3> points;
    if (o_.coverage_samples == 0) return points;
    const auto source = synth::sample_surface(*scene_, o_.coverage_samples, 77);
    synth::SampleBatch batch;
    const synth::Box3 box = scene_->bounds();
    const double margin = scene_->open() ? 3.0 * h_ : -1e300;
    for (std::uint64_t unit = 0; unit < source->unit_count(); ++unit) {
      source->sample(unit, batch);
      for (std::size_t i = 0; i < batch.surface.size(); ++i) {
        const Double3 p{batch.surface.x[i], batch.surface.y[i], batch.surface.z[i]};
        if (p[0] < box.lo[0] + margin || p[0] > box.hi[0] - margin || p[1] < box.lo[1] + margin ||
            p[1] > box.hi[1] - margin) {
          continue;
        }
        points.push_back(p);
      }
    }
    return points;
  }

  MeshReader& mesh_;
  std::unique_ptr<Scene> scene_;
  double h_;
  TruthOptions o_;
  TruthReport report_;
  VertexStore vertices_;
  SharpEdges sharp_;
  Double3 offset_{};
};

Json to_json(const DeviationStats& stats, double h) {
  Json j;
  j["count"] = stats.count();
  j["mean"] = stats.mean();
  j["rms"] = stats.rms();
  j["p95"] = stats.percentile(0.95);
  j["max"] = stats.max();
  j["share_beyond"] = stats.share_beyond();
  j["mean_h"] = stats.mean() / h;
  j["max_h"] = stats.max() / h;
  return j;
}

}  // namespace

TruthFile read_truth(const std::filesystem::path& path) {
  if (!std::filesystem::is_regular_file(path))
    throw InputError(path.string() + ": is no file; name the .truth.json that `tessera synth` wrote");
  const std::string text = read_text(path);
  TruthFile truth;
  try {
    const Json j = parse_json(text);
    if (j.at("schema").get<int>() != 1) {
      throw InputError(path.string() + ": schema " + dump_json(j.at("schema")) +
                       " is not known to this version");
    }
    truth.scene = {j.at("scene").get<std::string>(), j.at("octaves").get<int>(), 1.0};
    truth.spacing = j.at("spacing").get<double>();
    truth.noise = j.at("noise").get<double>();
    truth.shift = j.at("shift").get<Double3>();
  } catch (const JsonError& e) {
    throw InputError(path.string() + ": not a truth file: " + e.what());
  }
  if (!(truth.spacing > 0.0)) throw InputError(path.string() + ": spacing must be positive");
  return truth;
}

void DeviationStats::add(double distance) {
  if (histogram_.empty()) histogram_.resize(std::size_t{1} << (8 + kMantissaBits));
  ++count_;
  sum_ += distance;
  squares_ += distance * distance;
  max_ = std::max(max_, distance);
  beyond_ += distance > limit_;
  const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(distance));
  ++histogram_[bits >> (23 - kMantissaBits)];
}

double DeviationStats::rms() const {
  return count_ ? std::sqrt(squares_ / static_cast<double>(count_)) : 0.0;
}
double DeviationStats::share_beyond() const {
  return count_ ? static_cast<double>(beyond_) / static_cast<double>(count_) : 0.0;
}

double DeviationStats::percentile(double share) const {
  const double wanted = share * static_cast<double>(count_);
  std::uint64_t seen = 0;
  for (std::size_t bin = 0; bin < histogram_.size(); ++bin) {
    seen += histogram_[bin];
    if (static_cast<double>(seen) < wanted || seen == 0) continue;
    const double upper = std::bit_cast<float>(static_cast<std::uint32_t>((bin + 1) << (23 - kMantissaBits)));
    return std::min(upper, max_);
  }
  return 0.0;
}

TruthReport compare_with_truth(MeshReader& mesh, const TruthFile& truth, const TruthOptions& options) {
  WorkerPool pool(options.threads);
  Comparison comparison(mesh, truth, options);
  std::unique_ptr<TruthReport> report;
  pool.run_here([&] { report = std::make_unique<TruthReport>(comparison.run()); });
  return *report;
}

Json to_json(const TruthReport& r) {
  Json j;
  j["h"] = r.h;
  j["spacing"] = r.spacing;
  j["noise"] = r.noise;
  j["vertices"] = to_json(r.vertices, r.h);
  j["face_centres"] = to_json(r.centres, r.h);
  j["mean_signed"] = r.mean_signed;
  j["beyond_border"] = r.beyond_border;
  j["normal_deviation_away_deg"] = r.normal_away_deg;
  j["coverage"] = to_json(r.coverage, r.h);
  if (r.has_creases) {
    j["sharp_edges"] = r.sharp_edges;
    j["slivers"] = r.slivers;
    j["sharp_vertices"] = to_json(r.sharp_vertices, r.h);
    j["corners"] = to_json(r.corners, r.h);
    j["crease_recovered"] = r.crease_recovered;
    j["normal_deviation_near_deg"] = r.normal_near_deg;
    j["faces_near"] = r.faces_near;
    j["faces_away"] = r.faces_away;
  }
  return j;
}

std::string describe(const TruthReport& r) {
  const auto line = [&](const char* name, const DeviationStats& s) {
    return fmt::format(
        "{:<16} {:>10}  mean {:.4f} h  rms {:.4f} h  95% {:.4f} h  max {:.4f} h  beyond {:.2f} %\n", name,
        s.count(), s.mean() / r.h, s.rms() / r.h, s.percentile(0.95) / r.h, s.max() / r.h,
        100.0 * s.share_beyond());
  };
  std::string text =
      fmt::format("against the truth, h = {:.6g} = {:.3g} spacings (beyond: 0.02 h; coverage: h)\n", r.h,
                  r.h / r.spacing);
  text += line("vertices", r.vertices);
  text += line("face centres", r.centres);
  text += fmt::format("{:<16} {:+.5f} h", "mean, signed", r.mean_signed / r.h);
  if (r.noise > 0.0) {
    text += fmt::format(", mean {:.3f} and rms {:.3f} of the noise ({:.4g})", r.vertices.mean() / r.noise,
                        r.vertices.rms() / r.noise, r.noise);
  }
  text += "\n";
  if (r.coverage.count() > 0) text += line("truth to mesh", r.coverage);
  if (r.beyond_border > 0)
    text += fmt::format("{:<16} {:>10}  past the border of the truth, not counted\n", "", r.beyond_border);
  if (r.has_creases) {
    text += line("sharp vertices", r.sharp_vertices);
    if (r.corners.count() > 0) text += line("corners", r.corners);
    text += fmt::format(
        "{:<16} {:.2f} % of the true length within h/10 of {} sharp edges ({} slivers left out)\n", "creases",
        100.0 * r.crease_recovered, r.sharp_edges, r.slivers);
    text += fmt::format("{:<16} {:.4f} deg within h of a crease ({} faces), {:.4f} deg elsewhere ({})\n",
                        "normals, mean", r.normal_near_deg, r.faces_near, r.normal_away_deg, r.faces_away);
  } else {
    text += fmt::format("{:<16} {:.4f} deg\n", "normals, mean", r.normal_away_deg);
  }
  return text;
}

}  // namespace tessera
