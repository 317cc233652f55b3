// Normals that readers make of rows and columns: right, the same from any slice, and only where they are asked for.
#include "stream/formats/points/grid_stream.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <sstream>

#include "octree/portable_math.h"
#include "tests/helpers/e57_writer.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/temp_folder.h"

namespace grid_stream_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr int kRows = 41, kColumns = 60;
const Double3 kScanner = {100, 200, 5};

/// A ball of radius 4 around (100, 190, 5), seen from the scanner ten units away: the ray of a cell, and how far it goes; 0 where
/// it misses, and in a hole.
double range(int row, int column, Double3& ray) {
  const SinCos yaw = sin_cos(0.012 * (column - kColumns / 2) - kPi / 2),
               rise = sin_cos(0.012 * (row - kRows / 2));
  ray = {rise.cos * yaw.cos, rise.cos * yaw.sin, rise.sin};
  if (row > 20 && row < 24 && column > 25 && column < 30) return 0.0;
  const double along = -10.0 * ray[1], square = along * along - (100.0 - 16.0);
  return square > 0.0 ? along - std::sqrt(square) : 0.0;
}

Double3 outwards(const PointChunk& c, std::size_t i) {
  return {(c.x[i] - 100) / 4, (c.y[i] - 190) / 4, (c.z[i] - 5) / 4};
}

std::string ptx() {
  std::ostringstream text;
  text.precision(12);
  text << kColumns << "\n" << kRows << "\n100 200 5\n1 0 0\n0 1 0\n0 0 1\n";
  text << "1 0 0 0\n0 1 0 0\n0 0 1 0\n100 200 5 1\n";
  for (int c = 0; c < kColumns; ++c)
    for (int r = 0; r < kRows; ++r) {
      Double3 ray;
      const double d = range(r, c, ray);
      if (d > 0)
        text << d * ray[0] << ' ' << d * ray[1] << ' ' << d * ray[2] << " 0.25\n";
      else
        text << "0 0 0 0\n";
    }
  return text.str();
}

/// \param by_rows  else by columns   \param invalid  misses are records of their own, else they are left out
std::string e57(bool by_rows, bool invalid) {
  E57TestScan scan;
  std::vector<E57Values> fields = e57_doubles(kE57Cartesian, {{}, {}, {}});
  fields.resize(6);
  const char* names[] = {"cartesianInvalidState", "rowIndex", "columnIndex"};
  for (std::size_t f = 3; f < 6; ++f) {
    fields[f].name = names[f - 3];
    fields[f].type = "Integer";
    fields[f].maximum = f == 3 ? 2 : 80;
  }
  fields.push_back({});
  fields[6].name = "intensity";
  fields[6].type = "single";
  for (int at = 0; at < kRows * kColumns; ++at) {
    const int r = by_rows ? at / kColumns : at % kRows, c = by_rows ? at % kColumns : at / kRows;
    Double3 ray;
    const double d = range(r, c, ray);
    if (!(d > 0) && !invalid) continue;
    for (std::size_t a = 0; a < 3; ++a) fields[a].floats.push_back(d * ray[a]);
    fields[3].integers.push_back(d > 0 ? 0 : 2);
    fields[4].integers.push_back(r);
    fields[5].integers.push_back(c);
    fields[6].floats.push_back(-1.5);
  }
  scan.fields = fields;
  scan.xml = e57_pose("1", "0", "0", "0", "100", "200", "5") +
             "<intensityLimits type=\"Structure\"><intensityMinimum type=\"Float\">-2</intensityMinimum>"
             "<intensityMaximum type=\"Float\">2</intensityMaximum></intensityLimits>";
  scan.packets = 5;
  return e57_file({scan});
}

ReadOptions asking() {
  ReadOptions options;
  options.grid_normals = true;
  options.intensities = true;
  return options;
}

