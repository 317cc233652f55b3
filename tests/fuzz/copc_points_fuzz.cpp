#include "stream/formats/points/las_points.h"

#include "tests/fuzz/point_reader_check.h"

namespace {

/// As somebody who wants a part: the octree is read.
std::unique_ptr<tessera::PointFile> open_part(const tessera::ReadFile& file,
                                              const tessera::ReadOptions& options) {
  tessera::ReadOptions part = options;
  part.bounds = tessera::PointBox{{499900, 499900, 499900}, {500040, 500040, 500100}};
  part.resolution_limit = 4.0;
  return tessera::open_las_points(file, part);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0) {
    tessera::fuzz::check_reader(open_part, {reinterpret_cast<const char*>(data), size});
  }
  return 0;
}
