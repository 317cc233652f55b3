// How near sharp edges of a closed mesh are in what `resurface` made of it, and how well normals stand beside them.
// edge_bench INPUT RESULT H [DUMP]    H: the lattice spacing; DUMP: a text file of the samples, one a line, to look at
//   places    samples of every edge of the input that turns by more than 25 degrees, every half H: distance to the result, in H
//   normals   a quarter and half of H beside such samples, on both faces: degrees between the normals of input and result
//   settled   those samples alone that have no other such edge, of another line, nearer than 2 H
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <limits>
#include <map>

#include "kernels/mesh/closest_face.h"
#include "octree/union_find.h"
#include "octree/vector.h"
#include "tests/helpers/mesh_files.h"

namespace {

using namespace tessera;

using Triangle = std::array<std::uint32_t, 3>;
constexpr double kNoLimit = std::numeric_limits<double>::max();
constexpr double kDegrees = 57.29577951308232;

struct Mesh {
  std::vector<Double3> at;
  std::vector<Triangle> faces;
  [[nodiscard]] Double3 normal(std::uint32_t f) const {
    return unit_or_zero(triangle_normal(at[faces[f][0]], at[faces[f][1]], at[faces[f][2]]));
  }
};

/// Vertices at one place are one.
Mesh read(const char* path) {
  const test::WholeMesh whole = test::read_whole(path);
  Mesh mesh;
  std::map<Double3, std::uint32_t> index;
  std::vector<std::uint32_t> of;
  for (const Double3& p : whole.points) {
    const auto [there, added] = index.try_emplace(p, static_cast<std::uint32_t>(mesh.at.size()));
    if (added) mesh.at.push_back(p);
    of.push_back(there->second);
  }
  for (const MeshFace& f : whole.faces) {
    const Triangle t = {of[static_cast<std::size_t>(f[0])], of[static_cast<std::size_t>(f[1])],
                        of[static_cast<std::size_t>(f[2])]};
    if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) mesh.faces.push_back(t);
  }
  return mesh;
}

struct SharpEdge {
  std::uint32_t a, b;
  std::array<std::uint32_t, 2> face;
  double turn;  ///< degrees
};

std::vector<SharpEdge> sharp_edges(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::uint32_t>> faces;
  for (std::uint32_t f = 0; f < mesh.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = mesh.faces[f][k], b = mesh.faces[f][(k + 1) % 3];
      faces[std::minmax(a, b)].push_back(f);
    }
  std::vector<SharpEdge> out;
  for (const auto& [edge, beside] : faces) {
    if (beside.size() != 2) continue;
    const double cosine = dot(mesh.normal(beside[0]), mesh.normal(beside[1]));
    const double turn = kDegrees * std::acos(std::clamp(cosine, -1.0, 1.0));
    if (turn > 25.0) out.push_back({edge.first, edge.second, {beside[0], beside[1]}, turn});
  }
  return out;
}

struct Sample {
  Double3 at{};
  double turn = 0.0, off = 0.0, other = kNoLimit, normal = -1.0;
};

void tell(const char* name, std::vector<double> values) {
  std::sort(values.begin(), values.end());
  if (values.empty()) return;
  double sum = 0.0;
  for (double v : values) sum += v;
  const auto at = [&](double share) {
    return values[std::min(values.size() - 1,
                           static_cast<std::size_t>(share * static_cast<double>(values.size())))];
  };
  std::printf("%s: %zu; mean %.4f, median %.4f, 95 %% %.4f, 99 %% %.4f, largest %.4f\n", name, values.size(),
              sum / static_cast<double>(values.size()), at(0.5), at(0.95), at(0.99), at(1.0));
}