void check_ball(const ReadResult& got) {
  CHECK(got.info.attributes.grid_normals);
  CHECK(got.info.packed);
  std::size_t without = 0;
  double worst = 0.0, worst_squarely = 0.0;
  for (std::size_t i = 0; i < got.points.size(); ++i) {
    const Double3 n = {got.points.nx[i], got.points.ny[i], got.points.nz[i]};
    if (norm(n) == 0.0) {
      ++without;
      continue;
    }
    const Double3 truth = outwards(got.points, i);
    const double off = std::acos(std::min(1.0, dot(n, truth))) * 180.0 / kPi;
    worst = std::max(worst, off);
    const Double3 back = {100 - got.points.x[i], 200 - got.points.y[i], 5 - got.points.z[i]};
    if (dot(back, truth) > 0.5 * norm(back)) worst_squarely = std::max(worst_squarely, off);
  }
  CAPTURE(worst, worst_squarely, without);
  REQUIRE(got.points.size() > 800);
  CHECK(worst_squarely < 4.0);  // beside the hole, where all neighbours lie to one side
  CHECK(worst < 15.0);          // at the outline, where the ball turns by that much from sample to sample
  CHECK(without < got.points.size() / 20);
}

}  // namespace

TEST_CASE("grid stream: PTX and E57 by rows or columns, with holes or without records in them", "[unit]") {
  const TempFolder folder;
  const ReadResult text = read_points(folder.write("a.ptx", ptx()), ~std::uint64_t{0}, asking());
  check_ball(text);
  CHECK(text.points.intensity.at(7) == 16384);
  for (const bool by_rows : {false, true})
    for (const bool invalid : {false, true}) {
      CAPTURE(by_rows, invalid);
      const ReadResult binary =
          read_points(folder.write("a.e57", e57(by_rows, invalid)), ~std::uint64_t{0}, asking());
      check_ball(binary);
      CHECK(binary.counts.empty == (invalid ? kRows * kColumns - binary.points.size() : 0u));
      CHECK(binary.points.intensity.at(7) == 8192);  // -1.5 of -2..2
      if (by_rows) continue;
      REQUIRE(binary.points.size() == text.points.size());
      for (std::size_t i = 0; i < text.points.size(); ++i)
        REQUIRE(std::abs(binary.points.nx[i] - text.points.nx[i]) < 1e-3f);
    }
}

TEST_CASE("grid stream: every slice gives the normals of the whole", "[property]") {
  const TempFolder folder;
  require_slices_agree(folder.write("a.ptx", ptx()), asking(), {1000, 5003, 20000});
  require_slices_agree(folder.write("a.e57", e57(false, true)), asking(), {1, 700, 5003, 20000});
  require_slices_agree(folder.write("b.e57", e57(true, false)), asking(), {1, 700, 5003, 20000});
}

TEST_CASE("grid stream: who does not ask gets none, and records without order have none", "[unit]") {
  const TempFolder folder;
  const ReadResult plain = read_points(folder.write("a.e57", e57(false, true)));
  CHECK_FALSE(plain.info.attributes.normals);
  CHECK_FALSE(plain.info.packed);
  CHECK_FALSE(read_points(folder.write("a.ptx", ptx())).info.attributes.normals);
  std::string torn = ptx();
  torn.erase(torn.find('\n', 2000) + 1, 30);  // lines are missing: nobody knows whose cells the others are
  torn.erase(torn.find('\n', 2000), torn.find('\n', torn.find('\n', 2000) + 1) - torn.find('\n', 2000));
  const ReadResult cut = read_points(folder.write("b.ptx", torn), ~std::uint64_t{0}, asking());
  CHECK_FALSE(cut.info.attributes.normals);
}

TEST_CASE("grid stream: a scan of E57 that declares records and holds none", "[unit]") {
  const TempFolder folder;
  E57TestScan scan;
  scan.fields = e57_doubles(kE57Cartesian, {{}, {}, {}});
  for (const char* name : {"rowIndex", "columnIndex"}) {
    scan.fields.emplace_back();
    scan.fields.back().name = name;
    scan.fields.back().type = "Integer";
    scan.fields.back().maximum = 7;
  }
  scan.declared = 48;
  scan.packets = 0;
  const ReadResult got = read_points(folder.write("a.e57", e57_file({scan})), ~std::uint64_t{0}, asking());
  CHECK(got.points.size() == 0);
  CHECK(got.counts.missing == 48);
  CHECK_FALSE(got.info.attributes.grid_normals);
}

}  // namespace grid_stream_test
