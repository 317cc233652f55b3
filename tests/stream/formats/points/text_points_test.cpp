#include "stream/formats/points/text_points.h"

#include <cmath>

#include "tests/helpers/point_reading.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::text_points_test {
namespace {

class Text {
 public:
  test::ReadResult read(const std::string& text, const std::vector<std::string>& columns = {},
                        const std::string& name = "a.xyz") {
    const ReadOptions options{.columns = columns};
    const auto path = folder_.write(name, text);
    test::require_slices_agree(path, options, {1, 2, 3, 7, 50, 1000});
    return test::read_points(path, ~std::uint64_t{0}, options);
  }
  std::string error(const std::string& text, const std::vector<std::string>& columns = {},
                    const std::string& name = "a.xyz") {
    return test::reading_error(folder_.write(name, text), {.columns = columns});
  }

 private:
  test::TempFolder folder_;
};

using Doubles = std::vector<double>;
using Colours = std::vector<std::uint32_t>;

TEST_CASE("text points: white space, commas, semicolons, tabs, all line ends", "[unit]") {
  Text t;
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    for (const std::string between : {" ", "  \t", ",", ", ", ";", " ; ", "\t"}) {
      for (const bool last_end : {true, false}) {
        CAPTURE(between, end, last_end);
        std::string text = "# a comment" + end + "// another" + end + end;
        for (const char* line : {"1|2|3", "-1.5e1|+2|.5", "nan|0|0", "4|5|6"}) {
          for (const char* c = line; *c != 0; ++c) text += *c == '|' ? between : std::string(1, *c);
          text += end;
        }
        if (!last_end) text.resize(text.size() - end.size());
        const auto r = t.read(text);
        REQUIRE(r.points.size() == 4);
        CHECK(r.points.x[1] == -15);
        CHECK(r.points.y[1] == 2);
        CHECK(r.points.z[1] == 0.5);
        CHECK(std::isnan(r.points.x[2]));
        CHECK(r.points.z[3] == 6);
        CHECK(r.counts.missing == 0);
      }
    }
  }
}

TEST_CASE("text points: header names in any case and order, in CSV and in comments", "[unit]") {
  Text t;
  auto r = t.read(
      "\xef\xbb\xbfName,\"Z\",Y (m),X[m],Red,GREEN,b,Intensity,nx,ny,nz\n\"p, 1\",3,2,1,10,20,30,5,0,0,1\n",
      {}, "a.csv");
  REQUIRE(r.points.size() == 1);
  CHECK(r.points.x == Doubles{1});
  CHECK(r.points.y == Doubles{2});
  CHECK(r.points.z == Doubles{3});
  CHECK(r.points.nz == std::vector<float>{1});
  CHECK(r.points.rgba == Colours{0xff1e140au});
  CHECK(r.info.attributes.intensity);
  r = t.read("//X Y Z R G B Nx Ny Nz\n2\n1 2 3 10 20 30 0 0 1\n4 5 6 10 20 30 0 0 1\n");
  CHECK(r.points.size() == 2);
  CHECK(r.info.declared_points == 2);
  CHECK(r.points.rgba == Colours{0xff1e140au, 0xff1e140au});
  CHECK(r.points.nz == std::vector<float>{1, 1});
  r = t.read("# x-rays seen by y and z\n1 2 3\n");
  CHECK(r.points.x == Doubles{1});
  CHECK_THAT(t.error("lat,lon\n1,2\n", {}, "a.csv"),
             Catch::Contains("lat,lon") && Catch::Contains("--columns"));
  CHECK_THAT(t.error("x,y,z,x\n1,2,3,4\n", {}, "a.csv"), Catch::Contains("x is named twice"));
}