/// Lines of sharp edges: they go on through vertices where two of them meet that turn by less than 45 degrees.
std::vector<std::uint32_t> lines_of(const Mesh& mesh, const std::vector<SharpEdge>& edges) {
  std::vector<std::vector<std::uint32_t>> around(mesh.at.size());
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    around[edges[e].a].push_back(e);
    around[edges[e].b].push_back(e);
  }
  DisjointSets<std::uint32_t> sets(edges.size());
  for (std::uint32_t v = 0; v < around.size(); ++v) {
    if (around[v].size() != 2) continue;
    const auto away = [&](std::uint32_t e) {
      return unit_or_zero(mesh.at[edges[e].a == v ? edges[e].b : edges[e].a] - mesh.at[v]);
    };
    if (dot(away(around[v][0]), away(around[v][1])) < -0.7) sets.unite(around[v][0], around[v][1]);
  }
  std::vector<std::uint32_t> line(edges.size());
  for (std::uint32_t e = 0; e < edges.size(); ++e) line[e] = sets.find(e);
  return line;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 4 && argc != 5) {
    std::fprintf(stderr, "edge_bench INPUT RESULT H [DUMP]\n");
    return 2;
  }
  const Mesh input = read(argv[1]), result = read(argv[2]);
  const double h = std::atof(argv[3]);
  const Double3 origin = input.at.at(0);
  // A mesh that is inside out is turned by `resurface`.
  const auto volume = [&](const Mesh& mesh) {
    double sum = 0.0;
    for (const Triangle& t : mesh.faces)
      sum +=
          dot(mesh.at[t[0]] - input.at[0], cross(mesh.at[t[1]] - input.at[0], mesh.at[t[2]] - input.at[0]));
    return sum;
  };
  const double turned = (volume(input) < 0.0) == (volume(result) < 0.0) ? 1.0 : -1.0;
  const ClosestFaces there(result.at, result.faces, origin), here(input.at, input.faces, origin);
  const std::vector<SharpEdge> edges = sharp_edges(input);
  const std::vector<std::uint32_t> line = lines_of(input, edges);
  std::vector<Triangle> segments;
  for (const SharpEdge& e : edges) segments.push_back({e.a, e.b, e.b});
  const ClosestFaces all(input.at, segments, origin);

  std::vector<Sample> samples;
  std::vector<double> normals;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const Double3 &a = input.at[edges[e].a], &b = input.at[edges[e].b];
    const double length = norm(b - a);
    const auto count = std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(2.0 * length / h)));
    for (std::size_t i = 0; i < count; ++i) {
      // Edges far below half of H are measured where a multiple of it lies, so that fine lines count as much as coarse ones.
      if (length < 0.5 * h && (static_cast<double>(e % 97) + 0.5) / 97.0 > 2.0 * length / h) continue;
      Sample s;
      s.at = a + (b - a) * ((static_cast<double>(i) + 0.5) / static_cast<double>(count));
      s.turn = edges[e].turn;
      s.off = std::sqrt(there.closest(s.at - origin, kNoLimit, ClosestFaces::kNone).square) / h;
      for (std::uint32_t slot = 0; slot < all.size(); ++slot)
        if (line[all.face(slot)] != line[e])
          s.other = std::min(s.other, std::sqrt(all.square_to(slot, s.at - origin)) / h);
      double sum = 0.0;
      int told = 0;
      for (const std::uint32_t f : edges[e].face) {
        const Double3 n = input.normal(f);
        Double3 inwards = unit_or_zero(cross(n, b - a));
        const Double3 middle =
            (input.at[input.faces[f][0]] + input.at[input.faces[f][1]] + input.at[input.faces[f][2]]) / 3.0;
        if (dot(inwards, middle - a) < 0.0) inwards = -inwards;
        for (const double step : {0.25, 0.5}) {
          const Double3 beside = s.at + inwards * (step * h);
          const auto hit = here.closest(beside - origin, h * h, ClosestFaces::kNone);
          if (hit.slot == ClosestFaces::kNone || hit.square > 0.01 * h * h) continue;
          const Double3 truth = input.normal(here.face(hit.slot));
          if (dot(truth, n) < 0.9) continue;  // already beyond another edge
          const auto close = there.closest(beside - origin, kNoLimit, ClosestFaces::kNone);
          const Double3 made = result.normal(there.face(close.slot));
          const double off = kDegrees * std::acos(std::clamp(turned * dot(truth, made), -1.0, 1.0));
          normals.push_back(off);
          sum += off;
          ++told;
        }
      }
      if (told) s.normal = sum / told;
      samples.push_back(s);
    }
  }
  const auto offs = [&](auto&& wanted) {
    std::vector<double> out;
    for (const Sample& s : samples)
      if (wanted(s)) out.push_back(s.off);
    return out;
  };
  tell("places", offs([](const Sample&) { return true; }));
  tell("places settled", offs([](const Sample& s) { return s.other > 2.0; }));
  tell("places settled, turns above 35",
       offs([](const Sample& s) { return s.other > 2.0 && s.turn > 35.0; }));
  tell("normals", normals);
  std::vector<double> calm;
  for (const Sample& s : samples)
    if (s.other > 2.0 && s.normal >= 0.0) calm.push_back(s.normal);
  tell("normals settled", calm);
  const std::vector<double> values = offs([](const Sample&) { return true; });
  std::printf("beyond 0.02 h: %.2f %%, beyond 0.15 h: %.2f %%\n",
              100.0 *
                  static_cast<double>(
                      std::count_if(values.begin(), values.end(), [](double v) { return v > 0.02; })) /
                  static_cast<double>(values.size()),
              100.0 *
                  static_cast<double>(
                      std::count_if(values.begin(), values.end(), [](double v) { return v > 0.15; })) /
                  static_cast<double>(values.size()));
  if (argc == 5) {
    std::FILE* dump = std::fopen(argv[4], "w");
    if (!dump) throw std::runtime_error("cannot write the dump");
    for (const Sample& s : samples)
      std::fprintf(dump, "%.5f %.2f %.3f %.2f %.9g %.9g %.9g\n", s.off, s.turn, std::min(s.other, 99.0),
                   s.normal, s.at[0], s.at[1], s.at[2]);
    std::fclose(dump);
  }
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "edge_bench: %s\n", e.what());
  return 1;
}
