#include "stream/stages/deform/deform_options.h"

#include "octree/error.h"

namespace tessera {

OptionTable option_table(DeformOptions& o) {
  OptionTable t("What it computes");
  t.add("mode", &o.mode, "deform, prepare or apply").one_of({"deform", "prepare", "apply"}).hidden();
  t.add("edit", &o.edit, "the edit as JSON").hidden();
  t.add("base", &o.base,
        "auto: a mesh that is small enough is its own base, unless a tenth of its area lies in long thin "
        "triangles; even: always remeshed")
      .one_of({"auto", "even"});
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
  return t;
}

void DeformOptions::validate() const {
  if (dry_run && mode != "deform")
    throw UsageError("--dry-run colours the mesh: it goes with a mesh and an edit, not with " + mode);
}

}  // namespace tessera
