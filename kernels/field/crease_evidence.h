/// \file crease_evidence.h
/// Whether the positions of noisy samples confirm a crease that their normals tell of: silhouettes of single scans and
/// scans that disagree look like one in normals alone.
#pragma once
#include "kernels/field/sheets.h"

namespace tessera {

/// The algebraic sphere around a node: f(p) = u0 + u.p + twice_u4 p.p / 2, p relative to it.
struct SmoothFit {
  float u0 = 0.0f;
  Float3 u = {0, 0, 0};
  float twice_u4 = 0.0f;
};

/// Weighted sums of the samples' squared distances, to first order. \pre samples padded
[[nodiscard]] float squared_heights(const SmoothFit& fit, const LocalSamples& samples);
[[nodiscard]] float squared_heights(const Sheets& sheets, const LocalSamples& samples);

/// The sheets of noisy samples around a node, none unless they leave much less height than the smooth fit does. Of many
/// samples a part must confirm it first.
/// \param smooth  null where there is no smooth fit  \param samples  padded  \param requested  scratch
Sheets confirmed_sheets(const NormalSeeds& seeds, const SheetOptions& options, const SmoothFit* smooth,
                        LocalSamples& samples, LocalSamples& requested);

}  // namespace tessera
