#include "stream/stages/deform/deform_options.h"

#include "octree/error.h"

namespace tessera {

OptionTable option_table(DeformOptions& o) {
  OptionTable t("What it computes");
  t.add("mode", &o.mode, "deform, prepare, apply or onto")
      .one_of({"deform", "prepare", "apply", "onto"})
      .hidden();
  t.add("edit", &o.edit, "the edit as JSON").hidden();
  t.add("base", &o.base,
        "auto: a mesh that is small enough is its own base, unless a tenth of its area lies in long thin "
        "triangles, and of such a mesh edges are halved that are long beside the width of the support, so "
        "that the result hangs on the surface and not on its triangles; split: the same, with a warning "
        "where regions name points; own: such a mesh as it is, e.g. deform part.ply edit.json --base own -o "
        "bent.ply; even: always remeshed")
      .one_of({"auto", "split", "own", "even"});
  t.add("base-vertices", &o.base_vertices,
        "most vertices of the base surface, which is solved for in memory: a mesh with no more is its own "
        "base, a larger one is decimated and remeshed to about as many and follows as details")
      .within(100, 2'000'000);
  t.add(
       "islands", &o.islands,
       "pieces of the support that touch neither what is fixed nor a handle: follow what is nearest to them, "
       "stay fixed, or refuse them")
      .one_of({"follow", "fixed", "refuse"});
  t.add(
       "crossings", &o.crossings,
       "count: pairs of faces that cross, overlap or touch beyond what they share before and after, those of "
       "the result listed with places; keep: that is not looked at, which saves reading both meshes twice")
      .one_of({"count", "keep"});
  t.add("dry-run", &o.dry_run,
        "move nothing, colour the mesh by its regions: support blue, handles green, fixed grey");
  t.add("order", &o.order,
        "with --onto: what a displacement of space costs, its derivatives of order 1 (membrane), 2 (thin "
        "plate: turning, scaling and shearing are free) or 3")
      .within(1, 3);
  t.add("wavelength", &o.wavelength,
        "with --onto: shortest waves of the displacement, units of the mesh; auto = as short as parts of the "
        "scan that are held out confirm")
      .at_least(0)
      .or_word("auto", 0.0);
  t.add("max-distance", &o.max_distance,
        "with --onto: what of the scan lies farther from the mesh plays no part, units of the mesh; auto = a "
        "tenth of its diagonal")
      .at_least(0)
      .or_word("auto", 0.0);
  return t;
}

void DeformOptions::validate() const {
  if (mode != "onto" && (order != 2 || wavelength > 0.0 || max_distance > 0.0))
    throw UsageError("--order, --wavelength and --max-distance go with --onto");
  if (dry_run && mode != "deform")
    throw UsageError("--dry-run colours the mesh: it goes with a mesh and an edit, not with " + mode);
}

}  // namespace tessera
