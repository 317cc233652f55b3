#include "kernels/certify/certificate_pair.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "kernels/certify/distance_samples.h"
#include "kernels/certify/overlay_proof.h"
#include "kernels/certify/raster_filter.h"
#include "kernels/mesh/box_mask.h"

namespace tessera {
namespace {

constexpr std::size_t kFewer = 4;         // from here on one overlay proves both ways
constexpr std::size_t kFirstSearch = 4;   // faces that are searched for the largest distance; then ever more
constexpr std::size_t kGrid = 32;         // cells an axis of the box in which faces are picked
constexpr double kProofMargin = 0x1p-11;  // of the tolerance: what is proven by more is so on any way

using Face = std::array<std::uint32_t, 3>;

BoxMask bounds_mask(const SurfaceFaces& s) {
  Double3 low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (const Double3& p : s.position)
    for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
  return BoxMask(low, high, kGrid);
}

Box3 box_of(const SurfaceFaces& s, const Face& f) {
  Box3 box{s.position[f[0]], s.position[f[0]]};
  for (const std::uint32_t v : {f[1], f[2]})
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], s.position[v][k]);
      box.high[k] = std::max(box.high[k], s.position[v][k]);
    }
  return box;
}

/// Certifies some faces of a surface, against what of the other one is near them: bounds alone.
DeviationReport certify_some(const SurfaceFaces& surface, const std::vector<std::uint32_t>& list,
                             const SurfaceFaces& other, const Box3* core, const Double3& origin,
                             CertificateOptions options, std::vector<float>& bound) {
  options.samples = 0;
  std::vector<Face> faces;
  for (const std::uint32_t i : list) faces.push_back(surface.faces[i]);
  BoxMask mask = bounds_mask(other);
  for (const Face& f : faces) {
    Box3 box = box_of(surface, f);
    for (std::size_t k = 0; k < 3; ++k) {
      if (core != nullptr) {
        box.low[k] = std::max(box.low[k], core->low[k]);
        box.high[k] = std::min(box.high[k], core->high[k]);
      }
      box.low[k] -= options.max_distance * (1.0 + 0x1p-20);
      box.high[k] += options.max_distance * (1.0 + 0x1p-20);
    }
    mask.mark(box.low, box.high);
  }
  std::vector<Face> near;
  for (const std::uint32_t f : mask.faces_that_meet(other.position, other.faces))
    near.push_back(other.faces[f]);
  return certify_deviation({surface.position, faces}, core, ClosestFaces(other.position, near, origin),
                           options, &bound);
}

/// One direction: what the overlay left open, then the mean, then the largest distances.
class Finisher {
 public:
  Finisher(const SurfaceFaces& surface, const SurfaceFaces& other, const Box3* core, const Double3& origin,
           const CertificateOptions& options, const DeviationReport& report, std::vector<float>& bound)
      : surface_(surface),
        other_(other),
        core_(core),
        origin_(origin),
        options_(options),
        report_(report),
        bound_(bound) {}

  DeviationReport run() {
    std::vector<std::uint32_t> open;
    for (std::uint32_t i = 0; i < bound_.size(); ++i)
      if (!std::isfinite(bound_[i])) open.push_back(i);
    searched_.assign(bound_.size(), false);
    if (!open.empty()) {
      const DeviationReport part = search(open);
      const double lower = report_.lower;
      report_.merge(part);
      if (part.lower > lower) report_.witness_face = open[part.witness_face];
    }
    measure_samples(surface_, other_, core_, origin_, bound_, options_, report_);
    tighten();
    report_.upper = 0.0;
    report_.faces_exceeding = 0;
    for (const float b : bound_) {
      report_.upper = std::max(report_.upper, static_cast<double>(b));
      report_.faces_exceeding += !(static_cast<double>(b) <= options_.tolerance);
    }
    return report_;
  }

 private:
  /// Until the largest bound is at most `tightness` times the largest distance found.
  void tighten() {
    for (std::size_t maximum = kFirstSearch;; maximum *= 8) {
      const double limit =
          std::max({options_.tightness * report_.lower, kMinTarget * options_.tolerance, options_.enough});
      std::vector<std::uint32_t> list;
      for (std::uint32_t i = 0; i < bound_.size(); ++i)
        if (static_cast<double>(bound_[i]) > limit && !searched_[i]) list.push_back(i);
      if (list.empty()) return;
      if (list.size() > maximum) {
        const auto end = list.begin() + static_cast<std::ptrdiff_t>(maximum);
        std::nth_element(list.begin(), end, list.end(), [&](std::uint32_t a, std::uint32_t b) {
          return bound_[a] != bound_[b] ? bound_[a] > bound_[b] : a < b;
        });
        list.erase(end, list.end());
        std::sort(list.begin(), list.end());
      }
      const DeviationReport part = search(list);
      report_.queries += part.queries;
      if (part.lower <= report_.lower) continue;
      report_.lower = part.lower;
      report_.witness = part.witness;
      report_.witness_face = list[part.witness_face];
    }
  }

