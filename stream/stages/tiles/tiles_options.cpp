#include "stream/stages/tiles/tiles_options.h"

#include "stream/meshes/texture_option.h"

namespace tessera {

OptionTable option_table(TilesOptions& o) {
  OptionTable t("What it computes");
  t.add("tile-faces", &o.tile_faces,
        "most faces of a tile, but for the rows along its sides that it shares with its neighbours")
      .within(256, 1u << 22);
  t.add("normals", &o.normals,
        "write a normal with every vertex, for shading without facets: about one byte a face more");
  t.add("texture", &o.texture,
        "coarse levels keep the picture that their faces lose: every tile gets a page (JPEG) of the colours "
        "of the finest level, each level with texels as much wider as its faces are, so that tiles stay as "
        "small; an input with pages of its own has them baked anew on all levels. The width of a texel of "
        "the finest, units of the mesh; auto = 0.7 times the mean spacing of the vertices, or of the texels "
        "of the input; 0 = colours of vertices, e.g. tessera tiles mesh.ply -o site/ --texture auto")
      .at_least(0)
      .or_word("auto", kAutoTexture);
  return t;
}

}  // namespace tessera
