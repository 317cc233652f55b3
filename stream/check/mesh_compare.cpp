#include "stream/check/mesh_compare.h"

#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/certify/certificate_pair.h"
#include "kernels/certify/raster_filter.h"
#include "kernels/mesh/flat_faces.h"
#include "octree/error.h"
#include "stream/check/compare_cells.h"
#include "stream/files/scratch_folder.h"
#include "stream/import/import_mesh.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

/// Of the bound of the whole to what was found anywhere. Decimation works to 1 / 1.03 of the tolerance, so a larger share
/// would have nearly every cell that it filled compared again.
constexpr double kWholeTightness = 1.05;

/// Points of a cell at which distances are measured for the mean. One cell alone tells it to about a hundredth; where
/// there are many they do so together, some twenty thousand to half a percent.
constexpr std::size_t kMaxSamples = 1u << 14, kMinSamples = 1u << 6;
constexpr std::uint64_t kFacesAtMost = 1u << 15;  ///< of the reference: up to here a cell gets the most

/// Where the surface ends, as segments.
std::vector<std::array<std::uint32_t, 3>> border_segments(const MeshBlock& block) {
  std::vector<std::array<std::uint32_t, 3>> segments;
  for (std::size_t f = 0; f < block.faces.size(); ++f) {
    if ((block.face_flags[f] & 7) == 0) continue;  // as nearly all
    for (std::size_t c = 0; c < 3; ++c)
      if (block.face_flags[f] >> c & 1) {
        const std::uint32_t end = block.faces[f][(c + 1) % 3];
        segments.push_back({block.faces[f][c], end, end});
      }
  }
  return segments;
}

void merge(DirectedDeviation& into, const DirectedDeviation& part) {
  into.surface.merge(part.surface);
  into.border.merge(part.border);
}

CertificateOptions certificate_options(const MeshStore& mesh, const MeshStore& reference,
                                       const MeshComparison& begun) {
  CertificateOptions certificate;
  certificate.tolerance = begun.tolerance;
  certificate.max_distance = begun.max_distance;
  // The larger box has at most 2^15 of its diagonals squared of area; 2^62 units hold them.
  const double scale = std::max(mesh.diagonal(), reference.diagonal());
  certificate.area_unit = scale > 0.0 ? scale * scale * 0x1p-47 : 1.0;
  // By the reference alone: what a round before found in a cell then is what this one would find.
  certificate.samples =
      std::clamp<std::size_t>(kMaxSamples * kFacesAtMost / std::max<std::uint64_t>(1, reference.face_count()),
                              kMinSamples, kMaxSamples);
  return certificate;
}

/// Both meshes around a cell.
struct LoadedCell {
  LoadedCell(const MeshStore& mesh, const MeshStore& reference, const MeshBox& box, double max_distance)
      : a(mesh.load_box(grown(box, kCompareHalo * max_distance))),
        b(reference.load_box(grown(box, kCompareHalo * max_distance))),
        core{box.low, box.high} {
    drop_flat_islands(a), drop_flat_islands(b);  // lines, which decimation takes out
    for (std::size_t k = 0; k < 3; ++k) middle[k] = 0.5 * (box.low[k] + box.high[k]);
  }
  DeviationPair surfaces(const CertificateOptions& options) const {
    return certify_pair({a.position, a.faces}, {b.position, b.faces}, &core, middle, options);
  }
  DeviationReport border(const MeshBlock& of, const MeshBlock& to, CertificateOptions options) const {
    options.enough = 0.0;
    return certify_deviation({of.position, border_segments(of)}, &core,
                             ClosestFaces(to.position, border_segments(to), middle), options);
  }

  MeshBlock a, b;
  Box3 core;
  Double3 middle;
};

double thread_us() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

/// Faces whose box meets the core.
std::uint64_t faces_in(const MeshBlock& block, const Box3& core) {
  std::uint64_t count = 0;
  for (const auto& f : block.faces) {
    const Double3 &a = block.position[f[0]], &b = block.position[f[1]], &c = block.position[f[2]];
    bool in = true;
    for (std::size_t k = 0; k < 3; ++k)
      in = in && std::min({a[k], b[k], c[k]}) <= core.high[k] && std::max({a[k], b[k], c[k]}) >= core.low[k];
    count += in;
  }
  return count;
}

}  // namespace