TEST_CASE("text points: commas are decimal where no comma separates", "[unit]") {
  Text t;
  for (const std::string end : {"\n", "\r\n", "\r"})
    for (const std::string bom : {"", "\xef\xbb\xbf"})
      for (const std::string header : {"", "X|Y|Z"})
        for (const std::string between : {";", "; ", "\t", " ", "  "}) {
          for (const std::string trailing : {"", "|"}) {
            if (trailing == "|" && between == "  ") continue;
            CAPTURE(between, trailing, header, end.size());
            std::string text = bom;
            for (const std::string& line :
                 {header, std::string("-0,25|1,5E1|5400000,125"), std::string("1|2|3,75")}) {
              if (line.empty()) continue;
              for (const char c : line + trailing) text += c == '|' ? between : std::string(1, c);
              text += end;
            }
            const auto r = t.read(text, {}, "a.csv");
            CHECK(r.points.x == Doubles{-0.25, 1});
            CHECK(r.points.y == Doubles{15, 2});
            CHECK(r.points.z == Doubles{5400000.125, 3.75});
            CHECK_THAT(r.info.format, Catch::Contains("decimal commas"));
          }
        }
  auto r = t.read("\"X\",\"Y\",\"Z\"\n\"0,5\",\"1,5\",\"2,5\"\n", {}, "a.csv");
  CHECK(r.points.y == Doubles{1.5});
  r = t.read("P1;0,5;1,5;2,5\nP2;0,5;1,5;2,5\n", {"skip", "x", "y", "z"}, "a.txt");
  CHECK(r.points.z == Doubles{2.5, 2.5});
  // Whole numbers first, as of a scan that begins at its corner.
  r = t.read("0 0 0\n0,5 1,5 2,5\n");
  CHECK(r.points.x == Doubles{0, 0.5});
  // These commas separate.
  CHECK(t.read("1,2,3\n4,5,6\n").points.y == Doubles{2, 5});
  CHECK(t.read("1.5,2.5,3.5\n").points.y == Doubles{2.5});
  CHECK(t.read("1, 2, 3\n").points.z == Doubles{3});
  CHECK(t.read("1.5 2.5 3.5 10,20,30\n").points.rgba == Colours{0xff1e140au});
}

TEST_CASE("text points: exponents of Fortran", "[unit]") {
  Text t;
  auto r = t.read("1.5D+03 -2.5d-1 3D0\n0.25D1,4D0,5E0\n");
  CHECK(r.points.x == Doubles{1500, 2.5});
  CHECK(r.points.y == Doubles{-0.25, 4});
  CHECK(r.points.z == Doubles{3, 5});
  CHECK_THAT(t.error("1 2 3\n1D 2 3\n4 5 6\n"), Catch::Contains("line 2"));
  CHECK_THAT(t.error("1 2 3\n1e2D3 2 3\n4 5 6\n"), Catch::Contains("line 2"));
}

TEST_CASE("text points: extension, header and range tell colours, normals and intensity apart", "[unit]") {
  Text t;
  std::string rows;
  for (int i = 0; i < 20; ++i) rows += "1.5 2.5 " + std::to_string(i) + " 120 10 20 30\n";
  auto r = t.read(rows, {}, "a.pts");  // PTS without its count
  CHECK(r.points.rgba[3] == 0xff1e140au);
  CHECK(r.info.attributes.intensity);
  CHECK(r.info.left_out.empty());
  r = t.read("1 2 3 -870 10 20 30\n4 5 6 7 10 20 30\n", {}, "a.pts");
  CHECK(r.points.rgba[1] == 0xff1e140au);
  CHECK(t.read("1 2 3 0.5\n", {}, "a.pts").info.attributes.intensity);
  CHECK(t.read("1 2 3 10 20 30\n", {}, "a.pts").points.rgba == Colours{0xff1e140au});
  // Colours that are unit vectors.
  r = t.read("1 2 3 1.0 0.0 0.0\n1 2 3 0.0 1.0 0.0\n", {}, "a.xyzrgb");
  CHECK(r.points.rgba == Colours{0xff0000ffu, 0xff00ff00u});
  CHECK_FALSE(r.info.attributes.normals);
  CHECK(t.read("1 2 3 255 0 0\n", {}, "a.xyzrgb").points.rgba == Colours{0xff0000ffu});
  CHECK(t.read("1 2 3 255.0 0.0 0.0\n", {}, "a.xyzrgb").points.rgba == Colours{0xff0000ffu});
  CHECK(t.read("1 2 3 1.0 0.0 0.0\n", {}, "a.xyz").info.attributes.normals);
  CHECK(t.read("1 2 3 0.1 0.0 0.0\n", {}, "a.xyzn").info.attributes.normals);
  CHECK(t.read("1 2 3 1.0 0.5 0.0\n4 5 6 0.0 0.0 0.5\n").points.rgba == Colours{0xff0080ffu, 0xff800000u});
  // Names of CloudCompare.
  r = t.read(
      "//X;Y;Z;Rf;Gf;Bf;Intensity;curvature;Illuminance (PCV);Nx;Ny;Nz\n1\n"
      "1;2;3;1;0.5;0;0.5;0.0;0.9;0.0;0.0;1.0\n",
      {}, "a.pts");
  CHECK(r.points.rgba == Colours{0xff0080ffu});
  CHECK(r.points.nz == std::vector<float>{1});
  CHECK(r.info.left_out == std::vector<std::string>{"curvature", "Illuminance (PCV)"});
  r = t.read("//X Y Z Rf Gf Bf\n1 2 3 1 0 0\n");
  CHECK(r.points.rgba == Colours{0xff0000ffu});
  r = t.read("X,Y,Z,R,G,B\n1,2,3,65535,32896,0\n", {}, "a.csv");
  CHECK(r.points.rgba == Colours{0xff0080ffu});
  // Dark rows first: what follows in the first 10,000 counts.
  std::string dark = "x y z r g b\n";
  for (int i = 0; i < 9000; ++i) dark += "1 2 3 1.0 0.0 1.0\n";
  const test::TempFolder folder;
  r = test::read_points(folder.write("dark.xyz", dark + "1 2 3 255.0 0.0 0.0\n"));
  CHECK(r.points.rgba.front() == 0xff010001u);
  CHECK(r.points.rgba.back() == 0xff0000ffu);
  // Nothing goes without a word.
  CHECK(t.read("1 2 3 0.731\n").info.left_out == std::vector<std::string>{"column 4"});
  CHECK(t.read("1 2 3 4 5\n", {"x", "y", "z", "skip", "time"}).info.left_out ==
        std::vector<std::string>{"time"});
}

