/// \file solvers.h
/// The floor solvers in one include: sparse matrices, Laplacians of meshes, direct and iterative solvers whose bits are the same on
/// any machine. Installed as <tessera/solvers.h>, target Tessera::solvers.
#pragma once
#include "solvers/intrinsic_delaunay.h"
#include "solvers/laplacian.h"
#include "solvers/laplacian_system.h"
#include "solvers/linear_solver.h"
#include "solvers/sparse_matrix.h"
