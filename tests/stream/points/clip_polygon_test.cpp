#include "stream/points/clip_polygon.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "stream/points/point_filter.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::clip_polygon_test {
namespace {

ClipPolygon polygon(const test::TempFolder& folder, const std::string& json) {
  return ClipPolygon::from_text(ClipPolygon::text_of_file(folder.write("clip.geojson", json)));
}

TEST_CASE("clip polygon: a ring with a hole, an island in it, and rays through corners", "[unit]") {
  const test::TempFolder folder;
  const ClipPolygon p =
      polygon(folder, R"({"type":"FeatureCollection","features":[{"type":"Feature","geometry":
      {"type":"MultiPolygon","coordinates":[[[[0,0],[10,0],[10,10],[0,10],[0,0]],[[2,2],[8,2],[8,8],[2,8],[2,2]]],
      [[[4,4,99],[6,4],[6,6],[4,6]]]]}}, {"type":"Feature","geometry":null}]})");
  CHECK(p.min() == std::array<double, 2>{0, 0});
  CHECK(p.max() == std::array<double, 2>{10, 10});
  CHECK(p.holds(1, 5));
  CHECK(p.holds(1, 2));
  CHECK(p.holds(9, 8));
  CHECK_FALSE(p.holds(3, 5));
  CHECK_FALSE(p.holds(3, 4));
  CHECK(p.holds(5, 5));
  CHECK_FALSE(p.holds(11, 5));
  CHECK_FALSE(p.holds(-1, 2));
  CHECK_FALSE(p.holds(5, 12));
  const ClipPolygon diamond =
      polygon(folder, R"({"type":"Polygon","coordinates":[[[0,-1],[1,0],[0,1],[-1,0]]]})");
  CHECK(diamond.holds(0, 0));
  CHECK(diamond.holds(-0.9, 0));
  CHECK_FALSE(diamond.holds(-1.1, 0));
  CHECK_FALSE(diamond.holds(0.6, 0.6));
}

TEST_CASE("clip polygon: overlapping polygons are a union, holes are cut out of their own polygon alone",
          "[unit]") {
  const test::TempFolder folder;
  const std::string square = "[[0,0],[10,0],[10,10],[0,10],[0,0]]",
                    other = "[[5,5],[15,5],[15,15],[5,15],[5,5]]";
  const std::string hole = "[[4,4],[8,4],[8,8],[4,8],[4,4]]", near_hole = "[[6,6],[9,6],[9,9],[6,9],[6,6]]";
  const auto feature = [](const std::string& rings) {
    return R"({"type":"Feature","properties":{},"geometry":{"type":"Polygon","coordinates":[)" + rings +
           "]}}";
  };
  const auto features = [&](const std::string& list) {
    return polygon(folder, R"({"type":"FeatureCollection","features":[)" + list + "]}");
  };
  const auto multi = [&](const std::string& list) {
    return polygon(folder, R"({"type":"MultiPolygon","coordinates":[)" + list + "]}");
  };
  for (const ClipPolygon& p :
       {features(feature(square) + "," + feature(other)), features(feature(other) + "," + feature(square)),
        multi("[" + square + "],[" + other + "]")}) {
    CHECK(p.holds(1, 1));
    CHECK(p.holds(7, 7));
    CHECK(p.holds(14, 14));
    CHECK_FALSE(p.holds(12, 2));
  }
  // A feature listed twice, whichever way it runs.
  CHECK(features(feature(square) + "," + feature(square)).holds(5, 5));
  CHECK(features(feature(square) + "," + feature("[[0,0],[0,10],[10,10],[10,0],[0,0]]")).holds(5, 5));
  // What one polygon leaves out another may hold; holes that overlap stay holes.
  CHECK_FALSE(features(feature(square + "," + hole)).holds(5, 5));
  CHECK(features(feature(square + "," + hole) + "," + feature(other)).holds(7, 7));
  CHECK_FALSE(features(feature(square + "," + hole) + "," + feature(other)).holds(4.5, 4.5));
  const ClipPolygon two_holes = features(feature(square + "," + hole + "," + near_hole));
  for (const double x : {5.0, 7.0, 8.5}) CHECK_FALSE(two_holes.holds(x, x));
  CHECK(two_holes.holds(9.5, 9.5));
  // Rings that cross or overlap themselves hold all that they wind around.
  const ClipPolygon bowtie = features(feature("[[0,0],[10,10],[10,0],[0,10],[0,0]]"));
  CHECK(bowtie.holds(1, 5));
  CHECK(bowtie.holds(9, 5));
  CHECK_FALSE(bowtie.holds(5, 1));
  const ClipPolygon star = features(feature("[[0,10],[6,-8],[-9.5,3],[9.5,3],[-6,-8],[0,10]]"));
  CHECK(star.holds(0, 0));
  CHECK(star.holds(0, 8));
  CHECK_FALSE(star.holds(7, 8));
}

