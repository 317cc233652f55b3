#include "stream/stages/bake/bake_options.h"

#include <bit>

#include "octree/error.h"

namespace tessera {

OptionTable option_table(BakeOptions& o) {
  OptionTable t("What it computes");
  t.add("texel", &o.texel,
        "width of a texel, units of the mesh; auto = 0.4 to 0.8 times the mean spacing of the points along "
        "the surface, so that pages are full")
      .at_least(0)
      .or_word("auto", 0.0);
  t.add(
       "max-distance", &o.max_distance,
       "points farther from the surface give it no colour, units of the mesh; auto = eight times the spacing")
      .at_least(0)
      .or_word("auto", 0.0);
  t.add("page-size", &o.page_size, "largest width and height of a page, texels, a power of two")
      .within(64, 16384);
  t.add("one-page", &o.one_page,
        "texels as fine as fit on one page of --page-size, e.g. bake model.ply --from scan.laz -o model.glb "
        "--one-page --page-size 4096");
  t.add("margin", &o.margin, "texels around each chart that continue the surface beyond its border")
      .within(1, 16);
  t.add(
       "max-stretch", &o.max_stretch,
       "charts that are unfolded by least squares are stretched (L2) no more than this; others are projected")
      .within(1, 2);
  t.add("page-format", &o.page_format,
        "format of the pages; png: exact; jpeg: a fifth as large, e.g. bake small.ply --from scan.laz -o "
        "small.glb "
        "--page-format jpeg")
      .one_of({"png", "jpeg"});
  t.add("quality", &o.quality, "of JPEG pages, 100 is the best").within(1, 100);
  t.add("normal-map", &o.normal_map,
        "a second picture of every page holds the directions that the mesh has lost, of the normals of the "
        "finer mesh or of points that have some, in the frame of the surface (.glb, .obj), e.g. bake "
        "small.ply --from "
        "fine.ply -o small.glb --normal-map");
  t.add(
       "colour", &o.colour,
       "what of scans pages show; rgb: colours of the points; intensity: grey, darkest and brightest 2 % cut "
       "off, e.g. bake small.ply --from scan.laz -o small.glb --colour intensity")
      .one_of({"rgb", "intensity"});
  t.add("scans", &o.scans, "how many inputs follow the mesh").hidden();
  t.add("fine-mesh", &o.fine_mesh, "whether what follows is a mesh").hidden();
  return t;
}

BakeOptions BakeOptions::of_texture(double texture, bool normal_map) {
  BakeOptions options;
  options.normal_map = normal_map;
  options.texel = texture > 0.0 ? texture : 0.0;
  return options;
}

void BakeOptions::validate() const {
  if (fine_mesh && shows_intensity())
    throw UsageError("--colour intensity: meshes have none; give --from the scans");
  if (!std::has_single_bit(page_size))
    throw UsageError("--page-size " + std::to_string(page_size) + ": is no power of two; " +
                     std::to_string(std::bit_ceil(page_size)) + " is");
  if (one_page && texel > 0.0)
    throw UsageError("--texel with --one-page: the page tells the width of texels; leave one of them out");
  if (4 * margin > page_size)
    throw UsageError("--margin " + std::to_string(margin) + " leaves no room on pages of " +
                     std::to_string(page_size) + " texels: give less");
}

}  // namespace tessera
