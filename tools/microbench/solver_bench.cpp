// One size of Laplacian systems through every solver, one JSON line each: the rows of `tools/bench solvers`.
// Each solver runs in a child process of its own, so peak memory is its own and a failure is a row.
#include <malloc.h>
#include <omp.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <fstream>
#include <functional>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "solvers/laplacian_system.h"
#include "solvers/linear_solver.h"
#include "tests/helpers/cholmod_solver.h"
#include "tests/helpers/cholmod_view.h"
#include "tests/helpers/irregular_mesh.h"
#include "tools/microbench/hypre_solver.h"
#include "tools/microbench/krylov_solver.h"
#include "tools/microbench/thread_seconds.h"

namespace {

using namespace tessera;
using nlohmann::json;

/// A line of /proc/self/status in bytes.
std::uint64_t status_bytes(const std::string& field) {
  std::ifstream in("/proc/self/status");
  for (std::string line; std::getline(in, line);)
    if (line.rfind(field + ":", 0) == 0) return std::stoull(line.substr(field.size() + 1)) * 1024;
  return 0;
}

struct Settings {
  std::size_t unknowns = 10000;
  int order = 1;
  std::string mesh = "irregular";
  std::uint64_t memory = std::uint64_t{16} << 30;
  int seconds = 120;
  double tolerance = 1e-6;
  std::vector<std::string> solvers;
};

struct System {
  Laplacian operators;
  ConstrainedSystem constrained;
  SparseMatrix neighbours;
  std::vector<Double3> positions;
  std::vector<double> b;
  mutable std::vector<double> x;  // the caller's too: not counted
  double setup_s = 0.0;
  std::size_t vertices = 0;
};

System assemble(const Settings& s) {
  // 6 sides of the border and a disk of 1.2 % are fixed.
  const auto n = static_cast<double>(s.unknowns);
  test::IrregularMeshOptions options;
  options.side = static_cast<std::size_t>(std::lround(std::sqrt(n / 0.9877) + 6.0));
  options.stretch = s.mesh == "anisotropic" ? 10.0 : 1.0;
  const test::IrregularMesh mesh = test::irregular_mesh(options);
  LaplacianOptions weights;
  if (s.mesh == "anisotropic") weights.weights = LaplacianWeights::kIntrinsicDelaunay;
  System out;
  out.vertices = mesh.positions.size();
  const double begin = thread_seconds();
  out.operators = laplacian({mesh.positions, mesh.faces}, weights);
  out.constrained = laplacian_system(out.operators, s.order, mesh.fixed);
  out.b = out.constrained.right_hand_side(mesh.target, 3);
  out.setup_s = thread_seconds() - begin;
  out.x.assign(out.b.size(), 0.0);
  out.neighbours = mesh_neighbours(out.operators, out.constrained);
  for (const std::int32_t v : out.constrained.free_vertices) out.positions.push_back(mesh.positions[v]);
  return out;
}

/// The same steps with nothing of ours around them: what the wrapper is measured against.
json bare_cholmod(const System& s) {
  json row;
  const SparseMatrix& a = s.constrained.matrix;
  const auto n = static_cast<std::size_t>(a.rows);
  omp_set_max_active_levels(0);
  cholmod_common c;
  cholmod_start(&c);
  c.print = 0;
  c.supernodal = CHOLMOD_SUPERNODAL;
  c.nmethods = 1;
  c.method[0].ordering = CHOLMOD_METIS;
  cholmod_sparse m = test::cholmod_view(a);
  const double t0 = thread_seconds();
  cholmod_factor* f = cholmod_analyze(&m, &c);
  const double t1 = thread_seconds();
  cholmod_factorize(&m, f, &c);
  const double t2 = thread_seconds();
  cholmod_dense* b = cholmod_allocate_dense(n, 3, n, CHOLMOD_REAL, &c);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < 3; ++k) static_cast<double*>(b->x)[k * n + i] = s.b[3 * i + k];
  const double t3 = thread_seconds();
  cholmod_dense* x = cholmod_solve(CHOLMOD_A, f, b, &c);
  row["analyse_s"] = t1 - t0;
  row["factor_s"] = t2 - t1;
  row["solve_s"] = thread_seconds() - t3;
  row["factor_entries"] = static_cast<std::uint64_t>(c.lnz);
  std::vector<double> result(3 * n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < 3; ++k) result[3 * i + k] = static_cast<const double*>(x->x)[k * n + i];
  row["residual"] = relative_residual(a, result, s.b, 3);
  row["status"] = "solved";
  cholmod_free_dense(&x, &c);
  cholmod_free_dense(&b, &c);
  cholmod_free_factor(&f, &c);
  cholmod_finish(&c);
  return row;
}

