#include "tests/fuzz/mesh_reader_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0) {
    tessera::fuzz::check_mesh_reader(tessera::open_msh_mesh, {reinterpret_cast<const char*>(data), size});
  }
  return 0;
}
