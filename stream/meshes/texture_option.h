/// \file texture_option.h
/// `--texture` of jobs whose result gets textures (stages/bake), and `--colour-tolerance` of those whose vertices keep their colours.
#pragma once
#include <string>

#include "stream/runtime/option_table.h"

namespace tessera {

inline constexpr double kAutoTexture = -1.0;  ///< texels as wide as the points ask for

/// \param from  where colours come from: "the points"
void add_texture(OptionTable& table, double& texture, const std::string& from);
/// `--normal-map` beside it. \param of  whose directions: "the mesh of full resolution"
void add_normal_map(OptionTable& table, bool& normal_map, const std::string& of);
/// `--colour-tolerance` of decimation. \param unless  when `auto` is none: "0 with --texture"
void add_colour_tolerance(OptionTable& table, double& levels, const std::string& unless);
/// \throws UsageError where there are no textures that it would stand beside
void validate_normal_map(bool normal_map, bool textured);

}  // namespace tessera