void CompareOptions::validate() const {
  if (!(tolerance > 0.0) || !std::isfinite(tolerance))
    throw UsageError("--tolerance " + number_text(tolerance) +
                     ": must be a length above 0 in the unit of the mesh");
  if (max_distance != 0.0 && !(max_distance >= tolerance))
    throw UsageError("reach: must be at least the tolerance");
}

void require_provable(const MeshStore& mesh, double tolerance) {
  double widest = 0.0;
  for (std::size_t k = 0; k < 3; ++k) widest = std::max(widest, mesh.box().high[k] - mesh.box().low[k]);
  if (mesh.patches().empty() || tolerance >= certificate_rounding(widest)) return;  // as nearly always
  // Of a long face some corner is half as far from the middle of any cell that it meets.
  double longest = 0.0;
  for (std::size_t p = 0; p < mesh.patches().size(); ++p) {
    const MeshBlock block = mesh.load(std::array{p});
    for (const auto& f : block.faces)
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t k = 0; k < 3; ++k)
          longest = std::max(longest, std::abs(block.position[f[c]][k] - block.position[f[(c + 1) % 3]][k]));
  }
  const double minimum = certificate_rounding(0.5 * longest);
  if (tolerance >= minimum) return;
  throw ValidationError("a tolerance of " + number_text(tolerance) + " cannot be proven: a face is " +
                        number_text(longest) + " long, on which distances are told to " +
                        number_text(minimum) + " only: remove such faces, or give a larger --tolerance");
}

MeshComparison begin_comparison(const MeshStore& mesh, const MeshStore& reference,
                                const CompareOptions& options) {
  options.validate();
  require_provable(mesh, options.tolerance);
  require_provable(reference, options.tolerance);
  MeshComparison out;
  out.tolerance = options.tolerance;
  out.max_distance = options.max_distance != 0.0 ? options.max_distance : 2.0 * options.tolerance;
  out.diagonal = reference.diagonal();
  out.faces[0] = mesh.face_count();
  out.faces[1] = reference.face_count();
  return out;
}

CellComparison compare_cell(const MeshStore& mesh, const MeshStore& reference, const MeshComparison& begun,
                            const MeshBox& box, double enough, std::vector<FailedFace>* failed,
                            const std::function<void()>& check_stop) {
  CertificateOptions options = certificate_options(mesh, reference, begun);
  options.check_stop = check_stop;
  options.enough = enough;
  const LoadedCell cell(mesh, reference, box, options.max_distance);
  const DeviationPair surface = cell.surfaces(options);
  const auto name_failed = [&](const MeshBlock& of, const DeviationReport& report,
                               const std::vector<float>& bound) {
    if (failed == nullptr || report.faces_exceeding == 0) return;
    for (std::size_t f = 0; f < bound.size(); ++f)
      if (!(static_cast<double>(bound[f]) <= options.tolerance))
        failed->push_back(
            {of.position[of.faces[f][0]], of.position[of.faces[f][1]], of.position[of.faces[f][2]]});
  };
  name_failed(cell.a, surface.there, surface.there_bound);
  name_failed(cell.b, surface.back, surface.back_bound);
  CellComparison result;
  result.there = {surface.there, cell.border(cell.a, cell.b, options)};
  result.back = {surface.back, cell.border(cell.b, cell.a, options)};
  return result;
}

