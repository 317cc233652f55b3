/// \file upright_low_pass.h
/// What a low-pass of a base surface may not do: turn faces over or press them flat. It would where a body is no thicker than a few
/// edges, as wires and ribs are, whose waves around are as short as those that it takes away.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Vertices of faces that lost most of their area as seen along their normals before go back, half the way in each of a few
/// rounds and all of it in the last ones, and their neighbours with them.
/// \param before  n \param after  n: `before` after the low-pass
/// \return vertices that went back
std::size_t undo_flattening(std::span<const Double3> before,
                            std::span<const std::array<std::uint32_t, 3>> faces, std::vector<Double3>& after);

}  // namespace tessera
