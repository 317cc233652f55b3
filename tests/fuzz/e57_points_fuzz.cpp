#include "stream/formats/points/e57_points.h"

#include "tests/fuzz/point_reader_check.h"
#include "tests/helpers/e57_writer.h"

/// Checksums are made sound, else nothing would get past them.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0) {
    tessera::fuzz::check_reader(tessera::open_e57_points,
                                tessera::test::e57_sealed({reinterpret_cast<const char*>(data), size}));
  }
  return 0;
}
