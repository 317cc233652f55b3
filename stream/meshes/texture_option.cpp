#include "stream/meshes/texture_option.h"

#include "kernels/decimate/auto_tolerance.h"
#include "octree/error.h"

namespace tessera {

void add_texture(OptionTable& table, double& texture, const std::string& from) {
  table
      .add("texture", &texture,
           "the result gets textures: colours of " + from +
               " on charts in pages (.glb, .obj or .ply, as tessera bake makes them), with texels so wide, "
               "units of the mesh; auto = 0.4 to 0.8 times the mean spacing of the points along the surface; "
               "0 = "
               "colours of vertices, e.g. --tolerance 0.02 --texture auto -o small.glb")
      .at_least(0)
      .or_word("auto", kAutoTexture);
}

void add_normal_map(OptionTable& table, bool& normal_map, const std::string& of) {
  table.add(
      "normal-map", &normal_map,
      "with --texture: a second picture of every page holds the directions of " + of +
          " that decimation takes away, in the frame of the surface (.glb, .obj), e.g. --tolerance 0.02 "
          "--texture auto --normal-map -o small.glb");
}

void add_colour_tolerance(OptionTable& table, double& levels, const std::string& unless) {
  table
      .add("colour-tolerance", &levels,
           "a vertex stays where a channel of the colours would change by more than so many levels of 255, "
           "so that borders of colours on flat faces stay sharp, at a cost in faces that the report tells; "
           "auto: four times what nine of ten edges nearby differ by and at least 8, " +
               unless + "; 0 = colours follow")
      .within(0, 255)
      .or_word("auto", kAutoColourTolerance);
}

void validate_normal_map(bool normal_map, bool textured) {
  if (normal_map && !textured)
    throw UsageError("--normal-map: stands beside a texture; give --texture auto too");
}

}  // namespace tessera
