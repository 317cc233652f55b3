/// \file full_page.h
/// All charts of a job on one page that they fill: texels as fine as fit.
#pragma once
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "kernels/texture/chart_packing.h"
#include "stream/runtime/stage.h"
#include "stream/stages/bake/bake_options.h"

namespace tessera {

struct FullPage {
  double texel_scale = 1.0;  ///< of the texels that the charts were cut for
  ChartPacking packing;
};

/// Bisects over widths of texels, two in a hundred of the area apart; for one page of any width of texels (`one_page`), else of
/// texels hardly wider than they were, on the smallest page that may hold the charts.
/// \param files  of charts, in the order of their blocks \param cells  of all masks at the width that they were cut for
/// \param finest  scale of texels that are automatic, at least
/// \returns nothing where the charts need more than a page, or the width of texels was given
std::optional<FullPage> fill_one_page(std::span<const std::filesystem::path> files, double cells,
                                      const BakeOptions& options, double finest, TaskContext& context);

}  // namespace tessera
