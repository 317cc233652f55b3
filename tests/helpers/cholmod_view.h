/// \file cholmod_view.h
/// A symmetric sparse matrix as CHOLMOD reads it. Brings in CHOLMOD's header: for the few .cpp files that call it.
#pragma once
#include <cholmod.h>

#include <cstdint>

#include "solvers/sparse_matrix.h"

namespace tessera::test {

/// The upper triangle of `a` without a copy. Compressed rows of a symmetric matrix are its compressed columns, and
/// CHOLMOD never writes to them.
/// \pre symmetric, columns ascending in each row; `a` outlives the view
inline cholmod_sparse cholmod_view(const SparseMatrix& a) {
  cholmod_sparse v{};
  v.nrow = v.ncol = static_cast<std::size_t>(a.rows);
  v.nzmax = a.entries();
  v.p = const_cast<std::int32_t*>(a.start.data());
  v.i = const_cast<std::int32_t*>(a.column.data());
  v.x = const_cast<double*>(a.value.data());
  v.stype = 1;
  v.itype = CHOLMOD_INT;
  v.xtype = CHOLMOD_REAL;
  v.dtype = CHOLMOD_DOUBLE;
  v.sorted = 1;
  v.packed = 1;
  return v;
}

}  // namespace tessera::test
