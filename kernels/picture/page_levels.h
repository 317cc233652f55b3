/// \file page_levels.h
/// Coarser levels of a page of textures, for a mip map.
#pragma once
#include "kernels/picture/picture.h"

namespace tessera {

/// Halves both sides, rounded down and at least 1, in place: every texel becomes the mean of the area that it stands for, in linear
/// light (the square of what is stored), in whole numbers. \pre both sides are at most 16384
void halve_page(Image& page);

}  // namespace tessera
