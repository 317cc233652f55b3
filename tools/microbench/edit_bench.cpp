// Speed of an edit's kernels, one thread: preparation and poses of a sheet of 189 x 189 vertices with three handles (16,626
// unknowns, 15 solutions), and displacement volumes of bent tubes. Least seconds of CPU of all repetitions, the first one not counted.
// edit_bench [order=2] [smoothness=order-1 of one handle] [repeat=20] [around=60,120,240]...
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "kernels/edit/displacement_volumes.h"
#include "kernels/edit/edit_regions.h"
#include "kernels/edit/unflip_faces.h"
#include "tests/helpers/surfaces.h"
#include "tools/microbench/thread_seconds.h"

namespace {

using namespace tessera;

template <class Work>
double min_seconds(int repeat, const Work& work) {
  double minimum = 1e300;
  for (int i = 0; i <= repeat; ++i) {
    const double start = thread_seconds();
    work();
    if (i > 0 || repeat == 0) minimum = std::min(minimum, thread_seconds() - start);
  }
  return minimum;
}

EditRegion spot(const std::string& name, double x, double y) {
  EditRegion r;
  r.role = RegionRole::kHandle;
  r.name = name;
  r.shape = RegionShape::kSphere;
  r.point = {x, y, 0};
  r.radius = 12.0;
  return r;
}

void bench_sheet(int order, double smoothness, int repeat) {
  const test::Surface s = test::height_grid(
      188, 188.0, [](double x, double y) { return 2.0 * std::sin(x / 9.0) * std::cos(y / 7.0); });
  std::vector<EditRegion> regions(1);
  regions[0].role = RegionRole::kSupport;
  regions[0].shape = RegionShape::kSphere;
  regions[0].point = {94, 94, 0};
  regions[0].radius = 75.3;
  regions.push_back(spot("a", 60, 94));
  regions.back().smoothness = smoothness;
  regions.push_back(spot("b", 110, 65));
  regions.push_back(spot("c", 110, 123));
  const EditRegions resolved = resolve_regions(regions, {s.position, s.faces}, order);
  EditBasis basis;
  EditBasisReport report;
  const double prepare = min_seconds(repeat / 4, [&] {
    basis = edit_basis({s.position, s.faces}, laplacian({s.position, s.faces}), resolved, {.order = order},
                       report);
  });
  std::vector<Placement> pose(3);
  for (std::size_t h = 0; h < 3; ++h) {
    pose[h] = rotation({0.6, 0.8, 0}, 10.0 + 5.0 * static_cast<double>(h)).about(basis.centre[h]);
    pose[h].shift = pose[h].shift + Double3{0, 0, 6.0};
  }
  std::vector<Double3> rest, smooth, posed;
  std::vector<Rotation> rotation;
  const double at_rest = min_seconds(repeat, [&] { rest = rest_base(basis, s.position); }),
               by_basis = min_seconds(repeat, [&] { smooth = smooth_base(basis, s.position, pose); }),
               by_rotations = min_seconds(repeat, [&] { rotation = pose_rotations(basis, pose); }),
               by_details = min_seconds(
                   repeat, [&] { posed = posed_base(basis, s.position, rotation, rest, smooth); });
  std::printf(
      "sheet of %zu vertices, order %d: %zu unknowns, %zu solutions, prepared in %.3f s; rest %.2f ms; pose "
      "%.2f ms: "
      "smooth base %.2f, turns %.2f, details %.2f\n",
      s.position.size(), order, basis.active.size(), basis.width(), prepare, 1e3 * at_rest,
      1e3 * (by_basis + by_rotations + by_details), 1e3 * by_basis, 1e3 * by_rotations, 1e3 * by_details);
}

test::Surface tube(int around) {
  test::Surface t;
  const int along = static_cast<int>(1.6 * around);
  for (int i = 0; i <= along; ++i)
    for (int j = 0; j < around; ++j) {
      const double rotation = 2.0 * kPi * (j + 0.5 * (i % 2)) / around;
      t.position.push_back({10.0 * i / along, std::cos(rotation), std::sin(rotation)});
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * around + j % around); };
  for (int i = 0; i < along; ++i)
    for (int j = 0; j < around; ++j) {
      const int odd = i % 2;
      t.faces.push_back({at(i, j), at(i, j + 1), at(i + 1, j + odd)});
      t.faces.push_back({at(i, j + 1 - odd), at(i + 1, j + 1), at(i + 1, j)});
    }
  return t;
}

void bench_tube(int around, int repeat) {
  const test::Surface s = tube(around);
  std::vector<EditRegion> regions(2);
  regions[0].role = RegionRole::kSupport;
  regions[0].shape = RegionShape::kBox;
  regions[0].low = {2, -9, -9};
  regions[0].high = {8, 9, 9};
  regions[1].role = RegionRole::kHandle;
  regions[1].name = "end";
  regions[1].shape = RegionShape::kHalfSpace;
  regions[1].point = {8, 0, 0};
  regions[1].normal = {-1, 0, 0};
  EditBasisReport report;
  const EditBasis basis =
      edit_basis({s.position, s.faces}, laplacian({s.position, s.faces}),
                 resolve_regions(regions, {s.position, s.faces}, 2), {.order = 2}, report);
  const std::vector<Placement> pose = {rotation({0, 0, 1}, 90.0).about({5, 0, 0})};
  const std::vector<Double3> rest = rest_base(basis, s.position),
                             smooth = smooth_base(basis, s.position, pose);
  const std::vector<Rotation> pose_rotation = pose_rotations(basis, pose);
  const std::vector<Double3> vectors = posed_base(basis, s.position, pose_rotation, rest, smooth);
  std::vector<Rotation> rotation(s.position.size(), Rotation{});
  for (std::size_t k = 0; k < pose_rotation.size(); ++k)
    rotation[static_cast<std::size_t>(basis.active[k])] = pose_rotation[k];
  std::vector<std::uint8_t> free;
  for (const std::int32_t role : basis.role) free.push_back(role == kSupportVertex);
  const std::vector<LayerLevel> levels = layer_levels(s.position, s.faces, free);
  DisplacementVolumeReport volumes;
  const double seconds = min_seconds(std::max(1, repeat / 4), [&] {
    displacement_volumes({{rest, s.position}, {smooth, vectors}, s.faces, free, rotation, {}}, levels, {},
                         volumes);
  });
  std::printf(
      "tube: %zu prisms, %zu levels, %.1f ms, %.2f million prisms/s; volumes off by %.2f %%, %.3f %%\n",
      volumes.prisms, volumes.levels, 1e3 * seconds, 1e-6 * static_cast<double>(volumes.prisms) / seconds,
      100.0 * volumes.off_before, 100.0 * volumes.off_after);
}

}  // namespace

int main(int argc, char** argv) {
  int order = 2, repeat = 20;
  double smoothness = -1.0;
  std::vector<int> around;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word.rfind("order=", 0) == 0) order = std::atoi(word.c_str() + 6);
    if (word.rfind("smoothness=", 0) == 0) smoothness = std::atof(word.c_str() + 11);
    if (word.rfind("repeat=", 0) == 0) repeat = std::atoi(word.c_str() + 7);
    if (word.rfind("around=", 0) == 0) around.push_back(std::atoi(word.c_str() + 7));
  }
  if (around.empty()) around = {48, 100, 340};
  bench_sheet(order, smoothness, repeat);
  for (const int a : around) bench_tube(a, repeat);
}
