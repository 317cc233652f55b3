/// \file conjugate_gradients.h
/// Preconditioned conjugate gradients on several columns at once, each with its own coefficients.
/// Source: Barrett et al. 1994, "Templates", 2.3.1.
#pragma once
#include <cmath>
#include <span>
#include <vector>

#include "solvers/multigrid_cycle.h"

namespace tessera {

struct ConjugateGradientsResult {
  int iterations = 0;
  double residual = 0.0;  ///< as updated: the caller measures the true one
  bool converged = false;
  bool breakdown = false;  ///< x^T A x was not positive: A is not positive definite, or numbers overflowed
};

/// Improves x from its current value. apply(u, v) makes v = A u. `r` holds b - A x on entry and the residual at
/// the end; `z` and `p` are scratch of the same size. precondition() reads r and writes z; z is free otherwise.
/// \param norms  2-norm of each right-hand side; a column with norm 0 is left alone
template <int kWidth, class Apply, class Precondition>
ConjugateGradientsResult conjugate_gradients(Apply apply, std::vector<double>& r, std::span<double> x,
                                             std::vector<double>& z, std::vector<double>& p,
                                             const Columns<kWidth>& norms, double tolerance,
                                             int max_iterations, Precondition precondition) {
  ConjugateGradientsResult out;
  Columns<kWidth> rho{};
  p.assign(r.size(), 0.0);
  for (;; ++out.iterations) {
    const Columns<kWidth> rr = dots<kWidth>(r, r);
    out.residual = 0.0;
    for (int c = 0; c < kWidth; ++c) {
      const double relative = norms[c] > 0.0 ? std::sqrt(rr[c]) / norms[c] : 0.0;
      if (!(relative <= out.residual)) out.residual = relative;
    }
    if (out.residual <= tolerance) out.converged = true;
    if (!std::isfinite(out.residual)) out.breakdown = true;
    if (out.converged || out.breakdown || out.iterations >= max_iterations) return out;
    precondition();
    const Columns<kWidth> rz = dots<kWidth>(r, z);
    Columns<kWidth> factor{};
    for (int c = 0; c < kWidth; ++c) factor[c] = rho[c] > 0.0 ? rz[c] / rho[c] : 0.0;
    rho = rz;
    for (std::size_t i = 0; i < p.size(); i += kWidth)
      for (int c = 0; c < kWidth; ++c) p[i + c] = z[i + c] + factor[c] * p[i + c];
    apply(p, z);
    const Columns<kWidth> pap = dots<kWidth>(p, z);
    for (int c = 0; c < kWidth; ++c) {
      factor[c] = pap[c] > 0.0 ? rho[c] / pap[c] : 0.0;
      out.breakdown =
          out.breakdown || (!(pap[c] > 0.0) && rr[c] > tolerance * tolerance * norms[c] * norms[c]);
    }
    for (std::size_t i = 0; i < p.size(); i += kWidth)
      for (int c = 0; c < kWidth; ++c) {
        x[i + c] += factor[c] * p[i + c];
        r[i + c] -= factor[c] * z[i + c];
      }
    if (out.breakdown) return out;
  }
}

}  // namespace tessera
