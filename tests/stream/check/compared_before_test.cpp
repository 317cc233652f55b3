#include <catch2/catch.hpp>

#include <cmath>

#include "stream/check/compared_before.h"
#include "stream/check/mesh_compare.h"
#include "stream/files/json.h"
#include "stream/import/import_mesh.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::compared_before_test {
namespace {

constexpr int kSide = 200;
constexpr double kTolerance = 0.3;
constexpr std::uint64_t kCellFaces = 4096;

MeshStore wavy_sheet(const test::TempFolder& folder) {
  const std::filesystem::path file = folder.path() / "sheet.ply";
  test::write_sheet(file, kSide, [](int i, int j) {
    return Double3{static_cast<double>(i), static_cast<double>(j), std::sin(0.1 * i) * std::cos(0.07 * j)};
  });
  RunOptions run;
  run.memory_bytes = std::uint64_t{1} << 30;
  run.threads = 1;
  return import_mesh(file, folder.path(), "sheet", run, {});
}

/// The sheet in the same bricks, raised by `lift` around one spot.
MeshStore raised(const test::TempFolder& folder, const MeshStore& sheet, const std::string& name,
                 double lift) {
  const std::filesystem::path file = folder.path() / (name + ".tmm");
  MeshFileWriter writer(file, sheet.info());
  for (std::size_t p = 0; p < sheet.patches().size(); ++p) {
    MeshBlock patch = sheet.load({&p, 1});
    for (Double3& at : patch.position)
      if (std::hypot(at[0] - 150.0, at[1] - 60.0) < 3.0) at[2] += lift;
    writer.add(sheet.patches()[p].key, patch);
  }
  writer.finish();
  return MeshStore({file});
}

TEST_CASE("compared before: cells far from every change are the same, byte by byte, all others are not",
          "[property]") {
  const test::TempFolder folder;
  const MeshStore reference = wavy_sheet(folder), now = raised(folder, reference, "now", 0.2);
  CompareOptions options;
  options.tolerance = kTolerance;
  options.max_distance = 1.25 * kTolerance;
  options.cell_faces = kCellFaces;
  const MeshComparison begun = begin_comparison(now, reference, options);
  const auto cells = make_compare_cells(now, reference, options.max_distance, kCellFaces);
  const MeshStore earlier = raised(folder, reference, "earlier", 0.1);
  const ComparedBefore before(raised(folder, reference, "before", 0.1), reference, options.max_distance,
                              kCellFaces);
  const auto then = make_compare_cells(earlier, reference, options.max_distance, kCellFaces);
  REQUIRE(before.cells() == then.size());
  std::size_t same = 0;
  for (const CompareCell& cell : cells) {
    const bool changed = cell.box.low[0] <= 153.0 && cell.box.high[0] >= 147.0 && cell.box.low[1] <= 63.0 &&
                         cell.box.high[1] >= 57.0;
    const std::int64_t c = before.same(now, cell.box);
    if (changed) CHECK(c < 0);
    if (c < 0) continue;
    ++same;
    const auto cell_report = [&](const MeshStore& mesh, const MeshBox& box) {
      MeshComparison sum = begun;
      add_cell(sum, compare_cell(mesh, reference, begun, box, kTolerance));
      return tessera::dump_json(to_json(sum));
    };
    CHECK(cell_report(earlier, then.at(static_cast<std::size_t>(c)).box) == cell_report(now, cell.box));
  }
  CHECK(same > cells.size() / 2);
  CHECK(same < cells.size());
}

}  // namespace
}  // namespace tessera::compared_before_test
