#include "stream/meshes/texture_option.h"

namespace tessera {

void add_texture(OptionTable& table, double& texture, const std::string& from) {
  table
      .add("texture", &texture,
           "the result gets textures: colours of " + from +
               " on charts in pages (.glb, .obj or .ply, as tessera bake makes them), with texels so wide, "
               "units of the mesh; auto = 0.5 to 0.7 times the mean spacing of the points along the surface; "
               "0 = "
               "colours of vertices, e.g. --tolerance 0.02 --texture auto -o small.glb")
      .at_least(0)
      .or_word("auto", kAutoTexture);
}

}  // namespace tessera
