#include "stream/point_source.h"

namespace tessera {

void PointChunk::clear() {
  x.clear(), y.clear(), z.clear();
  nx.clear(), ny.clear(), nz.clear();
  rgba.clear();
  sensor.clear();
}

}  // namespace tessera