json through_interface(LinearSolver& solver, const System& s) {
  json row;
  const double t0 = thread_seconds();
  FactorReport f = solver.analyse(s.constrained.matrix);
  const double t1 = thread_seconds();
  row["analyse_s"] = t1 - t0;
  row["predicted_bytes"] = f.peak_bytes;
  row["factor_entries"] = f.factor_entries;
  if (f.status == SolveStatus::kSolved) {
    f = solver.factor(s.constrained.matrix);
    row["factor_s"] = thread_seconds() - t1;
    if (f.factor_entries > 0) row["factor_entries"] = f.factor_entries;
    row["held_bytes"] = f.bytes;
  }
  row["status"] = name(f.status);
  row["message"] = f.message;
  if (f.status != SolveStatus::kSolved) return row;
  std::vector<double>& x = s.x;
  const double t2 = thread_seconds();
  const SolveReport r = solver.solve(s.b, x, 3);
  row["solve_s"] = thread_seconds() - t2;
  row["residual"] = r.residual;
  row["iterations"] = r.iterations;
  row["status"] = name(r.status);
  row["message"] = r.message;
  return row;
}

/// One implicit step M - t L with everything anew and with the symbolic factor kept.
json implicit_step(const System& s) {
  const SparseMatrix first = implicit_step_matrix(s.operators, 1e-5),
                     second = implicit_step_matrix(s.operators, 2e-5);
  std::vector<double> b(s.operators.mass.size() * 3), x(b.size());
  for (std::size_t i = 0; i < b.size(); ++i)
    b[i] = s.operators.mass[i / 3] * std::sin(static_cast<double>(i));
  const auto solver = test::make_cholmod_solver();
  json row;
  const double t0 = thread_seconds();
  solver->analyse(first);
  solver->factor(first);
  solver->solve(b, x, 3);
  const double t1 = thread_seconds();
  const FactorReport f = solver->factor(second);
  const SolveReport r = solver->solve(b, x, 3);
  const double t2 = thread_seconds();
  row["status"] = name(f.status == SolveStatus::kSolved ? r.status : f.status);
  row["residual"] = r.residual;
  row["step_s"] = t1 - t0;
  row["reused_step_s"] = t2 - t1;
  row["saved"] = 1.0 - (t2 - t1) / (t1 - t0);
  return row;
}

using Run = std::function<json(const System&)>;

Run runner(const std::string& which, const Settings& s) {
  const auto options = [s](const System& system) {
    SolverOptions o;
    o.memory_bytes = s.memory;
    o.tolerance = s.tolerance;
    o.max_iterations = 1000;
    o.order = s.order;
    o.positions = system.positions;
    o.neighbours = &system.neighbours;
    return o;
  };
  const auto with = [options](SolverKind kind, Ordering ordering, MultigridCycle cycle) {
    return [=](const System& system) {
      SolverOptions o = options(system);
      o.ordering = ordering;
      o.cycle = cycle;
      return through_interface(*make_solver(kind, o), system);
    };
  };
  const auto cholmod = [options](Ordering ordering) {
    return [=](const System& system) {
      SolverOptions o = options(system);
      o.ordering = ordering;
      return through_interface(*test::make_cholmod_solver(o), system);
    };
  };
  const auto only_count = [options](Ordering ordering) {
    return [=](const System& system) {
      SolverOptions o = options(system);
      o.ordering = ordering;
      o.memory_bytes = 0;
      const FactorReport f = test::make_cholmod_solver(o)->analyse(system.constrained.matrix);
      return json{{"status", name(f.status)},
                  {"message", f.message},
                  {"factor_entries", f.factor_entries},
                  {"predicted_bytes", f.peak_bytes},
                  {"flops", f.flops}};
    };
  };
  using enum SolverKind;
  constexpr auto kFull = MultigridCycle::kFull;
  if (which == "cholesky-nd") return cholmod(Ordering::kNestedDissection);
  if (which == "cholesky-amd") return cholmod(Ordering::kMinimumDegree);
  if (which == "multigrid") return with(kMultigrid, Ordering::kAuto, kFull);
  if (which == "multigrid-v") return with(kMultigrid, Ordering::kAuto, MultigridCycle::kV);
  if (which == "multigrid-cascade") return with(kMultigrid, Ordering::kAuto, MultigridCycle::kCascading);
  if (which == "cg")
    return [options](const System& system) {
      return through_interface(*make_conjugate_gradients_solver(options(system)), system);
    };
  if (which == "hypre")
    return [options](const System& system) {
      return through_interface(*make_hypre_solver(options(system)), system);
    };
  if (which == "bare-cholmod") return bare_cholmod;
  if (which == "implicit-step") return implicit_step;
  if (which == "count-amd") return only_count(Ordering::kMinimumDegree);
  if (which == "count-nd") return only_count(Ordering::kNestedDissection);
  if (which == "count-rcm") return only_count(Ordering::kReverseCuthillMcKee);
  if (which == "count-natural") return only_count(Ordering::kNatural);
  throw CLI::ValidationError("--solvers", "unknown solver " + which);
}

