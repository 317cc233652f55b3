/// \file octree.h
/// The floor octree in one include: vectors, the lattice, Morton keys, errors, trees of points, fast winding numbers. Installed as
/// <tessera/octree.h>, target Tessera::octree.
#pragma once
#include "octree/edge_faces.h"
#include "octree/error.h"
#include "octree/lattice.h"
#include "octree/level_tree.h"
#include "octree/morton.h"
#include "octree/multipole.h"
#include "octree/placement.h"
#include "octree/points.h"
#include "octree/quadric_field.h"
#include "octree/small_matrix.h"
#include "octree/union_find.h"
#include "octree/vector.h"
#include "octree/winding_number.h"
