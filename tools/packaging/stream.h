/// \file stream.h
/// The floor stream in one include: jobs as calls, meshes and scans of any size in and out. Installed as <tessera/stream.h>, target
/// Tessera::stream.
#pragma once
#include "octree/error.h"
#include "stream/api/arrays_call.h"
#include "stream/api/check_call.h"
#include "stream/api/job_call.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/points/point_source.h"
#include "stream/runtime/memory_budget.h"