  /// Searches some faces for themselves; their bounds can only fall.
  DeviationReport search(const std::vector<std::uint32_t>& list) {
    std::vector<float> bound;
    const DeviationReport report = certify_some(surface_, list, other_, core_, origin_, options_, bound);
    for (std::size_t i = 0; i < list.size(); ++i) {
      bound_[list[i]] = std::min(bound_[list[i]], bound[i]);
      searched_[list[i]] = true;
    }
    return report;
  }

  const SurfaceFaces& surface_;
  const SurfaceFaces& other_;
  const Box3* core_;
  const Double3& origin_;
  const CertificateOptions& options_;
  DeviationReport report_;
  std::vector<float>& bound_;
  std::vector<bool> searched_;
};

}  // namespace

DeviationPair certify_pair(const SurfaceFaces& a, const SurfaceFaces& b, const Box3* core,
                           const Double3& origin, const CertificateOptions& options) {
  const bool swapped = a.faces.size() > b.faces.size();
  const SurfaceFaces &coarse = swapped ? b : a, &fine = swapped ? a : b;
  DeviationPair out;
  const auto finish = [&](const SurfaceFaces& from, const SurfaceFaces& to, OverlaySide&& side,
                          std::vector<float>& bound) {
    bound = std::move(side.bound);
    return Finisher(from, to, core, origin, options, side.report, bound).run();
  };
  if (coarse.faces.empty()) {  // nothing to lay over anything
    const auto search = [&](const SurfaceFaces& from, const SurfaceFaces& to, std::vector<float>& bound) {
      return certify_deviation(from, core, ClosestFaces(to.position, to.faces, origin), options, &bound);
    };
    out.there = search(a, b, out.there_bound);
    out.back = search(b, a, out.back_bound);
    return out;
  }
  if (coarse.faces.size() * kFewer > fine.faces.size()) {
    // A face lies over several of the other surface: each surface is the coarse one once.
    const auto one_sided = [&](const SurfaceFaces& from, const SurfaceFaces& to, std::vector<float>& bound) {
      OverlaySide side =
          prove_by_overlay(from, to, core, kPairMargin * options.max_distance, origin, options, false).coarse;
      return finish(from, to, std::move(side), bound);
    };
    out.there = one_sided(a, b, out.there_bound);
    out.back = one_sided(b, a, out.back_bound);
    return out;
  }
  OverlayProof proof =
      prove_by_overlay(coarse, fine, core, kPairMargin * options.max_distance, origin, options);
  out.there = finish(a, b, std::move(swapped ? proof.fine : proof.coarse), out.there_bound);
  out.back = finish(b, a, std::move(swapped ? proof.coarse : proof.fine), out.back_bound);
  return out;
}

RasterProof prove_by_raster(const SurfaceFaces& a, const SurfaceFaces& b, const Box3& core,
                            const Double3& origin, const CertificateOptions& options) {
  RasterProof proof;
  const double pixel = raster_pixel(a, b, options.tolerance);
  CertificateOptions yes_or_no = options;
  yes_or_no.enough = yes_or_no.tolerance = options.tolerance * (1.0 - kProofMargin);
  const auto one_sided = [&](const SurfaceFaces& from, const SurfaceFaces& to) {
    RasterFilterReport report;
    std::vector<std::uint32_t> doubts =
        raster_doubts(from, core, to, origin, options.tolerance, pixel, &report);
    proof.faces += report.faces;
    proof.searched += doubts.size();
    if (doubts.empty()) return true;
    // Many of them, or large ones: laid over as certify_pair() does, the rest of the rest is searched.
    if (doubts.size() * kFewer > report.faces || from.faces.size() * kFewer <= to.faces.size()) {
      std::vector<Face> faces;
      for (const std::uint32_t f : doubts) faces.push_back(from.faces[f]);
      const OverlaySide side = prove_by_overlay({from.position, faces}, to, &core,
                                                kPairMargin * options.max_distance, origin, yes_or_no, false)
                                   .coarse;
      std::size_t left = 0;
      for (std::size_t i = 0; i < doubts.size(); ++i)
        if (!std::isfinite(side.bound[i])) doubts[left++] = doubts[i];
      doubts.resize(left);
      if (doubts.empty()) return true;
    }
    std::vector<float> bound;
    return certify_some(from, doubts, to, &core, origin, yes_or_no, bound).faces_exceeding == 0;
  };
  const bool there = one_sided(a, b);
  proof.proven = there && one_sided(b, a);
  return proof;
}

}  // namespace tessera
