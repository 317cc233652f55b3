// Speed and yield of the decimation kernel on one mesh as one block; prints one line.
// decimate_bench MESH|terrain:N [key=value]...
//   tolerance=0.1        percent of the diagonal; 0: not tested
//   cost=C               highest cost class
//   faces=N              plain run first, then the cost class that gives N faces
//   priority=quadric|probabilistic|samples|normal|round|length   placement=endpoint|optimal
//   sweep=1 feature=25 turn=0 roundness=0.02 colour=0 passes=1 certify=1 repeat=1 out=FILE.ply
//   unit=0.1             percent of the diagonal that distances are printed in when tolerance is 0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <unordered_map>

#include "kernels/certify/certificate.h"
#include "kernels/decimate/decimate.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tools/microbench/thread_seconds.h"

namespace {

using namespace tessera;

/// Welds equal positions, drops what is no 2-manifold with borders, marks the borders.
MeshBlock load(const std::string& name) {
  MeshBlock b;
  std::vector<Double3> raw;
  std::vector<std::uint32_t> colours;
  std::vector<MeshFace> faces;
  if (name.rfind("terrain:", 0) == 0) {
    const auto n = static_cast<std::uint64_t>(std::atoll(name.c_str() + 8));
    for (std::uint64_t j = 0; j < n; ++j)
      for (std::uint64_t i = 0; i < n; ++i) {
        const double x = static_cast<double>(i), y = static_cast<double>(j);
        raw.push_back(
            {x, y, 6.0 * std::sin(x / 31.0) * std::cos(y / 47.0) + 0.7 * std::sin(x / 5.0 + y / 9.0)});
        if (i + 1 == n || j + 1 == n) continue;
        const std::uint64_t a = j * n + i;
        faces.push_back({a, a + 1, a + n + 1});
        faces.push_back({a, a + n + 1, a + n});
      }
  } else {
    const auto reader = open_mesh_file(name);
    reader->read_vertices([&](std::span<const Double3> p, std::span<const std::uint32_t> c) {
      raw.insert(raw.end(), p.begin(), p.end());
      colours.insert(colours.end(), c.begin(), c.end());
    });
    reader->read_faces([&](std::span<const MeshFace> f) { faces.insert(faces.end(), f.begin(), f.end()); });
  }
  std::map<Double3, std::uint32_t> welded;
  std::vector<std::uint32_t> index(raw.size());
  for (std::size_t v = 0; v < raw.size(); ++v) {
    const auto [at, fresh] = welded.emplace(raw[v], static_cast<std::uint32_t>(b.position.size()));
    if (fresh) {
      b.position.push_back(raw[v]);
      b.key.push_back(b.key.size());
      if (!colours.empty()) b.rgba.push_back(colours[v]);
    }
    index[v] = at->second;
  }
  b.vertex_class.assign(b.position.size(), VertexClass::kSmooth);
  std::unordered_map<std::uint64_t, int> directed;
  const auto edge = [](std::uint64_t x, std::uint64_t y) { return x << 32 | y; };
  std::size_t dropped = 0;
  for (const MeshFace& f : faces) {
    const std::array<std::uint32_t, 3> t = {index[f[0]], index[f[1]], index[f[2]]};
    bool good = t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    for (std::size_t i = 0; i < 3 && good; ++i) good = directed.count(edge(t[i], t[(i + 1) % 3])) == 0;
    if (!good) {
      ++dropped;
      continue;
    }
    for (std::size_t i = 0; i < 3; ++i) directed[edge(t[i], t[(i + 1) % 3])] = 1;
    b.faces.push_back(t);
  }
  if (dropped > 0) std::printf("# %zu faces dropped\n", dropped);
  for (const auto& t : b.faces) {
    unsigned flags = 0;
    for (std::size_t i = 0; i < 3; ++i)
      if (directed.count(edge(t[(i + 1) % 3], t[i])) == 0) flags |= kFaceBorder01 << i;
    b.face_flags.push_back(static_cast<std::uint8_t>(flags));
  }
  return b;
}

void write(const MeshBlock& b, const std::string& path) {
  MeshHeader header;
  header.vertices = b.position.size();
  header.faces = b.faces.size();
  header.colour = !b.rgba.empty();
  const auto out = create_mesh_file(path, header);
  out->vertices(b.position, b.rgba);
  std::vector<MeshFace> faces;
  for (const auto& f : b.faces) faces.push_back({f[0], f[1], f[2]});
  out->faces(faces);
  out->finish();
}

/// Proven bound of the larger one-sided distance, and the largest that was found at a point.
void certify(const MeshBlock& a, const MeshBlock& b, double tolerance) {
  CertificateOptions options;
  options.tolerance = tolerance;
  options.max_distance = 4.0 * tolerance;
  options.area_unit = tolerance * tolerance;
  const SurfaceFaces sa{a.position, a.faces}, sb{b.position, b.faces};
  const ClosestFaces ca(a.position, a.faces, a.position[0]), cb(b.position, b.faces, a.position[0]);
  const DeviationReport there = certify_deviation(sa, nullptr, cb, options);
  const DeviationReport back = certify_deviation(sb, nullptr, ca, options);
  std::printf(" certified/tol %.4f (to ref %.4f, from ref %.4f; found %.4f) rms/tol %.4f",
              std::fmax(there.upper, back.upper) / tolerance, there.upper / tolerance, back.upper / tolerance,
              std::fmax(there.lower, back.lower) / tolerance, std::fmax(there.rms(), back.rms()) / tolerance);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "decimate_bench MESH|terrain:N [key=value]...; see the head of its source\n");
    return 2;
  }
  std::map<std::string, std::string> value = {
      {"tolerance", "0.1"},  {"priority", "quadric"},   {"certify", "0"}, {"unit", "0.1"},
      {"repeat", "1"},       {"placement", "endpoint"}, {"feature", "0"}, {"turn", "0"},
      {"roundness", "0.02"}, {"passes", "1"},           {"sweep", "1"},   {"faces", "0"}};
  for (int i = 2; i < argc; ++i) {
    const char* equals = std::strchr(argv[i], '=');
    if (equals) value[std::string(argv[i], static_cast<std::size_t>(equals - argv[i]))] = equals + 1;
  }
  const auto number = [&](const char* key) { return std::atof(value[key].c_str()); };
  MeshBlock original = load(argv[1]);
  Double3 low = original.position[0], high = low;
  for (const Double3& p : original.position)
    for (std::size_t a = 0; a < 3; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
  const double diagonal =
      std::sqrt((high[0] - low[0]) * (high[0] - low[0]) + (high[1] - low[1]) * (high[1] - low[1]) +
                (high[2] - low[2]) * (high[2] - low[2]));
  DecimateOptions options;
  options.tolerance = number("tolerance") / 100.0 * diagonal;
  options.feature_angle_deg = number("feature");
  options.max_normal_deviation_deg = number("turn");
  options.min_mean_ratio = number("roundness");
  options.colour_weight = number("colour") / 100.0 * diagonal;
  const std::map<std::string, DecimatePriority> priorities = {
      {"quadric", DecimatePriority::kQuadric},        {"probabilistic", DecimatePriority::kProbabilistic},
      {"samples", DecimatePriority::kSampleDistance}, {"normal", DecimatePriority::kNormalDeviation},
      {"round", DecimatePriority::kMeanRatio},        {"length", DecimatePriority::kEdgeLength}};
  options.priority = priorities.at(value["priority"]);
  options.placement =
      value["placement"] == "optimal" ? DecimatePlacement::kOptimal : DecimatePlacement::kEndpoint;
  options.sweep = number("sweep") > 0.0 && !value.count("cost") && number("faces") == 0.0;
  if (value.count("cost")) options.max_cost_class = static_cast<std::uint32_t>(number("cost"));
  const auto target = static_cast<std::uint64_t>(number("faces"));
  if (target > 0) {
    MeshBlock trial = original;
    const DecimateReport all = decimate(trial, original, options);
    options.max_cost_class = cost_class_for(all.cost_histogram, original.faces.size(), target);
  }
  MeshBlock mesh;
  for (int pass = 0; pass < static_cast<int>(number("passes")); ++pass) {
    if (pass == 0) mesh = original;
    double seconds = 1e300;
    DecimateReport r;
    const MeshBlock before = mesh;
    for (int round = 0; round < static_cast<int>(number("repeat")); ++round) {
      mesh = before;
      const double start = thread_seconds();
      r = decimate(mesh, pass == 0 ? mesh : original, options);
      seconds = std::min(seconds, thread_seconds() - start);
    }
    std::printf(
        "%s tol %s%%: %zu -> %zu faces, %.3f s, %.0f kfaces/s, bound/tol %.4f, tried %zu did %zu | link %zu "
        "fold %zu "
        "shape %zu normal %zu tolerance %zu crossing %zu | exact %zu ok %zu walked %.1f per face",
        argv[1] + (std::strrchr(argv[1], '/') ? std::strrchr(argv[1], '/') - argv[1] + 1 : 0),
        value["tolerance"].c_str(), r.faces_in, r.faces_out, seconds,
        static_cast<double>(r.faces_in) / seconds / 1000.0,
        options.tolerance > 0.0 ? r.bound / options.tolerance : r.bound / diagonal, r.candidates, r.collapses,
        r.by_link, r.by_fold, r.by_shape, r.by_normal, r.by_tolerance, r.by_crossing, r.exact_tests,
        r.exact_accepted, static_cast<double>(r.reference_faces_walked) / static_cast<double>(r.faces_in));
    if (number("certify") > 0.0)
      certify(mesh, original,
              options.tolerance > 0.0 ? options.tolerance : number("unit") / 100.0 * diagonal);
    std::printf("\n");
  }
  if (value.count("out")) write(mesh, value["out"]);
  return 0;
}
