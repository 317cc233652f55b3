// `convert` to LandXML and DXF, read back: every coordinate to the last bit, northing before easting.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/helpers/command.h"
#include "tests/helpers/height_sheet.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace tin_test {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

constexpr double kX = 691600.1234567891, kY = 5334700.9876543211;

/// A house on a slope: its roof's ridge and eaves bend, nothing overhangs.
double roof(double x, double y) {
  const bool inside = x >= 2 && x <= 8 && y >= 2 && y <= 8;
  return 500.1 + 0.1 * x + (inside ? 3.0 - 0.5 * std::abs(x - 5.0) : 0.0);
}

CommandResult convert(std::vector<std::string> words) {
  words.insert(words.begin(), "convert");
  return tessera_command(words);
}

/// An element by its own words: enough to walk what was written, and to see that it is well-formed.
struct XmlWalk {
  std::vector<std::string> open;
  std::map<std::string, std::vector<std::string>> texts, tags;  ///< by path
  bool well_formed = true;

  explicit XmlWalk(const std::string& text) {
    std::size_t at = 0;
    while (at < text.size()) {
      const std::size_t start = text.find('<', at);
      if (start == std::string::npos) break;
      if (!open.empty() && start > at) {
        const std::string between = text.substr(at, start - at);
        if (between.find_first_not_of(" \n") != std::string::npos) texts[path()].push_back(between);
      }
      const std::size_t end = text.find('>', start);
      if (end == std::string::npos) {
        well_formed = false;
        break;
      }
      const std::string tag = text.substr(start + 1, end - start - 1);
      at = end + 1;
      if (tag[0] == '?') continue;
      if (tag[0] == '/') {
        if (open.empty() || open.back() != tag.substr(1)) {
          well_formed = false;
          break;
        }
        open.pop_back();
        continue;
      }
      open.push_back(tag.substr(0, tag.find_first_of(" /")));
      tags[path()].push_back(tag);
      if (tag.back() == '/') open.pop_back();
    }
    well_formed = well_formed && open.empty();
  }
  std::string path() const {
    std::string all;
    for (const std::string& o : open) all += "/" + o;
    return all;
  }
};

std::vector<double> numbers(const std::string& text) {
  std::vector<double> out;
  const char *at = text.data(), *const end = at + text.size();
  while (at < end) {
    while (at < end && (*at == ' ' || *at == '\n')) ++at;
    double value = 0.0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc()) break;
    out.push_back(value), at = next;
  }
  return out;
}

const std::string kSurface = "/LandXML/Surfaces/Surface", kDefinition = kSurface + "/Definition";

/// Pairs of lines: a group code and its value.
std::vector<std::pair<int, std::string>> dxf_groups(const std::string& text) {
  std::vector<std::pair<int, std::string>> groups;
  std::istringstream lines(text);
  for (std::string code, value; std::getline(lines, code) && std::getline(lines, value);)
    groups.emplace_back(std::stoi(code), value);
  return groups;
}

struct DxfEntity {
  std::string kind, layer;
  std::map<int, double> value;
};
std::vector<DxfEntity> dxf_entities(const std::string& text) {
  std::vector<DxfEntity> entities;
  bool inside = false;
  for (const auto& [code, value] : dxf_groups(text)) {
    if (code == 2 && value == "ENTITIES") inside = true;
    if (!inside) continue;
    if (code == 0) entities.push_back({value, "", {}});
    if (entities.empty()) continue;
    if (code == 8) entities.back().layer = value;
    if (code >= 10 && code < 80) entities.back().value[code] = std::stod(value);
  }
  return entities;
}

}  // namespace

