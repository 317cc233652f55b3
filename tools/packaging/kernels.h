/// \file kernels.h
/// The floor kernels in one include: what works on a mesh or points in memory. Each header says what it computes and where that is
/// published. Installed as <tessera/kernels.h>, target Tessera::kernels.
#pragma once
#include "kernels/certify/certificate.h"
#include "kernels/decimate/decimate.h"
#include "kernels/holes/boundary_loops.h"
#include "kernels/holes/hole_filling.h"
#include "kernels/maps/parameterize.h"
#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/make_block.h"
#include "kernels/mesh/mesh_block.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/mesh/mesh_repair.h"
#include "kernels/mesh/signed_distance.h"
#include "kernels/mesh/triangle_foot.h"
#include "kernels/remesh/remesh.h"
#include "kernels/remesh/triangle_quality.h"
#include "kernels/smooth/smooth.h"
#include "kernels/solid/triangle_windings.h"