TEST_CASE("text points: names of surveyors, text of any extension with its columns named", "[unit]") {
  Text t;
  CHECK(t.read("Easting,Northing,Height\n1,2,3\n", {}, "a.csv").points.y == Doubles{2});
  CHECK(t.read("ID;N;E;H;Code\n7;1;2;3;wall\n", {}, "a.csv").points.x == Doubles{2});
  CHECK(t.read("X,Y,Elevation\n1,2,3\n", {}, "a.csv").points.z == Doubles{3});
  CHECK(t.read("East North Up X Y Z\n1 2 3 4 5 6\n", {}, "a.txt").points.x ==
        Doubles{4});  // the plainest names
  auto r = t.read("Lat,Lon,Alt\n48,9,300\n", {}, "a.csv");
  CHECK(r.points.x == Doubles{9});
  CHECK(r.info.crs.geographic);
  for (const char* name : {"a.txt", "a.dat", "a.neu", "a.asc", "a"}) {
    CAPTURE(name);
    r = t.read("P0 1 2 3 10\nP1 4 5 6 20\n", {"skip", "y", "x", "z", "i"}, name);
    CHECK(r.points.x == Doubles{2, 5});
    CHECK(r.info.attributes.intensity);
  }
  CHECK_THAT(t.error("P0 1 2 3\nP1 4 5 6\n", {}, "a.txt"), Catch::Contains("--columns"));
  CHECK_THAT(t.error("1 2 3\n4 5 6\n", {}, "a.neu"),
             Catch::Contains("north") && Catch::Contains("--columns"));
}

TEST_CASE("text points: separators may be mixed", "[unit]") {
  Text t;
  const auto r = t.read("1 2 3, 10 20 30\n4,5 6;40\t50 60\n");
  CHECK(r.points.x == Doubles{1, 4});
  CHECK(r.points.rgba == Colours{0xff1e140au, 0xff3c3228u});
}

TEST_CASE("text points: columns given by the user come first", "[unit]") {
  Text t;
  auto r = t.read("1 2 3 4\n5 6 7 8\n", {"_", "z", "y", "x"});
  CHECK(r.points.x == Doubles{4, 8});
  CHECK(r.points.z == Doubles{2, 6});
  r = t.read("a,b,c\n1,2,3\n", {"z", "y", "x"});
  CHECK(r.points.z == Doubles{1});
  r = t.read("p1 1 2 3\np2 4 5 6\n", {"name", "x", "y", "z"});
  CHECK(r.points.x == Doubles{1, 4});
  r = t.read("1 2 3 0.5 0.5 1\n4 5 6 0 0 0\n", {"x", "y", "z", "r", "g", "b"});
  CHECK(r.points.rgba == Colours{0xffff8080u, 0xff000000u});
  CHECK_THROWS_AS(t.read("1 2 3\n", {"x", "y"}), UsageError);
  CHECK_THROWS_AS(t.read("1 2 3\n", {"x", "y", "z", "X"}), UsageError);
}

