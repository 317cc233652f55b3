/// \file texture_option.h
/// `--texture` of jobs whose result gets textures (stages/bake).
#pragma once
#include <string>

#include "stream/runtime/option_table.h"

namespace tessera {

inline constexpr double kAutoTexture = -1.0;  ///< texels as wide as the points ask for

/// \param from  where colours come from: "the points"
void add_texture(OptionTable& table, double& texture, const std::string& from);

}  // namespace tessera
