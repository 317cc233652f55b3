/// \file bend_sample.h
/// A second sample of a crease that bends, where it passes from one cell to the next: chords between the samples of cells leave
/// a rim of radius r cells by 1 / 8r, with it by a quarter of that.
/// Source: thesis 4.2.2 has one sample a cell; samples in faces are those of Ho, Wu, Chen, Chuang, Ouhyoung, "Cubical
/// Marching Squares", 2005, here in space and on curved sheets.
#pragma once
#include "kernels/extract/tangent_planes.h"

namespace tessera {

/// The crease between two samples of it.
struct CreaseSpan {
  TangentPlanes planes;  ///< of the roots of both loops, relative to one cell; weights are not read
  std::array<std::size_t, 2> beside{};  ///< a root of each sheet, on the face between the cells
  std::array<Double3, 2> end;           ///< the samples
};

/// The point of the crease beside the middle of its chord.
/// \param sheet_cos  roots whose normals open wider against both roots beside are of other sheets and do not count
/// \returns false: the chord is as near, the sheets tell of no such point, or it is none between the ends
[[nodiscard]] bool sample_bend(const CreaseSpan& span, double sheet_cos, Double3& x);

}  // namespace tessera