TEST_CASE("text points: columns without names are told by what they hold", "[unit]") {
  Text t;
  CHECK(t.read("1 2 3 0.6 0.8 0\n4 5 6 0 0 0\n").info.attributes.normals);
  CHECK(t.read("1 2 3 10 20 30\n4 5 6 0 0 0\n").info.attributes.colour);
  CHECK_FALSE(t.read("1 2 3 10.5 20 30\n").info.attributes.colour);
  auto r = t.read("1 2 3 10 20 30 0 0 1\n");
  CHECK(r.info.attributes.colour);
  CHECK(r.info.attributes.normals);
  r = t.read("1 2 3 0 1 0 10 20 30\n");
  CHECK(r.points.ny == std::vector<float>{1});
  CHECK(r.points.rgba == Colours{0xff1e140au});
  r = t.read("1 2 3 -5 10 20 30\n");
  CHECK(r.points.rgba == Colours{0xff1e140au});
}

TEST_CASE("text points: PTS with its count, intensity and colours, several in one file", "[unit]") {
  Text t;
  auto r = t.read("2\n1 2 3 -100 10 20 30\n4 5 6 200 10 20 30\n1\n7 8 9 0 1 2 3\n", {}, "a.pts");
  CHECK(r.points.x == Doubles{1, 4, 7});
  CHECK(r.points.rgba == Colours{0xff1e140au, 0xff1e140au, 0xff030201u});
  CHECK(r.info.attributes.intensity);
  CHECK(r.info.declared_points == 2);
  r = t.read("5\n1 2 3 0.5\n4 5 6 0.25\n", {}, "a.pts");
  CHECK(r.points.size() == 2);
  CHECK(missing_points(r.info, r.counts) == 3);
  r = t.read("99999999999\n1 2 3\n", {}, "a.pts");
  CHECK(r.points.size() == 1);
}

TEST_CASE("text points: empty fields of CSV are no numbers, columns do not move", "[unit]") {
  Text t;
  const auto r = t.read("x,y,z\n1,,3\n,,\n4,5,6\n", {}, "a.csv");
  REQUIRE(r.points.size() == 3);
  CHECK(std::isnan(r.points.y[0]));
  CHECK(r.points.z[0] == 3);
  CHECK(std::isnan(r.points.z[1]));
}

TEST_CASE("text points: bad lines are named, a torn last one is left out", "[fault]") {
  Text t;
  std::string text;
  for (int i = 0; i < 100; ++i) text += std::to_string(i) + " 2 3\n";
  CHECK_THAT(t.error(text + "1 2\n3 4 5\n"), Catch::Contains("line 101") && Catch::Contains("'1 2'"));
  CHECK_THAT(t.error(text + "1 2 3x\n3 4 5\n"), Catch::Contains("line 101"));
  CHECK_THAT(t.error("1,5;2,5;3.5\n"), Catch::Contains("1,5;2,5;3.5"));
  const auto r = t.read(text + "100 2");
  CHECK(r.points.size() == 100);
  CHECK(r.counts.missing == 1);
  CHECK(r.counts.warnings.size() == 1);
  // In a later slice lines have no number; the byte says where.
  const test::TempFolder folder;
  const auto path = folder.write("b.xyz", text + "bad line\n" + text);
  const auto file = open_point_file(path, {});
  const auto slices = file->slices(0, 400);
  REQUIRE(slices.size() > 3);
  std::string message;
  for (const auto& s : slices) {
    try {
      file->read(s, [](const PointChunk&) {});
    } catch (const InputError& e) {
      message = e.what();
    }
  }
  CHECK_THAT(message, Catch::Contains("byte " + std::to_string(text.size())));
}

TEST_CASE("text points: what is no text of points is refused", "[fault]") {
  Text t;
  CHECK_THAT(t.error("# nothing\n\n"), Catch::Contains("no line with a point"));
  CHECK_THAT(t.error("1 2\n3 4\n"), Catch::Contains("line 1") && Catch::Contains("fewer than three"));
  CHECK_THAT(t.error("hello world\nfoo bar\n"), Catch::Contains("--columns"));
  CHECK_THAT(t.error("hello world\nfoo bar\n", {}, "a.txt"), Catch::Contains("no known format"));
  CHECK_THAT(t.error("1 2 3\n" + std::string(3 << 20, '1') + " 2 3\n"),
             Catch::Contains("a line of more than"));
  CHECK(t.read("1 2 3\n", {}, "a.txt").points.size() == 1);
  CHECK(t.read("x;y;z\n1;2;3\n", {}, "points").points.size() == 1);
}

TEST_CASE("text points: the real CSV has the points that its catalogue says", "[pipeline][.shared]") {
  if (!test::has_shared_data()) return;
  const std::filesystem::path path = test::kSharedData / "scans/car-cloud400.csv";
  const auto r = test::read_points(path);
  CHECK(r.points.size() == 24989);
  CHECK(r.info.attributes.normals);
  test::require_slices_agree(path, {}, {1000, 100000});
}

}  // namespace
}  // namespace tessera::text_points_test