CellAnswer answer_cell(const MeshStore& mesh, const MeshStore& reference, const MeshComparison& begun,
                       const MeshBox& box, bool by_raster, const std::function<void()>& check_stop) {
  CertificateOptions options = certificate_options(mesh, reference, begun);
  options.check_stop = check_stop;
  options.enough = options.tolerance;
  const LoadedCell cell(mesh, reference, box, options.max_distance);
  CellAnswer answer;
  answer.faces = faces_in(cell.a, cell.core) + faces_in(cell.b, cell.core);
  answer.measured.there.border = cell.border(cell.a, cell.b, options);
  answer.measured.back.border = cell.border(cell.b, cell.a, options);
  const double start = thread_us();
  if (by_raster) {
    const RasterProof proof = prove_by_raster(
        {cell.a.position, cell.a.faces}, {cell.b.position, cell.b.faces}, cell.core, cell.middle, options);
    answer.proven = proof.proven;
    answer.searched = proof.searched;
  }
  if (!answer.proven) {
    const DeviationPair surface = cell.surfaces(options);
    answer.proven = surface.there.upper <= options.tolerance && surface.back.upper <= options.tolerance;
    if (!answer.proven) {
      answer.measured.there.surface = surface.there;
      answer.measured.back.surface = surface.back;
    }
  }
  answer.us = thread_us() - start;
  return answer;
}

void add_cell(MeshComparison& sum, const CellComparison& cell) {
  merge(sum.there, cell.there);
  merge(sum.back, cell.back);
  ++sum.cells;
}

CellBounds::CellBounds(const CellComparison& cell)
    : upper{cell.there.surface.upper, cell.back.surface.upper},
      lower{cell.there.surface.lower, cell.back.surface.lower} {}

void tighten_cells(std::vector<CellBounds>& cells, double tolerance, const CompareAgain& again) {
  std::array<double, 2> lower = {0, 0}, target = {0, 0};
  const auto raise = [&](const CellBounds& c) {
    for (std::size_t side = 0; side < 2; ++side) {
      lower[side] = std::max(lower[side], c.lower[side]);
      target[side] = std::max(kWholeTightness * lower[side], kMinTarget * tolerance);
    }
  };
  for (const CellBounds& c : cells) raise(c);
  std::vector<bool> searched(cells.size());
  for (std::size_t at_once = 1;; at_once = std::min(2 * at_once, kTightenAtOnce)) {
    struct Above {
      double upper = 0.0;
      double enough = std::numeric_limits<double>::infinity();
      std::size_t cell;
    };
    std::vector<Above> above;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      Above a{.cell = i};
      for (std::size_t side = 0; side < 2; ++side) {
        // What is above the tolerance was searched to the end.
        const double u = cells[i].upper[side];
        if (searched[i] || u > tolerance || u <= target[side]) continue;
        a.upper = std::max(a.upper, u);
        a.enough = std::min(a.enough, target[side]);
      }
      if (a.upper > 0.0) above.push_back(a);
    }
    if (above.empty()) return;
    const auto end = above.begin() + static_cast<std::ptrdiff_t>(std::min(above.size(), at_once));
    std::partial_sort(above.begin(), end, above.end(), [](const Above& a, const Above& b) {
      return a.upper != b.upper ? a.upper > b.upper : a.cell < b.cell;
    });
    std::vector<std::size_t> which;
    double enough = std::numeric_limits<double>::infinity();
    for (auto a = above.begin(); a != end; ++a) {
      which.push_back(a->cell);
      enough = std::min(enough, a->enough);
    }
    const std::vector<CellBounds> found = again(which, enough);
    for (std::size_t k = 0; k < which.size(); ++k) {
      cells[which[k]] = found[k];
      searched[which[k]] = true;
      raise(found[k]);
    }
  }
}

