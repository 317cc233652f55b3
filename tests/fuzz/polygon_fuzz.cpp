// Polygons to clip a site with: what a file gives reads as a polygon that holds nothing outside of its box.
#include "stream/points/clip_polygon.h"
#include "tests/fuzz/text_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tessera;
  const fuzz::MemoryFile file(fuzz::text_of(data, size));
  fuzz::accepted([&] {
    const ClipPolygon polygon = ClipPolygon::from_text(ClipPolygon::text_of_file(file.path()));
    const auto& low = polygon.min();
    const auto& high = polygon.max();
    fuzz::require(low[0] <= high[0] && low[1] <= high[1], "a box");
    polygon.holds(0.5 * low[0] + 0.5 * high[0], 0.5 * low[1] + 0.5 * high[1]);
    fuzz::require(!polygon.holds(std::nextafter(high[0], 1e308), low[1]), "nothing beside the box is inside");
    fuzz::require(!polygon.holds(low[0], std::nextafter(high[1], 1e308)), "nothing above the box is inside");
  });
  return 0;
}
