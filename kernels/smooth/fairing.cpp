#include "kernels/smooth/fairing.h"

#include <algorithm>
#include <string>

#include "octree/error.h"
#include "solvers/laplacian_system.h"

namespace tessera {
namespace {

/// The part of a mesh that a system reads, with its own numbers.
struct Part {
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint32_t> vertex;  ///< number in the whole mesh, ascending
  std::vector<std::uint8_t> fixed;
};

/// All faces within `rings` rings of the free vertices.
Part part_around(std::span<const Double3> position, FaceSpan faces, std::span<const std::uint8_t> region,
                 int rings) {
  std::vector<std::uint8_t> reached(region.begin(), region.end());
  std::vector<std::uint8_t> taken(faces.size(), 0);
  for (int ring = 0; ring < rings; ++ring) {
    std::vector<std::uint8_t> next = reached;
    for (std::size_t f = 0; f < faces.size(); ++f) {
      const auto& face = faces[f];
      if (reached[face[0]] == 0 && reached[face[1]] == 0 && reached[face[2]] == 0) continue;
      taken[f] = 1;
      for (const std::uint32_t v : face) next[v] = 1;
    }
    reached.swap(next);
  }
  Part part;
  std::vector<std::uint32_t> number(position.size(), 0);
  for (std::uint32_t v = 0; v < position.size(); ++v) {
    if (reached[v] == 0) continue;
    number[v] = static_cast<std::uint32_t>(part.vertex.size());
    part.vertex.push_back(v);
    part.position.push_back(position[v]);
    part.fixed.push_back(region[v] == 0);
  }
  for (std::size_t f = 0; f < faces.size(); ++f)
    if (taken[f] != 0) part.faces.push_back({number[faces[f][0]], number[faces[f][1]], number[faces[f][2]]});
  return part;
}

/// Systems of a sequence with the same pattern, one after the other: analysed the first time only.
class Sequence {
 public:
  Sequence(SolverKind kind, int order, std::uint64_t memory_bytes) : kind_(kind) {
    options_.prefer_direct = true;
    options_.order = order;
    options_.memory_bytes = memory_bytes;
    options_.neighbours = &neighbours_;
  }

  /// Moves the free vertices to the solution. \return whether there was one; else the report says why not
  bool solve(const Laplacian& lap, const ConstrainedSystem& system, std::vector<Double3>& position,
             std::span<const double> load, FairingReport& report) {
    report.unknowns = system.free_vertices.size();
    at_.resize(report.unknowns);
    for (std::size_t i = 0; i < at_.size(); ++i)
      at_[i] = position[static_cast<std::size_t>(system.free_vertices[i])];
    neighbours_ = mesh_neighbours(lap, system);
    if (!solver_) {
      options_.positions = at_;
      solver_ = make_solver(kind_, options_);
      report.factor = solver_->analyse(system.matrix);
      report.choice = report.factor.choice;
    }
    if (report.factor.status == SolveStatus::kSolved) report.factor = solver_->factor(system.matrix);
    if (report.factor.status != SolveStatus::kSolved) return false;
    const std::span<double> values(position.front().data(), 3 * position.size());
    const std::vector<double> b = system.right_hand_side(values, 3, load);
    std::vector<double> x(b.size());
    report.solve = solver_->solve(b, x, 3);
    if (report.solve.status != SolveStatus::kSolved) return false;
    system.scatter(x, values, 3);
    return true;
  }

 private:
  SolverKind kind_;
  SolverOptions options_;
  std::vector<Double3> at_;  ///< of the unknowns; like neighbours_ read by the solver when it factors
  SparseMatrix neighbours_;
  std::unique_ptr<LinearSolver> solver_;
};

void require_sizes(std::size_t positions, std::size_t flags, int order, int largest_order, int rounds) {
  if (flags != positions)
    throw UsageError(std::to_string(flags) + " flags for " + std::to_string(positions) + " vertices");
  if (order < 1 || order > largest_order)
    throw UsageError("an energy of order " + std::to_string(order) + " is not supported: use 1 to " +
                     std::to_string(largest_order));
  if (rounds < 1) throw UsageError("at least one round is needed");
}

}  // namespace

FairingReport fair_region(std::span<Double3> position, FaceSpan faces, std::span<const std::uint8_t> region,
                          const FairingOptions& options) {
  require_sizes(position.size(), region.size(), options.order, 3, options.rounds);
  if (std::count(region.begin(), region.end(), 0) == static_cast<std::ptrdiff_t>(region.size()))
    throw UsageError("the region to fair has no vertex");
  Part part = part_around(position, faces, region, options.order);
  Sequence sequence(SolverKind::kAutomatic, options.order, options.memory_bytes);
  FairingReport report;
  for (int round = 0; round < options.rounds; ++round) {
    const bool blind = round == 0 && options.ignore_geometry_first;
    const Laplacian lap = laplacian({part.position, part.faces},
                                    {.weights = blind ? LaplacianWeights::kUniform : options.weights});
    report.degenerate_faces = lap.report.degenerate_faces;
    const ConstrainedSystem system = laplacian_system(lap, options.order, part.fixed);
    if (round == 0) {
      const std::vector<std::int32_t> loose = unconstrained_pieces(system);
      if (!loose.empty()) {
        report.solve.status = SolveStatus::kSingular;
        report.solve.message = std::to_string(loose.size()) +
                               " piece(s) of the region see no fixed vertex, one holds vertex " +
                               std::to_string(part.vertex[static_cast<std::size_t>(loose.front())]);
        return report;
      }
    }
    if (!sequence.solve(lap, system, part.position, {}, report)) return report;
  }
  for (std::size_t v = 0; v < part.vertex.size(); ++v)
    if (part.fixed[v] == 0) position[part.vertex[v]] = part.position[v];
  return report;
}

}  // namespace tessera
