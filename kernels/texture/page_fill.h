/// \file page_fill.h
/// Colours for the texels of a page that no chart has.
#pragma once
#include <cstdint>
#include <vector>

namespace tessera {

/// Gives texels without a colour (alpha 0) that of what lies around them: means of ever larger squares of texels that have
/// one ("push" and "pull", Gortler et al. 1996), in whole numbers. Then all have one, and coarse levels of a mip map mix the
/// colours of charts with nothing but colours like them. Without any colour all become grey.
/// \param rgba  rows of `width`; takes a third more memory \pre width and height are powers of two
void fill_page(std::vector<std::uint32_t>& rgba, std::uint32_t width, std::uint32_t height);

}  // namespace tessera
