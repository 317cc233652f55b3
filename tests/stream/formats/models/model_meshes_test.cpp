// 3MF, VTU and MSH: what is written reads back to the bit, and what others write is read or refused by name.
#include <catch2/catch.hpp>

#include <cstring>
#include <string>
#include <vector>

#include "octree/error.h"
#include "stream/files/output_file.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/formats/models/edge_balance.h"
#include "stream/formats/models/zip_archive.h"
#include "stream/formats/models/zip_writer.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::model_meshes_test {
namespace {

using test::WholeMesh;

WholeMesh tetrahedron(bool doubles) {
  WholeMesh mesh;
  mesh.points = {{0, 0, 0}, {1.5, 0, 0}, {0, 1, 0}, {0.125, 0.25, 1}};
  if (doubles) mesh.points[3] = {0.1, 1.0 / 3.0, 1e-9};
  mesh.faces = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  mesh.header.vertices = 4, mesh.header.faces = 4;
  mesh.header.double_positions = doubles;
  mesh.header.comments = {"a <b> -- \"c\" & d"};
  mesh.header.shift = {5e5, 0, 1};
  return mesh;
}

std::string refusal(const std::filesystem::path& path) {
  try {
    test::read_whole(path);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

std::filesystem::path archive(const test::TempFolder& folder, const char* name,
                              const std::vector<std::pair<std::string, std::string>>& entries) {
  OutputFile file(folder / name);
  ZipWriter zip(file);
  for (const auto& [entry, bytes] : entries) zip.entry(entry, bytes);
  zip.finish();
  file.finish();
  return folder / name;
}

const std::string kRelations =
    R"(<Relationships><Relationship Target="/3D/m.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>)";
const std::string kTriangle =
    R"(<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices>)"
    R"(<triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>)";
std::string model(const std::string& resources, const std::string& build) {
  return R"(<?xml version="1.0"?><model unit="inch" xmlns="c" xmlns:p="p"><resources>)" + resources +
         "</resources><build>" + build + "</build></model>";
}

}  // namespace

TEST_CASE("models: 3MF, VTU and MSH read back what was written", "[unit]") {
  const test::TempFolder folder;
  for (const std::string name : {"a.vtu", "a.msh", "a.3mf"})
    for (const bool doubles : {false, true}) {
      INFO(name << (doubles ? " doubles" : " floats"));
      WholeMesh want = tetrahedron(doubles && name != "a.3mf");
      test::write_whole(folder / name, want);
      const WholeMesh got = test::read_whole(folder / name);
      CHECK(got.points == want.points);
      CHECK(got.faces == want.faces);
      CHECK(got.header.vertices == 4);
      CHECK(got.header.faces == 4);
      if (name != "a.msh") CHECK(got.header.double_positions == want.header.double_positions);
      const std::string bytes = test::file_bytes(folder / name);
      test::write_whole(folder / name, want);
      CHECK((test::file_bytes(folder / name) == bytes));
    }
}

TEST_CASE("models: 3MF far from zero counts from an origin, and names unit, shift and openness", "[unit]") {
  const test::TempFolder folder;
  WholeMesh mesh = tetrahedron(false);
  for (Double3& p : mesh.points) p[0] += 691600, p[1] += 5334700;
  mesh.header.double_positions = true;
  mesh.header.origin = {691600, 5334700, 0};
  mesh.header.unit = 1.0;
  test::write_whole(folder / "a.3mf", mesh);
  const WholeMesh got = test::read_whole(folder / "a.3mf");
  CHECK(got.points == mesh.points);
  CHECK(got.header.unit == 1.0);
  CHECK(got.header.shift == mesh.header.shift);
  CHECK(got.header.comments == mesh.header.comments);
  // The model, as other programs see it.
  const ReadFile file(folder / "a.3mf");
  const ZipArchive zip(file);
  REQUIRE(zip.find("/3d/3DMODEL.model") != nullptr);
  std::string text;
  zip.read(*zip.find("3D/3dmodel.model"), [&](std::string_view bytes) {
    text += bytes;
    return true;
  });
  CHECK_THAT(text, Catch::Contains("<model unit=\"meter\""));
  CHECK_THAT(text, Catch::Contains("<vertex x=\"1.5\" y=\"0\" z=\"0\"/>"));
  CHECK_THAT(text, Catch::Contains("<triangle v1=\"0\" v2=\"2\" v3=\"1\"/>"));
  CHECK_THAT(text, Catch::Contains("a &lt;b&gt; -- &quot;c&quot; &amp; d"));
  // Open and closed meshes.
  const auto open = [&](const WholeMesh& m) {
    const auto writer = create_mesh_file(folder / "b.3mf", m.header);
    writer->vertices(m.points, {});
    writer->faces(m.faces);
    writer->finish();
    return writer->rounding().open;
  };
  CHECK_FALSE(open(mesh));
  std::swap(mesh.faces[0][0], mesh.faces[0][1]);
  CHECK(open(mesh));
  mesh.faces.erase(mesh.faces.begin());
  mesh.header.faces = 3;
  CHECK(open(mesh));
  MeshRounding rounding;
  rounding.open = true;
  CHECK(rounding_notices(rounding).size() == 1);
}

TEST_CASE("models: what 3MF and solvers cannot hold is refused", "[unit]") {
  const test::TempFolder folder;
  WholeMesh mesh = tetrahedron(false);
  mesh.header.unit = 7.0;
  CHECK_THROWS_AS(test::write_whole(folder / "a.3mf", mesh), UsageError);
  mesh.header.unit = 0.0;
  mesh.faces[0][1] = mesh.faces[0][0];
  CHECK_THROWS_AS(test::write_whole(folder / "a.3mf", mesh), InputError);
  mesh.points[0][0] = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(test::write_whole(folder / "a.msh", mesh), InputError);
  MeshHeader empty;
  CHECK_THROWS_AS(create_mesh_file(folder / "b.3mf", empty), UsageError);
  empty.vertices = empty.faces = std::uint64_t{1} << 32;
  CHECK_THROWS_WITH(create_mesh_file(folder / "b.3mf", empty), Catch::Contains("2147483647"));
  CHECK_FALSE(std::filesystem::exists(folder / "b.3mf"));
}

TEST_CASE("models: VTU keeps colours and what closes holes, MSH drops them", "[unit]") {
  const test::TempFolder folder;
  WholeMesh mesh = tetrahedron(true);
  mesh.header.colour = mesh.header.synthetic = true;
  mesh.rgba = {1, 2, 0xff112233u, 4};
  const std::vector<std::uint8_t> flags = {0, 1, 0, 1};
  for (const char* name : {"a.vtu", "a.msh"}) {
    const auto writer = create_mesh_file(folder / name, mesh.header);
    writer->vertices(mesh.points, mesh.rgba);
    writer->faces(mesh.faces, flags);
    writer->finish();
  }
  CHECK(test::read_whole(folder / "a.vtu").rgba == mesh.rgba);
  const auto reader = open_mesh_file(folder / "a.vtu");
  REQUIRE(reader->has_synthetic());
  std::vector<std::uint8_t> got;
  std::vector<MeshFace> faces;
  reader->read_flagged_faces([&](std::span<const MeshFace> f, std::span<const std::uint8_t> s) {
    faces.insert(faces.end(), f.begin(), f.end()), got.insert(got.end(), s.begin(), s.end());
  });
  CHECK(got == flags);
  CHECK(faces == mesh.faces);
  CHECK_FALSE(test::read_whole(folder / "a.msh").header.colour);
  CHECK_FALSE(open_mesh_file(folder / "a.msh")->has_synthetic());
}

TEST_CASE("models: 3MF of components, copies and other parts comes out in place", "[unit]") {
  const test::TempFolder folder;
  const std::string resources =
      R"(<object id="1">)" + kTriangle + R"(</object><object id="2"><components>)" +
      R"(<component objectid="1" transform="1 0 0 0 1 0 0 0 1 10 0 0"/>)" +
      R"(<component p:path="/3D/other.model" objectid="1"/></components></object><object id="9">)" +
      kTriangle + "</object>";
  // A mirror along x: its faces turn, so that they look the same way out.
  const std::string build =
      R"(<item objectid="2" transform="-1 0 0 0 1 0 0 0 1 0 0 5"/><item objectid="1"/>)";
  const auto path = archive(folder, "a.3mf",
                            {{"_rels/.rels", kRelations},
                             {"3D/m.model", model(resources, build)},
                             {"3D/other.model", model(R"(<object id="1">)" + kTriangle + "</object>", "")}});
  const WholeMesh mesh = test::read_whole(path);
  CHECK(mesh.points == std::vector<Double3>{{-10, 0, 5},
                                            {-11, 0, 5},
                                            {-10, 1, 5},  // first use of object 1
                                            {0, 0, 5},
                                            {-1, 0, 5},
                                            {0, 1, 5},  // that of the other part
                                            {0, 0, 0},
                                            {1, 0, 0},
                                            {0, 1, 0}});  // second use of object 1
  CHECK(mesh.faces == std::vector<MeshFace>{{0, 2, 1}, {3, 5, 4}, {6, 7, 8}});
  CHECK(mesh.header.unit == 0.0254);
  CHECK(open_mesh_file(path)->warnings() ==
        std::vector<std::string>{"1 objects of the file are not built and left out"});
}

TEST_CASE("models: archives that are no sound 3MF are refused by name", "[unit]") {
  const test::TempFolder folder;
  const auto read = [&](const std::string& text) {
    return refusal(archive(folder, "a.3mf", {{"_rels/.rels", kRelations}, {"3D/m.model", text}}));
  };
  CHECK_THAT(refusal(archive(folder, "b.3mf", {{"x", "y"}})), Catch::Contains("no 3MF"));
  CHECK_THAT(refusal(archive(folder, "b.3mf", {{"_rels/.rels", kRelations}})),
             Catch::Contains("'3D/m.model' that the 3MF names is not in its archive"));
  CHECK_THAT(read(model("", R"(<item objectid="3"/>)")),
             Catch::Contains("object 3 is built, but not in the file"));
  CHECK_THAT(read(model(R"(<object id="1"><components><component objectid="1"/></components></object>)",
                        R"(<item objectid="1"/>)")),
             Catch::Contains("may be part of itself"));
  CHECK_THAT(read("<!DOCTYPE a><model/>"), Catch::Contains("document type declaration"));
  CHECK_THAT(read("<model><resources>"), Catch::Contains("line 1"));
  std::string beyond = kTriangle;
  beyond.replace(beyond.find("v3=\"2\""), 6, "v3=\"3\"");
  CHECK_THAT(read(model(R"(<object id="1">)" + beyond + "</object>", R"(<item objectid="1"/>)")),
             Catch::Contains("object 1"));
  // A bit of the packed bytes, and the end of the archive.
  const auto path =
      archive(folder, "c.3mf", {{"_rels/.rels", kRelations}, {"3D/m.model", model(kTriangle, "")}});
  std::string bytes = test::file_bytes(path);
  std::string bad = bytes;
  bad[bytes.size() / 2] = static_cast<char>(bad[bytes.size() / 2] ^ 4);
  CHECK_FALSE(refusal(folder.write("d.3mf", bad)).empty());
  CHECK_THAT(refusal(folder.write("d.3mf", bytes.substr(0, bytes.size() - 30))), Catch::Contains("cut off"));
}

TEST_CASE("models: grids of VTK and meshes of Gmsh in forms that are not read say how to save them",
          "[unit]") {
  const test::TempFolder folder;
  CHECK_THAT(refusal(folder.write("a.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n")),
             Catch::Contains("gmsh -format msh41 -bin"));
  const auto vtu = [&](const std::string& text) { return refusal(folder.write("a.vtu", text)); };
  const std::string head = R"(<VTKFile type="UnstructuredGrid" byte_order="LittleEndian")";
  CHECK_THAT(vtu(head + R"( compressor="vtkZLibDataCompressor"></VTKFile>)"),
             Catch::Contains("without compression"));
  CHECK_THAT(
      vtu(head + R"(><UnstructuredGrid><Piece NumberOfPoints="1" NumberOfCells="0"><Points><DataArray )"
                 R"(format="ascii"/></Points></Piece></UnstructuredGrid></VTKFile>)"),
      Catch::Contains("appended raw data"));
  CHECK_THAT(vtu(R"(<VTKFile type="PolyData"></VTKFile>)"), Catch::Contains("no unstructured grid"));
  // A truncated one of our own.
  for (const char* name : {"b.vtu", "b.msh"}) {
    test::write_whole(folder / name, tetrahedron(true));
    const std::string bytes = test::file_bytes(folder / name);
    for (const std::size_t keep : {bytes.size() / 2, bytes.size() - 60})
      CHECK_THAT(refusal(folder.write(name, bytes.substr(0, keep))),
                 Catch::StartsWith((folder / name).string()));
  }
}

TEST_CASE("models: an archive holds its entries, whatever their size", "[property]") {
  const test::TempFolder folder;
  test::Random random(7);
  std::string large;
  for (int i = 0; i < 300'000; ++i)
    large += std::to_string(random.below(100'000)) + (i % 7 == 0 ? "\n" : " ");
  const auto path = archive(folder, "a.zip", {{"empty", ""}, {"a/b", "text"}, {"large", large}});
  const ReadFile file(path);
  CHECK(file.size() < large.size());
  const ZipArchive zip(file);
  for (const auto& [name, want] :
       std::vector<std::pair<std::string, std::string>>{{"empty", ""}, {"a/b", "text"}, {"large", large}}) {
    REQUIRE(zip.find(name) != nullptr);
    std::string got;
    zip.read(*zip.find(name), [&](std::string_view bytes) {
      got += bytes;
      return true;
    });
    CHECK((got == want));
  }
  CHECK(zip.find("none") == nullptr);
}

TEST_CASE("models: edges balance for closed meshes in any order, and for no others", "[property]") {
  test::Random random(3);
  // An octahedron over and over, each with vertices of its own, faces in any order.
  std::vector<MeshFace> faces;
  for (std::uint64_t k = 0; k < 200; ++k)
    for (std::uint64_t i = 0; i < 4; ++i) {
      faces.push_back({6 * k + i, 6 * k + (i + 1) % 4, 6 * k + 4});
      faces.push_back({6 * k + (i + 1) % 4, 6 * k + i, 6 * k + 5});
    }
  for (std::size_t i = faces.size(); i > 1; --i) std::swap(faces[i - 1], faces[random.below(i)]);
  EdgeBalance whole;
  for (const MeshFace& f : faces) whole.face(f);
  CHECK(whole.closed());
  for (std::size_t gone = 0; gone < faces.size(); gone += 17) {
    EdgeBalance part, turned;
    for (std::size_t i = 0; i < faces.size(); ++i) {
      if (i != gone) part.face(faces[i]);
      turned.face(i == gone ? MeshFace{faces[i][0], faces[i][2], faces[i][1]} : faces[i]);
    }
    CHECK_FALSE(part.closed());
    CHECK_FALSE(turned.closed());
  }
}

}  // namespace tessera::model_meshes_test
