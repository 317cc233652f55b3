/// \file mesh_compare.h
/// How far two meshes of any size are apart, proven, both ways: the independent check that a result stays
/// within a tolerance of its reference. Space is cut into cells by what both meshes hold; each cell is loaded
/// with all that lies within reach of it, and every face is measured cell by cell, so a face may span any
/// number of cells.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "kernels/certify/certificate.h"
#include "stream/files/json.h"
#include "stream/meshes/failed_regions.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/options.h"

namespace tessera {

class MemoryBudget;
class WorkerPool;

/// How the tolerance is proven.
enum class CompareMethod {
  kExact,   ///< the certificate, with all distances
  kRaster,  ///< yes or no: what a raster settles is settled, the rest is searched
  kAuto,    ///< yes or no, on the way that takes less time on the fullest cell
};

struct CompareOptions {
  double tolerance = 0.0;     ///< scan units, > 0
  double max_distance = 0.0;  ///< distances up to here are told; 0 = twice the tolerance
  CompareMethod method = CompareMethod::kExact;
  std::uint64_t cell_faces = 1u << 16;  ///< of both meshes together; part of the result, like `tolerance`
  std::function<void()> check_stop;     ///< may throw StoppedError; any thread; may be empty

  /// \throws UsageError when the tolerance is not a number above 0
  void validate() const;
};

/// From one mesh to the other.
struct DirectedDeviation {
  DeviationReport surface;
  DeviationReport border;  ///< border curve to border curve; area and histogram count lengths
};

/// What yes-or-no ways took on the fullest cell, CPU microseconds a face; 0: not measured. Not part of any report.
struct CompareSpeed {
  double raster_us = 0.0, exact_us = 0.0;
  bool by_raster = false;  ///< the way taken
  double searched = 0.0;   ///< share of the faces that the raster left in doubt
};

struct MeshComparison {
  double tolerance = 0.0, max_distance = 0.0;
  double diagonal = 0.0;            ///< of the reference
  std::uint64_t faces[2] = {0, 0};  ///< of the mesh, of the reference
  DirectedDeviation there;          ///< mesh to reference
  DirectedDeviation back;           ///< reference to mesh
  std::uint64_t cells = 0;
  /// Yes or no was asked: surfaces were measured in those cells alone that are not proven, borders in all.
  bool yes_or_no = false;
  std::uint64_t cells_proven = 0;  ///< with yes_or_no, of those with a face
  CompareSpeed speed;
  double seconds = 0.0;         ///< of the comparison
  double import_seconds = 0.0;  ///< of reading both files into stores

  double upper() const;         ///< both ways; infinite when something is beyond reach. \pre  !yes_or_no
  bool proven() const;          ///< surfaces stay within the tolerance both ways
  bool borders_proven() const;  ///< so do the border curves
  /// Why it is not proven, one sentence with a place; empty when it is.
  std::string complaint(bool with_borders) const;
};

/// \throws ValidationError when nobody can prove so small a tolerance, since a face is too large for it: told
///   before any work; reads the mesh only where its box leaves doubt
void require_provable(const MeshStore& mesh, double tolerance);

/// One cell of space (compare_cells.h).
struct CellComparison {
  DirectedDeviation there, back;
};

/// What compare_meshes does, for those who run the cells themselves: begin, then every cell, then add in any order.
MeshComparison begin_comparison(const MeshStore& mesh, const MeshStore& reference,
                                const CompareOptions& options);
/// \param begun   of begin_comparison
/// \param enough  bounds up to here need not be tight
/// \param failed  gets every face of either mesh that is not proven; may be null
/// \param check_stop  as in the options
CellComparison compare_cell(const MeshStore& mesh, const MeshStore& reference, const MeshComparison& begun,
                            const MeshBox& cell, double enough, std::vector<FailedFace>* failed = nullptr,
                            const std::function<void()>& check_stop = {});
void add_cell(MeshComparison& sum, const CellComparison& cell);

/// A cell when yes or no is asked: borders are measured, surfaces where they are not proven.
struct CellAnswer {
  bool proven = false;
  std::uint64_t faces = 0;     ///< in the cell, of both meshes; the same on either way
  std::uint64_t searched = 0;  ///< that the raster left in doubt
  double us = 0.0;             ///< CPU, for the proof alone
  CellComparison measured;     ///< where it is proven: of borders alone
};
/// \param by_raster  by the raster first, and by the certificate where that does not prove the cell; else by the
///   certificate at once. The answer is the same.
CellAnswer answer_cell(const MeshStore& mesh, const MeshStore& reference, const MeshComparison& begun,
                       const MeshBox& cell, bool by_raster, const std::function<void()>& check_stop = {});

/// Of a cell, mesh to reference and back.
struct CellBounds {
  std::array<double, 2> upper = {0, 0}, lower = {0, 0};
  CellBounds() = default;
  explicit CellBounds(const CellComparison& cell);
};
/// Compares some cells once more, CertificateOptions::enough given; what it returns is in the order asked for.
using CompareAgain =
    std::function<std::vector<CellBounds>(std::span<const std::size_t> which, double enough)>;
/// After every cell was compared with enough = tolerance: the bound of the whole is tight when none lies above what was found
/// anywhere. Asks for cells that do, the largest first, one, then two, four ... (kTightenAtOnce at most) at a time, since what is
/// found in one ends the search in others: a cell need not be searched below it. A pure function of the bounds, which it updates.
inline constexpr std::size_t kTightenAtOnce = 64;
void tighten_cells(std::vector<CellBounds>& cells, double tolerance, const CompareAgain& again);

/// \post  depends on the two meshes and the options alone, not on threads and budget; where yes or no was asked, not on
///   the way either, but for `speed`. What it says then it says with kExact too
/// \throws ResourceError when the budget cannot hold the fullest cell, naming the cap that would do
MeshComparison compare_meshes(const MeshStore& mesh, const MeshStore& reference,
                              const CompareOptions& options, WorkerPool& pool, MemoryBudget& budget);

/// Imports both files into a scratch folder in run.temp and compares them within run.memory_bytes on
/// run.threads (both > 0). \throws InputError, EmptyError, ResourceError, StoppedError
MeshComparison compare_mesh_files(const std::filesystem::path& mesh, const std::filesystem::path& reference,
                                  const CompareOptions& options, const RunOptions& run);

Json to_json(const MeshComparison& comparison);
std::string describe(const MeshComparison& comparison);

}  // namespace tessera
