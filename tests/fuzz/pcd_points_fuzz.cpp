#include "stream/formats/points/pcd_points.h"

#include "tests/fuzz/point_reader_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0) {
    tessera::fuzz::check_reader(tessera::open_pcd_points, {reinterpret_cast<const char*>(data), size});
  }
  return 0;
}
