#include "kernels/smooth/smooth.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/smooth/curvature_flow.h"
#include "kernels/smooth/flipped_faces.h"
#include "octree/error.h"

namespace tessera {
namespace {

/// Rows applied in one round of an explicit method: a halo of 32 rings still costs less than another pass over the
/// mesh.
constexpr int kExplicitRings = 32;
constexpr double kImplicitAccuracy = 1e-3;
/// Largest Chebyshev degree that a halo can carry.
constexpr int kLargestDegree = 400;
/// From this degree on an implicit step takes a coarse level: three short filters cost less than a long one.
constexpr int kCoarseDegree = 64;
constexpr double kLargestLambda = 1e9;

/// Operators, systems and multigrid of a curvature flow at their peak, by order: measured on 2 10^5 to 2 10^6 vertices.
constexpr std::uint64_t kFlowBytesPerVertex[] = {900, 1000};

bool one_of(const std::string& value, std::initializer_list<const char*> names) {
  return std::any_of(names.begin(), names.end(), [&](const char* name) { return value == name; });
}

double default_lambda(const std::string& method) {
  if (method == "laplacian") return 0.5;
  if (method == "bilaplacian") return 0.25;
  if (method == "taubin") return 0.5;
  // What fits leave is small; a stronger step would round creases that they made.
  if (method == "curvature-flow" || method == "denoise") return 1.0;
  return 10.0;
}

int used_order(const SmoothOptions& options) {
  return options.order > 0 ? options.order : options.method == "denoise" ? 2 : 1;
}

SmoothRound filter_round(const SmoothOptions& options, FilterKind kind, double lambda, int degree) {
  SmoothRound round;
  round.rows.weights = options.weights == "uniform" ? LaplaceWeights::kUniform : LaplaceWeights::kCotangent;
  round.rows.feature_angle_deg = options.feature_angle_deg;
  round.filter.kind = kind;
  round.filter.lambda = lambda;
  // The pass band ends where the factor of both half steps is 1: 1/lambda + 1/mu = 0.1 (Taubin 1995).
  round.filter.mu = 1.0 / (0.1 - 1.0 / lambda);
  round.filter.order = used_order(options);
  round.filter.degree = degree;
  return round;
}

/// Whether a step of the method takes a coarse level.
bool takes_coarse_level(const SmoothOptions& options, double lambda) {
  return (options.method == "implicit" || options.method == "denoise") && options.degree == 0 &&
         chebyshev_degree(lambda, used_order(options), kImplicitAccuracy) >= kCoarseDegree;
}

SmoothRound normal_round(const SmoothOptions& options) {
  SmoothRound round;
  round.by_normals = options.method == "bilateral";
  round.by_fits = options.method == "denoise";
  round.noise = options.noise;
  round.normals.normal_rounds = options.normal_rounds;
  round.normals.vertex_rounds = options.vertex_rounds;
  // Two faces of a crease must lie two deviations apart, or every round takes the edge off a little more.
  if (options.feature_angle_deg > 0.0)
    round.normals.range_angle_deg = std::min(round.normals.range_angle_deg, 0.5 * options.feature_angle_deg);
  return round;
}

void add_explicit(std::vector<SmoothRound>& rounds, const SmoothOptions& options, FilterKind kind,
                  double lambda) {
  const int longest = kind == FilterKind::kLaplacian ? kExplicitRings : kExplicitRings / 2;
  for (int done = 0; done < options.steps; done += longest)
    rounds.push_back(filter_round(options, kind, lambda, std::min(longest, options.steps - done)));
}

void require(bool good, const std::string& sentence) {
  if (!good) throw UsageError(sentence);
}

}  // namespace

void SmoothOptions::validate() const {
  require(one_of(method, {"implicit", "laplacian", "bilaplacian", "taubin", "bilateral", "denoise",
                          "curvature-flow"}),
          "method " + method +
              ": not one of implicit, laplacian, bilaplacian, taubin, bilateral, denoise, curvature-flow");
  require(one_of(weights, {"cotangent", "uniform"}),
          "weights " + weights + ": not one of cotangent, uniform");
  require(steps >= 1 && steps <= 1000, "steps " + std::to_string(steps) + ": must be 1 to 1000");
  require(order >= 0 && order <= 2,
          "order " + std::to_string(order) + ": must be 1, 2, or 0 for the method's own");
  require(degree >= 0 && degree <= kLargestDegree,
          "degree " + std::to_string(degree) + ": must be 0 to " + std::to_string(kLargestDegree));
  require(normal_rounds >= 1 && normal_rounds <= 100 && vertex_rounds >= 1 && vertex_rounds <= 100,
          "rounds on normals and on vertices must be 1 to 100");
  require(std::isfinite(noise) && noise >= 0.0, "noise must not be negative");
  require(std::isfinite(tolerance) && tolerance >= 0.0, "tolerance must not be negative");
  require(feature_angle_deg >= 0.0 && feature_angle_deg < 180.0,
          "the feature angle must be 0 to 180 degrees");
  require(std::isfinite(lambda) && lambda >= 0.0, "lambda must not be negative");
  // Beyond these an explicit step blows noise up: the spectrum of the Laplacian reaches 2.
  if (method == "laplacian" || method == "taubin")
    require(lambda <= 1.0, "lambda must be at most 1 for " + method);
  if (method == "bilaplacian") require(lambda <= 0.5, "lambda must be at most 0.5 for bilaplacian");
  if ((method == "implicit" || method == "denoise") && degree == 0) {
    const double used = lambda > 0.0 ? lambda : default_lambda(method);
    require(used <= kLargestLambda, "lambda must be at most 1e9");
  }
}

std::vector<SmoothRound> smooth_rounds(const SmoothOptions& options) {
  options.validate();
  const double lambda = options.lambda > 0.0 ? options.lambda : default_lambda(options.method);
  const int degree = options.degree > 0 ? options.degree
                     : takes_coarse_level(options, lambda)
                         ? 1
                         : chebyshev_degree(lambda, used_order(options), kImplicitAccuracy);
  std::vector<SmoothRound> rounds;
  if (options.method == "laplacian") {
    add_explicit(rounds, options, FilterKind::kLaplacian, lambda);
  } else if (options.method == "bilaplacian") {
    add_explicit(rounds, options, FilterKind::kBilaplacian, lambda);
  } else if (options.method == "taubin") {
    add_explicit(rounds, options, FilterKind::kTaubin, lambda);
  } else if (options.method == "curvature-flow") {
    rounds.push_back(filter_round(options, FilterKind::kImplicit, lambda, options.steps));
    rounds.back().by_flow = true;
  } else {
    for (int step = 0; step < options.steps; ++step) {
      if (options.method != "implicit") rounds.push_back(normal_round(options));
      if (options.method == "bilateral") continue;
      const bool coarse = takes_coarse_level(options, lambda);
      for (int cycle = 0; cycle < (coarse ? kCoarseCycles : 1); ++cycle) {
        rounds.push_back(filter_round(options, FilterKind::kImplicit, lambda, degree));
        if (coarse) rounds.back().cycle = cycle;
        rounds.back().unflips = options.method == "denoise" && !coarse;
      }
    }
  }
  return rounds;
}

namespace {

DenoiseOptions denoise_options(const SmoothRound& round) {
  return {round.normals, round.noise};
}

}  // namespace

int round_rings(const SmoothRound& round) {
  if (round.by_flow) return 1;
  if (round.by_fits) return denoise_rings(denoise_options(round));
  if (round.by_normals) return filter_rings(round.normals);
  return filter_rings(round.filter) + (round.unflips ? kUnflipRings : 0);
}

double round_edges(const SmoothRound& round) {
  if (round.by_fits) return denoise_edges(denoise_options(round));
  return round.unflips ? round_rings(round) : 0.0;
}

namespace {

/// The step of a flow that smooths as much as the implicit filter of this strength: on a regular mesh of edge h
/// the normalised Laplacian is h^2 / 4 times that of the surface.
double flow_step(const MeshBlock& block, const FilterOptions& options) {
  double sum = 0.0;
  for (const auto& face : block.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 &p = block.position[face[k]], &q = block.position[face[(k + 1) % 3]];
      const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
      sum += x * x + y * y + z * z;
    }
  const double unit = 0.25 * sum / (3.0 * static_cast<double>(block.faces.size()));
  return options.lambda * (options.order == 1 ? unit : unit * unit);
}

std::vector<Double3> flow(const MeshBlock& block, const SurfaceRows& rows, const SmoothRound& round,
                          SmoothCounts& counts) {
  std::vector<Double3> position = block.position;
  std::vector<std::uint8_t> fixed(position.size());
  for (std::size_t v = 0; v < fixed.size(); ++v) fixed[v] = rows.role[v] != VertexRole::kFree;
  if (std::count(fixed.begin(), fixed.end(), 0) == 0) return position;
  FlowOptions options;
  options.step = flow_step(block, round.filter);
  options.steps = round.filter.degree;
  options.order = round.filter.order;
  options.direct = false;
  if (round.rows.weights == LaplaceWeights::kUniform) options.weights = LaplacianWeights::kUniform;
  if (!(options.step > 0.0)) throw InputError("no edge has a length: there is nothing to smooth");
  const FlowReport report = curvature_flow(position, block.faces, fixed, options);
  counts.flow_systems = report.systems;
  counts.faces_as_one = report.faces_as_one;
  if (report.folding_faces > 0) {
    const Double3& p = block.position[block.faces[report.first_folding][0]];
    throw ValidationError("the curvature flow folds " + std::to_string(report.folding_faces) +
                          " face(s) over, however short its steps, the first at (" + std::to_string(p[0]) +
                          ", " + std::to_string(p[1]) + ", " + std::to_string(p[2]) +
                          "): parts thinner than what it smooths away vanish; take a smaller lambda, order 2 "
                          "or method implicit");
  }
  const std::string& why = report.factor.message.empty() ? report.solve.message : report.factor.message;
  if (!report.done()) throw InputError("the curvature flow has no solution: " + why);
  return position;
}

/// Counts what is right; what is not stays.
void finish(const MeshBlock& block, SurfaceRows& rows, SmoothedBlock& out) {
  out.counts.degenerate_faces = rows.degenerate_faces;
  for (std::size_t v = 0; v < rows.role.size(); ++v) {
    if (out.complete[v] == 0) {
      out.position[v] = block.position[v];
      continue;
    }
    ++out.counts.vertices;
    out.counts.line += rows.role[v] == VertexRole::kLine;
    out.counts.fixed += rows.role[v] == VertexRole::kFixed;
  }
  out.role = std::move(rows.role);
}

}  // namespace

SmoothedBlock smooth_block(const MeshBlock& block, const SmoothRound& round,
                           std::span<const std::uint8_t> wanted) {
  SmoothedBlock out;
  const FaceCorners corners(block);
  SurfaceRows rows = make_surface_rows(block, corners, round.rows);
  // Fits tell by themselves what they hang on.
  out.complete = complete_rings(block, corners, rows, round.by_fits ? 1 : round_rings(round));
  const std::vector<std::uint8_t> whole = round.by_fits ? out.complete : std::vector<std::uint8_t>();
  for (std::size_t v = 0; v < wanted.size(); ++v) out.complete[v] &= wanted[v];
  if (round.by_normals) {
    out.position = filter_by_normals(block, corners, round.normals);
  } else if (round.by_fits) {
    DenoisedBlock found = denoise(block, corners, denoise_options(round), whole, out.complete);
    out.position = std::move(found.position);
    for (std::size_t v = 0; v < whole.size(); ++v) out.complete[v] &= found.right[v];
  } else if (round.by_flow) {
    out.position = flow(block, rows, round, out.counts);
  } else {
    out.position = block.position;
    std::vector<std::uint8_t> filtered = out.complete;
    if (round.unflips) {
      // Those around what is wanted too, since faces there may turn back.
      for (std::uint8_t& flag : filtered) flag = flag == 0;
      erode(block, corners, kUnflipRings, filtered);
      for (std::uint8_t& flag : filtered) flag = flag == 0;
    }
    const std::vector<Displacement> moved =
        filter_surface(rows, block.position, round.filter, filtered).moved;
    for (std::size_t v = 0; v < moved.size(); ++v)
      for (std::size_t a = 0; a < 3; ++a) out.position[v][a] += static_cast<double>(moved[v].xyz[a]);
    if (round.unflips) unflip_faces(block, corners, out.position);
  }
  finish(block, rows, out);
  return out;
}

SmoothedBlock smooth_cycle(const MeshBlock& block, std::span<const Double3> now,
                           std::span<const Float3> laplacian, const SmoothRound& round,
                           const CoarseOptions& coarse, const CoarseSolution& solution,
                           std::span<const std::uint8_t> wanted) {
  SmoothedBlock out;
  const FaceCorners corners(block);
  SurfaceRows rows = make_surface_rows(block, corners, round.rows);
  FilterOptions filter = round.filter;
  filter.degree = coarse.degree;
  filter.lowest = coarse.lowest;
  const bool plate = coarse.order == 2;
  out.complete = complete_rings(block, corners, rows, filter_rings(filter));
  FilterState start;
  start.moved.resize(block.position.size());
  start.laplacian.resize(plate ? block.position.size() : 0);
  {
    CoarseBasis basis = make_coarse_basis(block, rows, coarse);
    std::vector<std::size_t> slot(basis.name.size());
    for (std::size_t i = 0, at = 0; i < slot.size(); ++i) {
      at = static_cast<std::size_t>(std::lower_bound(solution.name.begin() + static_cast<std::ptrdiff_t>(at),
                                                     solution.name.end(), basis.name[i]) -
                                    solution.name.begin());
      slot[i] = at;
    }
    for (std::size_t v = 0; v < start.moved.size(); ++v) {
      CoarseValue d;
      for (std::size_t a = 0; a < 3; ++a) {
        d.moved[a] = now[v][a] - block.position[v][a];
        if (!laplacian.empty()) d.laplacian[a] = static_cast<double>(laplacian[v][a]);
      }
      basis.for_unknowns(static_cast<std::uint32_t>(v), [&](std::uint32_t u, double w) {
        // Right, and yet beyond what was asked for: the solution may not have it.
        if (basis.right[v] == 0 || slot[u] == solution.name.size() ||
            solution.name[slot[u]] != basis.name[u]) {
          basis.right[v] = 0;
          return;
        }
        const CoarseValue& value = solution.value[slot[u]];
        for (std::size_t a = 0; a < 3; ++a) {
          d.moved[a] += w * value.moved[a];
          d.laplacian[a] += w * value.laplacian[a];
        }
      });
      for (std::size_t a = 0; a < 3; ++a) {
        start.moved[v].xyz[a] = static_cast<float>(d.moved[a]);
        if (plate) start.laplacian[v].xyz[a] = static_cast<float>(d.laplacian[a]);
      }
    }
    erode(block, corners, filter.degree, basis.right);
    for (std::size_t v = 0; v < now.size(); ++v) out.complete[v] &= basis.right[v];
  }
  for (std::size_t v = 0; v < wanted.size(); ++v) out.complete[v] &= wanted[v];
  out.position = block.position;
  const FilterState end = filter_surface(rows, block.position, filter, out.complete, start);
  out.laplacian.resize(end.laplacian.size());
  for (std::size_t v = 0; v < end.moved.size(); ++v)
    for (std::size_t a = 0; a < 3; ++a) {
      out.position[v][a] += static_cast<double>(end.moved[v].xyz[a]);
      if (plate) out.laplacian[v][a] = end.laplacian[v].xyz[a];
    }
  finish(block, rows, out);
  return out;
}

Double3 limit_move(const Double3& from, const Double3& to, double tolerance, bool floats) {
  const auto placed = [&](double share) {
    Double3 p;
    for (std::size_t a = 0; a < 3; ++a) {
      p[a] = share == 1.0 ? to[a] : from[a] + (to[a] - from[a]) * share;
      if (floats) p[a] = static_cast<double>(static_cast<float>(p[a]));
    }
    return p;
  };
  const auto distance = [&](const Double3& p) {
    const double x = p[0] - from[0], y = p[1] - from[1], z = p[2] - from[2];
    return std::sqrt(x * x + y * y + z * z);
  };
  Double3 p = placed(1.0);
  if (!(tolerance > 0.0) || !(distance(p) > tolerance)) return p;
  // Rounding may leave the shortened way a little too long: shorten on, at last stay.
  const double share = tolerance / distance(to) < 1.0 ? tolerance / distance(to) : 1.0;
  for (int k = 0; k < 24; ++k) {
    p = placed(share * (1.0 - (k == 0 ? 0.0 : 0x1p-24 * static_cast<double>(1 << k))));
    if (distance(p) <= tolerance) return p;
  }
  return from;
}

std::uint64_t smooth_bytes(std::uint64_t vertices, std::uint64_t faces, const SmoothRound& round) {
  // Rows: 9 bytes a vertex, 8 bytes a directed edge, of which there are 3 a face and 1 a border vertex.
  const std::uint64_t rows = 17 * vertices + 24 * faces;
  // They are made from marks, corners and shapes; then rings are counted and the filter runs.
  const std::uint64_t corners = 4 * vertices + 12 * faces;
  const std::uint64_t making = 4 * vertices + 24 * faces + corners;
  const std::uint64_t filter =
      corners + (round.by_normals ? 48 * vertices + normal_bytes(faces)
                 : round.by_fits  ? denoise_bytes(vertices, faces)
                 : round.by_flow  ? kFlowBytesPerVertex[round.filter.order - 1] * vertices
                                  : 20 * vertices + filter_window_bytes(vertices, round_rings(round)));
  // A cycle starts from 16 bytes a vertex, of order 2 from 32 and ends with 28 more, and before it filters it has the
  // basis and the place of its unknowns.
  const std::uint64_t cycle = round.cycle < 0 ? 0 : (round.filter.order == 2 ? 60 : 16) * vertices;
  const std::uint64_t basis =
      round.cycle < 0 ? 0 : corners + coarse_basis_bytes(vertices) + 8 * kCoarseCorners * vertices;
  return rows + std::max({making, cycle + filter, cycle + basis}) + 26 * vertices + (1u << 16);
}

}  // namespace tessera