namespace {

/// Answers every cell yes or no; what the fullest one tells of both ways decides where kAuto is asked.
void answer_cells(const MeshStore& mesh, const MeshStore& reference, const CompareOptions& options,
                  const std::vector<CompareCell>& cells, WorkerPool& pool, MemoryBudget& budget,
                  MeshComparison& out) {
  const auto bytes = [&](std::size_t i) { return cells[i].bytes + raster_filter_bytes(cells[i].faces); };
  std::vector<CellAnswer> answers(cells.size());
  const auto answer = [&](std::size_t i, bool by_raster) {
    if (options.check_stop) options.check_stop();
    return answer_cell(mesh, reference, out, cells[i].box, by_raster, options.check_stop);
  };
  out.speed.by_raster = options.method == CompareMethod::kRaster;
  std::size_t fullest = cells.size();
  if (options.method == CompareMethod::kAuto && !cells.empty()) {
    fullest = 0;
    for (std::size_t i = 1; i < cells.size(); ++i)
      if (cells[i].faces > cells[fullest].faces) fullest = i;
    pool.run_tasks(
        1, [&](std::size_t) { return bytes(fullest); }, budget,
        [&](std::size_t) {
          const CellAnswer exact = answer(fullest, false);
          answers[fullest] = answer(fullest, true);
          const double faces = static_cast<double>(std::max<std::uint64_t>(1, exact.faces));
          out.speed.exact_us = exact.us / faces;
          out.speed.raster_us = answers[fullest].us / faces;
          out.speed.by_raster = out.speed.raster_us <= out.speed.exact_us;
        });
  }
  pool.run_tasks(cells.size(), bytes, budget, [&](std::size_t i) {
    if (i != fullest) answers[i] = answer(i, out.speed.by_raster);
  });
  out.yes_or_no = true;
  double faces = 0.0, searched = 0.0;
  for (const CellAnswer& a : answers) {
    add_cell(out, a.measured);
    out.cells_proven += a.proven && a.faces > 0;
    faces += static_cast<double>(a.faces);
    searched += static_cast<double>(a.searched);
  }
  if (faces > 0.0) out.speed.searched = searched / faces;
}

}  // namespace

MeshComparison compare_meshes(const MeshStore& mesh, const MeshStore& reference,
                              const CompareOptions& options, WorkerPool& pool, MemoryBudget& budget) {
  const auto start = std::chrono::steady_clock::now();
  MeshComparison out = begin_comparison(mesh, reference, options);
  const std::vector<CompareCell> cells =
      make_compare_cells(mesh, reference, out.max_distance, options.cell_faces);
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  if (options.method != CompareMethod::kExact) {
    answer_cells(mesh, reference, options, cells, pool, budget, out);
    out.seconds = seconds();
    return out;
  }
  std::vector<CellComparison> results(cells.size());
  pool.run_tasks(
      cells.size(), [&](std::size_t i) { return cells[i].bytes; }, budget,
      [&](std::size_t i) {
        if (options.check_stop) options.check_stop();
        results[i] =
            compare_cell(mesh, reference, out, cells[i].box, out.tolerance, nullptr, options.check_stop);
      });
  std::vector<CellBounds> bounds(results.begin(), results.end());
  tighten_cells(bounds, out.tolerance, [&](std::span<const std::size_t> which, double enough) {
    std::vector<CellBounds> found(which.size());
    pool.run_tasks(
        which.size(), [&](std::size_t k) { return cells[which[k]].bytes; }, budget,
        [&](std::size_t k) {
          if (options.check_stop) options.check_stop();
          CellComparison& result = results[which[k]];
          result =
              compare_cell(mesh, reference, out, cells[which[k]].box, enough, nullptr, options.check_stop);
          found[k] = CellBounds(result);
        });
    return found;
  });
  for (const CellComparison& result : results) add_cell(out, result);
  out.seconds = seconds();
  return out;
}

MeshComparison compare_mesh_files(const std::filesystem::path& mesh, const std::filesystem::path& reference,
                                  const CompareOptions& options, const RunOptions& run) {
  options.validate();
  const ScratchFolder scratch(run.temp, "compare");
  const auto start = std::chrono::steady_clock::now();
  const MeshStore a = import_mesh(mesh, scratch.path(), "mesh", run, options.check_stop);
  const MeshStore b = import_mesh(reference, scratch.path(), "reference", run, options.check_stop);
  const std::chrono::duration<double> imported = std::chrono::steady_clock::now() - start;
  WorkerPool pool(run.threads);
  MemoryBudget budget(run.memory_bytes, resident_bytes());
  MeshComparison comparison = compare_meshes(a, b, options, pool, budget);
  comparison.import_seconds = imported.count();
  return comparison;
}

}  // namespace tessera
