#include "tools/microbench/hypre_solver.h"

#include <HYPRE.h>
#include <HYPRE_IJ_mv.h>
#include <HYPRE_parcsr_ls.h>
#include <mpi.h>

#include <cstdlib>
#include <numeric>
#include <string>
#include <vector>

namespace tessera {
namespace {

class HypreSolver final : public LinearSolver {
 public:
  explicit HypreSolver(const SolverOptions& options) : options_(options) {
    int started = 0;
    MPI_Initialized(&started);
    if (!started) {
      setenv("OMPI_MCA_btl", "self", 0);  // one process: no transport
      MPI_Init(nullptr, nullptr);
      HYPRE_Init();
    }
  }
  ~HypreSolver() override {
    if (amg_ != nullptr) HYPRE_BoomerAMGDestroy(amg_);
    if (matrix_ != nullptr) HYPRE_IJMatrixDestroy(matrix_);
  }

  FactorReport analyse(const SparseMatrix&) override { return {}; }

  FactorReport factor(const SparseMatrix& a) override {
    source_ = &a;
    HYPRE_IJMatrixCreate(MPI_COMM_SELF, 0, a.rows - 1, 0, a.rows - 1, &matrix_);
    HYPRE_IJMatrixSetObjectType(matrix_, HYPRE_PARCSR);
    std::vector<HYPRE_Int> count(static_cast<std::size_t>(a.rows));
    std::vector<HYPRE_BigInt> row(count.size());
    std::iota(row.begin(), row.end(), 0);
    for (std::int32_t i = 0; i < a.rows; ++i) count[i] = a.start[i + 1] - a.start[i];
    HYPRE_IJMatrixSetRowSizes(matrix_, count.data());
    HYPRE_IJMatrixInitialize(matrix_);
    HYPRE_IJMatrixSetValues(matrix_, a.rows, count.data(), row.data(), a.column.data(), a.value.data());
    HYPRE_IJMatrixAssemble(matrix_);
    void* object = nullptr;
    HYPRE_IJMatrixGetObject(matrix_, &object);
    csr_ = static_cast<HYPRE_ParCSRMatrix>(object);
    HYPRE_BoomerAMGCreate(&amg_);
    HYPRE_BoomerAMGSetPrintLevel(amg_, 0);
    HYPRE_BoomerAMGSetCoarsenType(amg_, 10);  // HMIS
    HYPRE_BoomerAMGSetInterpType(amg_, 6);    // extended+i
    HYPRE_BoomerAMGSetPMaxElmts(amg_, 4);
    HYPRE_BoomerAMGSetRelaxType(amg_, 6);  // symmetric Gauss-Seidel
    HYPRE_BoomerAMGSetStrongThreshold(amg_, 0.25);
    HYPRE_BoomerAMGSetMaxIter(amg_, 1);
    HYPRE_BoomerAMGSetTol(amg_, 0.0);
    HYPRE_BoomerAMGSetup(amg_, csr_, nullptr, nullptr);
    FactorReport report;
    if (HYPRE_GetError() != 0) {
      HYPRE_ClearAllErrors();
      report.status = SolveStatus::kSingular;
      report.message = "BoomerAMG found no hierarchy";
    }
    return report;
  }

  SolveReport solve(std::span<const double> b, std::span<double> x, int width) override {
    SolveReport report;
    const auto w = static_cast<std::size_t>(width);
    const std::size_t n = b.size() / w;
    std::vector<double> column(n);
    std::vector<HYPRE_BigInt> row(n);
    std::iota(row.begin(), row.end(), 0);
    HYPRE_IJVector bv = vector_of(n), xv = vector_of(n);
    void *bo = nullptr, *xo = nullptr;
    HYPRE_IJVectorGetObject(bv, &bo);
    HYPRE_IJVectorGetObject(xv, &xo);
    HYPRE_Solver pcg = nullptr;
    HYPRE_ParCSRPCGCreate(MPI_COMM_SELF, &pcg);
    HYPRE_PCGSetMaxIter(pcg, options_.max_iterations);
    HYPRE_PCGSetTol(pcg, options_.tolerance);
    HYPRE_PCGSetTwoNorm(pcg, 1);
    HYPRE_PCGSetPrecond(pcg, reinterpret_cast<HYPRE_PtrToSolverFcn>(HYPRE_BoomerAMGSolve),
                        reinterpret_cast<HYPRE_PtrToSolverFcn>(HYPRE_BoomerAMGSetup), amg_);
    const auto count = static_cast<HYPRE_Int>(n);
    for (std::size_t c = 0; c < w; ++c) {
      for (std::size_t i = 0; i < n; ++i) column[i] = b[i * w + c];
      HYPRE_IJVectorSetValues(bv, count, row.data(), column.data());
      HYPRE_ParVectorSetConstantValues(static_cast<HYPRE_ParVector>(xo), 0.0);
      if (c == 0)
        HYPRE_ParCSRPCGSetup(pcg, csr_, static_cast<HYPRE_ParVector>(bo), static_cast<HYPRE_ParVector>(xo));
      HYPRE_ParCSRPCGSolve(pcg, csr_, static_cast<HYPRE_ParVector>(bo), static_cast<HYPRE_ParVector>(xo));
      HYPRE_ClearAllErrors();
      HYPRE_Int iterations = 0;
      HYPRE_PCGGetNumIterations(pcg, &iterations);
      report.iterations = std::max(report.iterations, static_cast<int>(iterations));
      HYPRE_IJVectorGetValues(xv, count, row.data(), column.data());
      for (std::size_t i = 0; i < n; ++i) x[i * w + c] = column[i];
    }
    HYPRE_ParCSRPCGDestroy(pcg);
    HYPRE_IJVectorDestroy(bv);
    HYPRE_IJVectorDestroy(xv);
    report.residual = relative_residual(*source_, x, b, width);
    if (!(report.residual <= 10.0 * options_.tolerance)) {
      report.status = SolveStatus::kNotConverged;
      report.message = "BoomerAMG did not converge in " + std::to_string(report.iterations) + " cycles";
    }
    return report;
  }

 private:
  static HYPRE_IJVector vector_of(std::size_t n) {
    HYPRE_IJVector v = nullptr;
    HYPRE_IJVectorCreate(MPI_COMM_SELF, 0, static_cast<HYPRE_BigInt>(n) - 1, &v);
    HYPRE_IJVectorSetObjectType(v, HYPRE_PARCSR);
    HYPRE_IJVectorInitialize(v);
    HYPRE_IJVectorAssemble(v);
    return v;
  }

  SolverOptions options_;
  const SparseMatrix* source_ = nullptr;
  HYPRE_IJMatrix matrix_ = nullptr;
  HYPRE_ParCSRMatrix csr_ = nullptr;
  HYPRE_Solver amg_ = nullptr;
};

}  // namespace

std::unique_ptr<LinearSolver> make_hypre_solver(const SolverOptions& options) {
  return std::make_unique<HypreSolver>(options);
}

}  // namespace tessera
