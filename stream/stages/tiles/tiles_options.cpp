#include "stream/stages/tiles/tiles_options.h"

namespace tessera {

OptionTable option_table(TilesOptions& o) {
  OptionTable t("What it computes");
  t.add("tile-faces", &o.tile_faces,
        "most faces of a tile, but for the rows along its sides that it shares with its neighbours")
      .within(256, 1u << 22);
  t.add("normals", &o.normals,
        "write a normal with every vertex, for shading without facets: about one byte a face more");
  return t;
}

}  // namespace tessera
