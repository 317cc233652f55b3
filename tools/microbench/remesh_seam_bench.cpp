// Does remeshing leave a trace of its blocks? Faces near the seams of each pass against faces near the same planes moved by
// part of a block (tests/helpers/seam_traces.h).
// remesh_seam_bench WORK      work directory of a finished `tessera remesh ... -o OUT --keep`: OUT.tessera
//   KS        Kolmogorov-Smirnov distance of the faces near seams to those near all four controls
//   controls  the largest of one control to the other three: what places elsewhere differ by
//   chance    what so many faces drawn from one distribution exceed in 5 of 100 cases
#include <cstdio>
#include <exception>

#include "tests/helpers/seam_traces.h"

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "remesh_seam_bench WORK\n");
    return 2;
  }
  using namespace tessera::test;
  for (const SeamTrace& t : seam_traces(argv[1])) {
    std::printf("%s: %llu faces near seams, %llu near controls; chance (5 %%) %.4f%s\n", t.where.c_str(),
                static_cast<unsigned long long>(t.seam_faces),
                static_cast<unsigned long long>(t.control_faces), t.critical, t.seen() ? "; SEEN" : "");
    for (std::size_t i = 0; i < t.distance.size(); ++i)
      std::printf("  %-12s KS %.4f, controls %.4f; mean %.5g, controls %.5g\n", FaceShapes::kNames[i],
                  t.distance[i], t.among[i], t.seam_mean[i], t.control_mean[i]);
  }
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "remesh_seam_bench: %s\n", e.what());
  return 1;
}
