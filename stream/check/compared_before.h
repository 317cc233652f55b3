/// \file compared_before.h
/// What of a comparison still holds when the mesh has changed in places.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "stream/check/compare_cells.h"

namespace tessera {

/// The cells of a comparison with an earlier state of the mesh, same reference and options. A cell of the same box within
/// reach of which no patch has changed is as far apart as it was: compare_cell() would return the same bytes.
class ComparedBefore {
 public:
  /// \param before  the earlier state \param max_distance  CompareOptions::reach, above 0
  ComparedBefore(MeshStore before, const MeshStore& reference, double max_distance, std::uint64_t cell_faces);

  std::size_t cells() const { return cells_; }
  /// Number among the cells of that comparison; -1 where there is none, or what it loaded has changed. \param now  the mesh
  std::int64_t same(const MeshStore& now, const MeshBox& cell) const;

 private:
  MeshStore before_;
  double max_distance_ = 0.0;
  double reference_diagonal_ = 0.0;
  std::size_t cells_ = 0;
  std::map<std::array<double, 6>, std::int64_t> by_box_;
};

}  // namespace tessera
