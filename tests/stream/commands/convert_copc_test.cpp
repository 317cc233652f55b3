// `convert` to COPC: all points, as any COPC is read, and the same bytes whatever the order of inputs and the threads.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "stream/commands/convert_points.h"
#include "stream/formats/points/las_records.h"
#include "tests/helpers/node_points.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::convert_copc_test {
namespace {}  // namespace

TEST_CASE(
    "copc: converted scans are COPC with all their points, the same bytes on any threads and from any order",
    "[pipeline]") {
  const test::TempFolder folder;
  std::vector<std::filesystem::path> parts;
  const std::vector<test::Steps> points = test::node_points(150'000);
  for (const int part : {0, 1}) {
    std::string text = "x y z r g b i\n";
    for (std::size_t i = static_cast<std::size_t>(part); i < points.size(); i += 2)
      text += std::to_string(points[i][0] * 0.5) + " " + std::to_string(points[i][1] * 0.5) + " " +
              std::to_string(points[i][2] * 0.5) + " " + std::to_string(i % 256) + " 7 9 " +
              std::to_string(i % 1000) + "\n";
    parts.push_back(folder.write("part" + std::to_string(part) + ".xyz", text));
  }
  const auto convert = [&](const char* name, std::vector<std::filesystem::path> inputs, int threads) {
    ConvertOptions options;
    options.threads = threads;
    options.las_scale = 0.5;
    const ConvertReport report = convert_points(inputs, folder / name, options);
    CHECK(report.points == points.size());
    return folder / name;
  };
  const auto copc = convert("a.copc.laz", parts, 1), plain = convert("a.las", parts, 2);
  CHECK((test::file_bytes(convert("b.copc.laz", {parts[1], parts[0]}, 2)) == test::file_bytes(copc)));
  const auto sorted = [](const std::filesystem::path& path, const ReadOptions& options = {}) {
    const test::ReadResult r = test::read_points(path, std::uint64_t{1} << 20, options);
    CHECK(r.info.warnings.empty());
    std::vector<std::tuple<double, double, double, std::uint32_t>> all;
    for (std::size_t i = 0; i < r.points.size(); ++i)
      all.emplace_back(r.points.x[i], r.points.y[i], r.points.z[i], r.points.rgba[i]);
    std::sort(all.begin(), all.end());
    return all;
  };
  const auto all = sorted(plain);
  CHECK((sorted(copc) == all));
  const auto file = open_point_file(copc, {});
  CHECK(file->info().octree);
  CHECK(file->info().declared_points == points.size());
  // A part of it, and its coarse levels alone.
  ReadOptions box;
  box.bounds = PointBox{{0, 0, -1e9}, {20'000, 20'000, 1e9}};
  const auto part = sorted(copc, box);
  CHECK(part.size() < all.size() / 2);
  const auto in_box = [](const auto& p) {
    return std::get<0>(p) >= 0 && std::get<0>(p) <= 20'000 && std::get<1>(p) >= 0 && std::get<1>(p) <= 20'000;
  };
  CHECK(std::count_if(part.begin(), part.end(), in_box) == std::count_if(all.begin(), all.end(), in_box));
  ReadOptions coarse;
  coarse.resolution_limit = 500'000.0 / 128;
  const auto top = sorted(copc, coarse);
  CHECK(top.size() > 1000);
  CHECK(top.size() < all.size() / 3);
  // Records keep all bytes through our own reader of records.
  CHECK(LasRecords(copc).points() == points.size());
}

}  // namespace tessera::convert_copc_test
