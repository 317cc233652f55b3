/// \file proj_library.h
/// PROJ's C interface (proj.org): coordinate systems by text and code, transformations between them. Loaded when it is
/// first asked for: with all that it brings it would cost every command 8 MiB. No network.
#pragma once
#include <memory>

#include <proj.h>

namespace tessera {

/// The functions of libproj that are used; null where the library is not there.
struct ProjLibrary {
  void* library = nullptr;
  decltype(&::proj_as_proj_string) as_proj_string = nullptr;
  decltype(&::proj_as_wkt) as_wkt = nullptr;
  decltype(&::proj_clone) clone = nullptr;
  decltype(&::proj_context_create) context_create = nullptr;
  decltype(&::proj_context_destroy) context_destroy = nullptr;
  decltype(&::proj_context_set_enable_network) context_set_enable_network = nullptr;
  decltype(&::proj_coord) coord = nullptr;
  decltype(&::proj_create) create = nullptr;
  decltype(&::proj_create_crs_to_crs_from_pj) create_crs_to_crs_from_pj = nullptr;
  decltype(&::proj_crs_get_coordinate_system) crs_get_coordinate_system = nullptr;
  decltype(&::proj_crs_get_sub_crs) crs_get_sub_crs = nullptr;
  decltype(&::proj_cs_get_axis_info) cs_get_axis_info = nullptr;
  decltype(&::proj_destroy) destroy = nullptr;
  decltype(&::proj_errno_reset) errno_reset = nullptr;
  decltype(&::proj_get_id_code) get_id_code = nullptr;
  decltype(&::proj_get_name) get_name = nullptr;
  decltype(&::proj_get_source_crs) get_source_crs = nullptr;
  decltype(&::proj_get_type) get_type = nullptr;
  decltype(&::proj_is_equivalent_to_with_ctx) is_equivalent_to_with_ctx = nullptr;
  decltype(&::proj_log_level) log_level = nullptr;
  decltype(&::proj_normalize_for_visualization) normalize_for_visualization = nullptr;
  decltype(&::proj_trans) trans = nullptr;
  decltype(&::proj_trans_generic) trans_generic = nullptr;
};
/// Loaded once, by the first call. Thread-safe.
const ProjLibrary& proj();

struct ProjFree {
  void operator()(PJ* p) const { proj().destroy(p); }
  void operator()(PJ_CONTEXT* c) const { proj().context_destroy(c); }
};
using ProjHandle = std::unique_ptr<PJ, ProjFree>;
using ProjContext = std::unique_ptr<PJ_CONTEXT, ProjFree>;

/// Silent, and without network. One thread at a time may use it.
ProjContext proj_context();

}  // namespace tessera