TEST_CASE("tin: LandXML has every point as northing, easting, elevation, and every face", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = folder.write("a & b.off", height_sheet(20, 10.0, kX, kY, roof)),
                 out = folder / "site.xml";
  folder.write(
      "a & b.off.prj",
      R"(PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1],AUTHORITY["EPSG","32632"]])");
  const CommandResult r = convert({mesh.string(), "-o", out.string(), "--breaklines", "10"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(r.errors.empty());
  const XmlWalk xml(file_bytes(out));
  REQUIRE(xml.well_formed);
  const WholeMesh want = read_whole(mesh);
  const auto& points = xml.texts.at(kDefinition + "/Pnts/P");
  const auto& faces = xml.texts.at(kDefinition + "/Faces/F");
  REQUIRE(points.size() == want.points.size());
  REQUIRE(faces.size() == want.faces.size());
  bool same = true;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const std::vector<double> p = numbers(points[k]);
    same = same && p == std::vector<double>{want.points[k][1], want.points[k][0], want.points[k][2]};
    same = same && xml.tags.at(kDefinition + "/Pnts/P")[k] == "P id=\"" + std::to_string(k + 1) + "\"";
  }
  for (std::size_t k = 0; k < faces.size(); ++k)
    for (std::size_t c = 0; c < 3; ++c)
      same = same && numbers(faces[k])[c] == static_cast<double>(want.faces[k][c] + 1);
  CHECK(same);
  CHECK_THAT(xml.tags.at("/LandXML")[0], Catch::Contains("http://www.landxml.org/schema/LandXML-1.2"));
  CHECK_THAT(xml.tags.at("/LandXML/Units/Metric")[0], Catch::Contains("linearUnit=\"meter\""));
  CHECK_THAT(xml.tags.at("/LandXML/CoordinateSystem")[0], Catch::Contains("epsgCode=\"32632\""));
  CHECK_THAT(xml.tags.at("/LandXML/CoordinateSystem")[0], Catch::Contains("UTM zone 32N"));
  CHECK(xml.tags.at(kSurface)[0] == "Surface name=\"site\"");
  CHECK_THAT(xml.tags.at(kDefinition)[0], Catch::Contains("surfType=\"TIN\""));
  // The ridge is one straight line along y, from gable to gable; all points of lines lie on the mesh.
  std::set<std::vector<double>> vertices;
  for (const Double3& p : want.points) vertices.insert({p[1], p[0], p[2]});
  bool ridge = false, on_mesh = true;
  for (const std::string& text : xml.texts.at(kSurface + "/SourceData/Breaklines/Breakline/PntList3D")) {
    const std::vector<double> line = numbers(text);
    REQUIRE(line.size() % 3 == 0);
    REQUIRE(line.size() >= 6);
    bool along = line.size() >= 3 * 10;
    for (std::size_t k = 0; k < line.size(); k += 3) {
      on_mesh = on_mesh && vertices.count({line[k], line[k + 1], line[k + 2]}) == 1;
      along = along && std::abs(line[k + 1] - (kX + 5.0)) < 1e-6;
    }
    ridge = ridge || along;
  }
  CHECK(on_mesh);
  CHECK(ridge);
  // The same bytes again.
  const std::string first = file_bytes(out);
  REQUIRE(convert({mesh.string(), "-o", out.string(), "--breaklines", "10", "--force"}).code == 0);
  CHECK((file_bytes(out) == first));
}

TEST_CASE("tin: DXF has every face with its corners in full, as programs read it", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = folder.write("roof.off", height_sheet(20, 10.0, kX, kY, roof)),
                 out = folder / "roof.dxf";
  const CommandResult r = convert({mesh.string(), "-o", out.string(), "--breaklines", "10"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const WholeMesh want = read_whole(mesh);
  std::size_t faces = 0, lines = 0;
  bool same = true;
  for (const DxfEntity& e : dxf_entities(file_bytes(out))) {
    if (e.kind == "POLYLINE") ++lines, same = same && e.layer == "BREAKLINES";
    if (e.kind != "3DFACE") continue;
    REQUIRE(faces < want.faces.size());
    same = same && e.layer == "TIN";
    for (int corner = 0; corner < 4; ++corner)
      for (int axis = 0; axis < 3; ++axis)
        same = same && e.value.at(10 * (axis + 1) + corner) ==
                           want.points[want.faces[faces][static_cast<std::size_t>(std::min(corner, 2))]]
                                      [static_cast<std::size_t>(axis)];
    ++faces;
  }
  CHECK(faces == want.faces.size());
  CHECK(lines > 0);
  CHECK(same);
  const std::string first = file_bytes(out);
  REQUIRE(convert({mesh.string(), "-o", out.string(), "--breaklines", "10", "--force"}).code == 0);
  CHECK((file_bytes(out) == first));
  if (shell("ogrinfo --version").code != 0) return skip("there is no ogrinfo (gdal-bin)");
  const Outcome ogr = shell("ogrinfo -ro -al -so " + out.string());
  INFO(ogr.said);
  CHECK(ogr.code == 0);
  CHECK(ogr.said.find("ERROR") == std::string::npos);
  CHECK(ogr.said.find("Feature Count: " + std::to_string(faces + lines)) != std::string::npos);
  const Outcome one = shell("ogrinfo -ro -al -q -fid 0 " + out.string() + "; ogrinfo -ro -al -q " +
                            out.string() + " | grep -c 'Layer (String) = TIN'");
  CHECK_THAT(one.said, Catch::Contains(std::to_string(faces)));
}

TEST_CASE("tin: what a mesh was moved by is put back, also into breaklines", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = folder.write(
      "moved.ply",
      "ply\nformat ascii 1.0\ncomment tessera_shift 691600 5334700.5 500\nelement vertex 4\nproperty double "
      "x\nproperty "
      "double y\nproperty double z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
      "0.125 0.25 0\n1.125 0.25 0\n0.125 1.25 0\n1.125 1.25 5\n3 0 1 2\n3 1 3 2\n");
  REQUIRE(convert({mesh.string(), "-o", (folder / "a.xml").string(), "--breaklines", "45"}).code == 0);
  const XmlWalk xml(file_bytes(folder / "a.xml"));
  CHECK(numbers(xml.texts.at(kDefinition + "/Pnts/P")[0]) ==
        std::vector<double>{5334700.75, 691600.125, 500.0});
  CHECK(numbers(xml.texts.at(kSurface + "/SourceData/Breaklines/Breakline/PntList3D")[0]) ==
        std::vector<double>{5334700.75, 691601.125, 500.0, 5334701.75, 691600.125, 500.0});
  REQUIRE(convert({mesh.string(), "-o", (folder / "a.dxf").string()}).code == 0);
  const auto entities = dxf_entities(file_bytes(folder / "a.dxf"));
  const auto face =
      std::find_if(entities.begin(), entities.end(), [](const DxfEntity& e) { return e.kind == "3DFACE"; });
  REQUIRE(face != entities.end());
  CHECK(face->value.at(10) == 691600.125);
  CHECK(face->value.at(20) == 5334700.75);
  CHECK(face->value.at(30) == 500.0);
}

TEST_CASE("tin: what overhangs is refused, left out or kept, and counted", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = folder / "bracket.ply", out = folder / "bracket.xml";
  write_whole(mesh, made_bracket(2));
  const CommandResult refused = convert({mesh.string(), "-o", out.string()});
  CHECK(refused.code == 6);
  CHECK_THAT(refused.errors, Catch::Contains("--overhangs drop"));
  CHECK_FALSE(fs::exists(out));
  const CommandResult dropped = convert({mesh.string(), "-o", out.string(), "--overhangs", "drop"});
  CHECK(dropped.code == 0);
  CHECK_THAT(dropped.errors, Catch::Contains("not in the TIN"));
  // Of 14 squares two show up, each of 8 faces.
  CHECK(XmlWalk(file_bytes(out)).texts.at(kDefinition + "/Faces/F").size() == 16);
  CHECK(convert({mesh.string(), "-o", out.string(), "--overhangs", "keep", "--force"}).code == 0);
  CHECK(XmlWalk(file_bytes(out)).texts.at(kDefinition + "/Faces/F").size() == 14 * 8);
  // DXF has faces in space. All 17 convex edges and the concave one are breaklines, joined at corners only.
  const fs::path dxf = folder / "bracket.dxf";
  CHECK(convert({mesh.string(), "-o", dxf.string(), "--breaklines", "30"}).code == 0);
  const auto entities = dxf_entities(file_bytes(dxf));
  CHECK(std::count_if(entities.begin(), entities.end(),
                      [](const DxfEntity& e) { return e.kind == "3DFACE"; }) == 14 * 8);
  const auto vertices =
      std::count_if(entities.begin(), entities.end(), [](const DxfEntity& e) { return e.kind == "VERTEX"; });
  const auto lines = std::count_if(entities.begin(), entities.end(),
                                   [](const DxfEntity& e) { return e.kind == "POLYLINE"; });
  // 22 unit edges of two pieces each.
  CHECK(vertices - lines == 44);
}

TEST_CASE("tin: limits, units and wrong words are told in a sentence", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = folder.write("roof.off", height_sheet(10, 10.0, kX, kY, roof)),
                 xml = folder / "a.xml";
  const auto refused = [&](std::vector<std::string> words, int code, const std::string& why) {
    const CommandResult r = convert(words);
    CAPTURE(words, r.errors);
    CHECK(r.code == code);
    CHECK_THAT(r.errors, Catch::Contains(why));
    CHECK_FALSE(fs::exists(xml));
  };
  refused({mesh.string(), "-o", xml.string(), "--max-faces", "199"}, 6,
          "has 200 faces and --max-faces is 199");
  refused({mesh.string(), "-o", (folder / "a.obj").string(), "--breaklines", "30"}, 2, "CAD programs");
  refused({mesh.string(), "-o", xml.string(), "--overhangs", "bend"}, 2, "--overhangs");
  refused({mesh.string(), "-o", xml.string(), "--crs", "EPSG:4326"}, 2, "degrees");
  refused({mesh.string(), "-o", xml.string(), "--crs", "EPSG:1"}, 2, "--crs");
  refused({folder.write("points.xyz", "0 0 0\n1 1 1\n").string(), "-o", xml.string()}, 3, "points.xyz");
  refused({folder.write("empty.off", "OFF 3 0 0\n0 0 0\n1 0 0\n0 1 0\n").string(), "-o", xml.string()}, 5,
          "no faces");
  const CommandResult metres = convert({mesh.string(), "-o", xml.string(), "--max-faces", "200"});
  CHECK(metres.code == 0);
  CHECK_THAT(metres.errors, Catch::Contains("count as metres"));
  REQUIRE(convert({mesh.string(), "-o", xml.string(), "--crs", "EPSG:2229", "--force"}).code == 0);
  CHECK_THAT(file_bytes(xml), Catch::Contains("USSurveyFoot"));
  REQUIRE(convert({mesh.string(), "-o", xml.string(), "--unit", "foot", "--force"}).code == 0);
  CHECK_THAT(file_bytes(xml), Catch::Contains("linearUnit=\"foot\""));
}

TEST_CASE("tin: 1.3 million faces stream in bounded memory", "[memory]") {
  const TempFolder folder;
  write_sheet(folder / "big.ply", 800, [](int i, int j) {
    return Double3{i * 0.5, j * 0.5, std::sin(i * 0.05) * std::cos(j * 0.05)};
  });
  for (const char* name : {"big.xml", "big.dxf"}) {
    const CommandResult r = convert({(folder / "big.ply").string(), "-o", (folder / name).string()});
    CAPTURE(r.errors);
    CHECK(r.code == 0);
    CHECK(r.peak_bytes < std::uint64_t{200} << 20);
  }
}

}  // namespace tin_test