/// Runs in a child with its own limits; a child that dies leaves a row that says how.
json in_child(const Settings& s, const Run& run, const System& system) {
  int channel[2];
  if (pipe(channel) != 0) throw std::runtime_error("pipe failed");
  malloc_trim(0);
  const pid_t child = fork();
  if (child == 0) {
    close(channel[0]);
    const std::uint64_t before = status_bytes("VmRSS");
    std::ofstream("/proc/self/clear_refs") << 5;  // restart the high-water mark
    const rlim_t address_space = status_bytes("VmSize") + s.memory;
    const rlimit limit{address_space, address_space};
    setrlimit(RLIMIT_AS, &limit);
    const itimerval limit_s{{0, 0}, {s.seconds, 0}};
    setitimer(ITIMER_PROF, &limit_s, nullptr);
    json row;
    try {
      row = run(system);
    } catch (const std::exception& e) {
      row = {{"status", "failed"}, {"message", e.what()}};
    }
    row["peak_bytes"] = status_bytes("VmHWM") - before;
    const std::string text = row.dump();
    const bool written = write(channel[1], text.data(), text.size()) == static_cast<ssize_t>(text.size());
    _exit(written ? 0 : 1);
  }
  close(channel[1]);
  std::string text;
  char buffer[4096];
  for (ssize_t got; (got = read(channel[0], buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(got));
  close(channel[0]);
  int state = 0;
  waitpid(child, &state, 0);
  if (!text.empty()) return json::parse(text);
  if (WIFSIGNALED(state) && WTERMSIG(state) == SIGPROF)
    return {{"status", "too slow"},
            {"message", "stopped after " + std::to_string(s.seconds) + " s of CPU time"}};
  return {{"status", "failed"}, {"message", "the child ended by signal " + std::to_string(WTERMSIG(state))}};
}

}  // namespace

int main(int argc, char** argv) {
  // Blocks above a mebibyte go back to the system when they are freed, so peaks are what is held and not what the
  // allocator keeps. A library below MPI has switched that off when it was loaded.
  mallopt(M_MMAP_MAX, 1 << 16);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 20);
  CLI::App app("Runs Laplacian systems of one size through solvers; one JSON line each.");
  Settings s;
  app.add_option("--unknowns", s.unknowns, "about so many free vertices")
      ->transform(CLI::AsNumberWithUnit(std::map<std::string, std::size_t>{{"k", 1000}, {"M", 1000000}},
                                        CLI::AsNumberWithUnit::CASE_SENSITIVE));
  app.add_option("--order", s.order, "of the Laplacian")->check(CLI::Range(1, 3));
  app.add_option("--mesh", s.mesh)->check(CLI::IsMember({"irregular", "anisotropic"}));
  app.add_option("--memory", s.memory, "bytes a solver may take")->transform(CLI::AsSizeValue(false));
  app.add_option("--seconds", s.seconds, "limit of one solver, CPU time");
  app.add_option("--tolerance", s.tolerance, "relative residual of the iterative solvers");
  app.add_option("--solvers", s.solvers, "names, in order")->delimiter(',')->required();
  CLI11_PARSE(app, argc, argv);
  try {
    for (const std::string& which : s.solvers) runner(which, s);  // names first: no work for a typing error
    const System system = assemble(s);
    for (const std::string& which : s.solvers) {
      json row = in_child(s, runner(which, s), system);
      row["solver"] = which;
      row["order"] = s.order;
      row["mesh"] = s.mesh;
      row["unknowns"] = system.constrained.matrix.rows;
      row["entries"] = system.constrained.matrix.entries();
      row["setup_s"] = system.setup_s;
      std::cout << row.dump() << std::endl;
    }
  } catch (const CLI::Error& e) {
    return app.exit(e);
  } catch (const std::exception& e) {
    std::cerr << "solver_bench: " << e.what() << "\n";
    return 70;
  }
  return 0;
}
