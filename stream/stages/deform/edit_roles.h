/// \file edit_roles.h
/// Which vertices of a base surface the regions of an edit take, with what of the mesh they ask for: vertices by their number in
/// the file, and its colours.
#pragma once
#include <cstddef>
#include <filesystem>

#include "kernels/edit/edit_regions.h"
#include "stream/runtime/stage.h"
#include "stream/stages/deform/deform_files.h"
#include "stream/stages/deform/edit_script.h"

namespace tessera {

/// The mesh's file, read again where a region asks for it.
struct RegionSource {
  std::filesystem::path mesh;
  std::size_t window = 1;  ///< vertex_window()
};

/// \throws InputError  a region takes no vertex, or names one that the mesh has not
EditRegions base_regions(const BaseSurface& base, const EditScript& script, const RegionSource& source,
                         TaskContext& context);

/// Whether no region is a list of points or vertices, which stand for themselves: the base may then get others among them.
bool takes_by_place(const EditScript& script);

}  // namespace tessera
