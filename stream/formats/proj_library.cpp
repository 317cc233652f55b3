#include "stream/formats/proj_library.h"

#include <dlfcn.h>

namespace tessera {

namespace {

template <typename Function>
void find(void* library, const char* name, Function& function) {
  function = reinterpret_cast<Function>(::dlsym(library, name));
}

ProjLibrary load() {
  ProjLibrary p;
  p.library = ::dlopen("libproj.so.25", RTLD_NOW | RTLD_LOCAL);
  if (p.library == nullptr) return p;
  find(p.library, "proj_as_proj_string", p.as_proj_string);
  find(p.library, "proj_as_wkt", p.as_wkt);
  find(p.library, "proj_clone", p.clone);
  find(p.library, "proj_context_create", p.context_create);
  find(p.library, "proj_context_destroy", p.context_destroy);
  find(p.library, "proj_context_set_enable_network", p.context_set_enable_network);
  find(p.library, "proj_coord", p.coord);
  find(p.library, "proj_create", p.create);
  find(p.library, "proj_create_crs_to_crs_from_pj", p.create_crs_to_crs_from_pj);
  find(p.library, "proj_crs_get_coordinate_system", p.crs_get_coordinate_system);
  find(p.library, "proj_crs_get_sub_crs", p.crs_get_sub_crs);
  find(p.library, "proj_cs_get_axis_info", p.cs_get_axis_info);
  find(p.library, "proj_destroy", p.destroy);
  find(p.library, "proj_errno_reset", p.errno_reset);
  find(p.library, "proj_get_id_code", p.get_id_code);
  find(p.library, "proj_get_name", p.get_name);
  find(p.library, "proj_get_source_crs", p.get_source_crs);
  find(p.library, "proj_get_type", p.get_type);
  find(p.library, "proj_is_equivalent_to_with_ctx", p.is_equivalent_to_with_ctx);
  find(p.library, "proj_log_level", p.log_level);
  find(p.library, "proj_normalize_for_visualization", p.normalize_for_visualization);
  find(p.library, "proj_trans", p.trans);
  find(p.library, "proj_trans_generic", p.trans_generic);
  return p;
}

}  // namespace

const ProjLibrary& proj() {
  static const ProjLibrary loaded = load();
  return loaded;
}

ProjContext proj_context() {
  ProjContext context(proj().context_create());
  proj().context_set_enable_network(context.get(), 0);
  proj().log_level(context.get(), PJ_LOG_NONE);
  return context;
}

}  // namespace tessera
