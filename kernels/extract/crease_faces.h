/// \file crease_faces.h
/// Segments of loops within one face of the lattice, with the kinks where creases pass it: whether they are drawn soundly, and
/// the part of the face between a segment with its kinks and without, for a cell that goes without them.
/// Both cells of the face must come to the same answer: chains run from the lower lattice edge on, the lower one first.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// A segment: its roots, and the kinks between. In the coordinates of the face, in cells.
using FaceChain = std::vector<Double2>;

/// Whether the chains of a face neither cross nor come close to each other or to themselves, nor a chain to the straight segment of
/// another. \pre at least two points each
[[nodiscard]] bool chains_are_sound(std::span<const FaceChain> chains);

/// Triangles between a chain and its straight segment, in the turn of the chain.
/// \returns false where the chain lies on both sides of it, or too close
[[nodiscard]] bool triangulate_flap(const FaceChain& chain,
                                    std::vector<std::array<std::uint8_t, 3>>& triangles);

}  // namespace tessera