TEST_CASE("clip polygon: a star of many corners against its definition", "[property]") {
  std::string text = "[[[";
  constexpr int kCorners = 2000;
  std::vector<std::array<double, 2>> ring;
  for (int i = 0; i < kCorners; ++i) {
    // A rational circle, every other corner pulled in.
    const double t = -1.0 + 2.0 * (i % (kCorners / 2) + 0.5) / (kCorners / 2);
    const double side = i < kCorners / 2 ? 1.0 : -1.0;
    const double r = i % 2 == 0 ? 100.0 : 60.0;
    ring.push_back({side * r * (1 - t * t) / (1 + t * t), side * r * 2 * t / (1 + t * t)});
    text +=
        (i > 0 ? ",[" : "[") + std::to_string(ring.back()[0]) + "," + std::to_string(ring.back()[1]) + "]";
    ring.back() = {std::stod(std::to_string(ring.back()[0])), std::stod(std::to_string(ring.back()[1]))};
  }
  const ClipPolygon p = ClipPolygon::from_text(text + "]]]");
  int in = 0;
  int wrong = 0;
  for (int i = 0; i < 20000; ++i) {
    const double x = (i * 7919 % 20011) * 0.011 - 110.0;
    const double y = (i * 104729 % 20021) * 0.011 - 110.0;
    bool inside = false;
    for (std::size_t k = 0; k < ring.size(); ++k) {
      const auto& a = ring[k];
      const auto& b = ring[(k + 1) % ring.size()];
      if ((a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])) inside = !inside;
    }
    in += inside ? 1 : 0;
    wrong += inside != p.holds(x, y) ? 1 : 0;
  }
  CHECK(wrong == 0);
  CHECK(in > 5000);
  CHECK(in < 15000);
}

TEST_CASE("clip polygon: what is none is refused by name", "[fault]") {
  const test::TempFolder folder;
  for (const char* bad :
       {"", "{", "[]", "3", R"({"type":"Point","coordinates":[1,2]})",
        R"({"type":"Polygon","coordinates":[]})", R"({"type":"Polygon","coordinates":[[[0,0],[1,1]]]})",
        R"({"type":"Polygon","coordinates":[[[0,0],[1,0],[2,0]]]})",
        R"({"type":"Polygon","coordinates":[[[0,0],["a",0],[2,0]]]})",
        R"({"type":"Polygon","coordinates":[[1,2,3]]})", R"({"type":3})",
        R"({"type":"Polygon","coordinates":[[[0,0],[1e999,0],[2,3]]]})"}) {
    CAPTURE(bad);
    const auto path = folder.write("bad.geojson", bad);
    CHECK_THROWS_AS(ClipPolygon::text_of_file(path), InputError);
    CHECK_THROWS_WITH(ClipPolygon::text_of_file(path), Catch::StartsWith(path.string()));
  }
  CHECK_THROWS_AS(ClipPolygon::text_of_file(folder.path() / "none.geojson"), InputError);
}

TEST_CASE("point filter: a box and a polygon keep what is in both, and say what is not", "[unit]") {
  ReconstructOptions options;
  options.bounds = {"0", "0", "-1", "8", "8", "1"};
  options.clip_rings = "[[[[4,-5],[20,-5],[20,20],[4,20]]]]";
  const PointFilter filter(options);
  CHECK(filter.box()->min[0] == 4.0);
  CHECK(filter.box()->max[0] == 8.0);
  PointChunk chunk;
  for (int i = 0; i < 10; ++i) {
    chunk.x.push_back(i), chunk.y.push_back(2), chunk.z.push_back(i == 6 ? 5 : 0);
    chunk.rgba.push_back(static_cast<std::uint32_t>(i));
  }
  PointChunk scratch;
  ReadCounts counts;
  CHECK(filter.apply(chunk, scratch, counts).rgba == std::vector<std::uint32_t>{4, 5, 7, 8});
  CHECK(counts.outside == 6);
  CHECK_THROWS_AS(filter.require_wanted(10, 10), EmptyError);
  CHECK_THROWS_AS(filter.require_wanted(0, 0), EmptyError);
  CHECK_NOTHROW(filter.require_wanted(10, 9));
  for (const auto& bad : std::vector<std::vector<std::string>>{{"1"},
                                                               {"0", "0", "0", "1", "1", "x"},
                                                               {"0", "0", "0", "-1", "1", "1"},
                                                               {"0", "0", "0", "1", "1", "nan"}}) {
    options.bounds = bad;
    CHECK_THROWS_AS(PointFilter(options), UsageError);
  }
}

}  // namespace
}  // namespace tessera::clip_polygon_test
