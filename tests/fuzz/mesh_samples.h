/// \file mesh_samples.h
/// Small meshes in all formats, for damage to begin from: the mutation test and the fuzz targets.
#pragma once
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

namespace tessera::fuzz {

inline std::vector<std::string> ply_meshes() {
  const std::string ascii = "0 0 0 1\n1 0 0 2\n0 1 0 3\n0 0 1 4\n";
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty double y\nproperty float z\n"
      "property uchar red\nelement ";
  const std::string list = "\nproperty list uchar int vertex_indices\nend_header\n";
  return {head + "face 2" + list + ascii + "4 0 1 2 3\n3 0 3 1\n",
          head + "tristrips 1" + list + ascii + "8 0 1 2 3 -1 3 2 1\n"};
}

inline std::vector<std::string> obj_meshes() {
  return {"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1/1 2//2 \\\n 3/1\nf -1 -2 -3\ng f\nf 3 2 1"};
}

inline std::vector<std::string> off_meshes() {
  return {"OFF\n# c\n3 2 0\n0 0 0\n1 0 0\n0 1 0 # d\n3 0 1 2 255 0 0\n4 0 1 2 0\n",
          "COFF3 1 3\n0 0 0 1 2 3 4\n1 0 0 .1 .2 .3 1\n0 1 0 9 9 9\n3 0 1 2\n"};
}

inline std::vector<std::string> stl_meshes() {
  const std::string facet =
      "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
  std::string binary(84 + 2 * 50, '\0');
  binary[80] = 2;
  const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  for (std::size_t f = 0; f < 2; ++f) std::memcpy(binary.data() + 84 + 50 * f + 12, corners, sizeof corners);
  return {"solid a\n" + facet + facet + "endsolid a\n", binary};
}

/// One triangle, moved by its node.
inline std::vector<std::string> glb_meshes() {
  std::string json =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"translation":[1,2,3]}],)"
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],"buffers":[{"byteLength":44}],)"
      R"("bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],)"
      R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},)"
      R"({"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}]})";
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string binary(44, '\0');
  const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::uint16_t indices[] = {0, 1, 2};
  std::memcpy(binary.data(), corners, sizeof corners);
  std::memcpy(binary.data() + 36, indices, sizeof indices);
  std::string file;
  const auto word = [&](std::size_t value) {
    const auto bits = static_cast<std::uint32_t>(value);
    file.append(reinterpret_cast<const char*>(&bits), 4);
  };
  file = "glTF";
  word(2), word(12 + 8 + json.size() + 8 + binary.size());
  word(json.size()), file += "JSON" + json;
  word(binary.size()), file += std::string("BIN\0", 4) + binary;
  return {file};
}

/// A model of two triangles in place of one, stored and not packed, so that damage meets its XML: checksums, which would stop all of
/// it, are 0 and not asked for in these builds.
inline std::vector<std::string> threemf_meshes() {
  const std::pair<std::string, std::string> entries[] = {
      {"_rels/.rels", R"(<Relationships><Relationship Target="/m" Type="/3dmodel"/></Relationships>)"},
      {"m",
       R"(<model unit="inch"><metadata name="tessera:origin">1 2 3</metadata><resources><object id="1"><mesh><vertices>)"
       R"(<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices><triangles>)"
       R"(<triangle v1="0" v2="1" v3="2"/></triangles></mesh></object><object id="2"><components>)"
       R"(<component objectid="1" transform="1 0 0 0 1 0 0 0 1 9 0 0"/></components></object></resources><build>)"
       R"(<item objectid="1"/><item objectid="2" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/></build></model>)"}};
  std::string file, list;
  const auto put = [](std::string& to, std::size_t value, int bytes) {
    for (int k = 0; k < bytes; ++k) to.push_back(static_cast<char>(value >> (8 * k) & 255u));
  };
  for (const auto& [name, bytes] : entries) {
    std::string sizes;
    for (const std::size_t n : {bytes.size(), bytes.size()}) put(sizes, n, 4);
    put(sizes, name.size(), 2), put(sizes, 0, 2);
    list += "PK\1\2" + std::string(16, '\0') + sizes + std::string(10, '\0');
    put(list, file.size(), 4), list += name;
    file += "PK\3\4" + std::string(14, '\0') + sizes + name + bytes;
  }
  const std::size_t at = file.size();
  file += list + "PK\5\6" + std::string(6, '\0');
  put(file, 2, 2), put(file, list.size(), 4), put(file, at, 4), put(file, 0, 2);
  return {file};
}

/// A triangle and a quad.
inline std::vector<std::string> vtu_meshes() {
  std::string file =
      R"(<VTKFile type="UnstructuredGrid" byte_order="LittleEndian"><UnstructuredGrid><Piece NumberOfPoints="4" )"
      R"(NumberOfCells="2"><Points><DataArray type="Float32" NumberOfComponents="3" format="appended" offset="0"/></Points>)"
      R"(<Cells><DataArray type="Int32" Name="connectivity" format="appended" offset="52"/>)"
      R"(<DataArray type="Int32" Name="offsets" format="appended" offset="84"/>)"
      R"(<DataArray type="UInt8" Name="types" format="appended" offset="96"/></Cells></Piece></UnstructuredGrid>)"
      R"(<AppendedData encoding="raw">_)";
  const auto array = [&](const auto& values, std::size_t bytes) {
    const auto size = static_cast<std::uint32_t>(bytes);
    file.append(reinterpret_cast<const char*>(&size), 4);
    file.append(reinterpret_cast<const char*>(values), bytes);
  };
  const float points[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  const std::int32_t corners[] = {0, 1, 2, 0, 1, 2, 3}, ends[] = {3, 7};
  const std::uint8_t types[] = {5, 9};
  array(points, sizeof points), array(corners, sizeof corners), array(ends, sizeof ends), array(types, 2);
  return {file + "</AppendedData></VTKFile>"};
}

/// The same, behind a section that is passed over.
inline std::vector<std::string> msh_meshes() {
  std::string file = "$MeshFormat\n4.1 1 8\n\1";
  file += std::string(3, '\0') + "\n$EndMeshFormat\n$Comments\n$ all\n$EndComments\n$Nodes\n";
  const auto put = [&](const auto& value) {
    file.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  const auto all = [&](std::initializer_list<std::uint64_t> values) {
    for (const std::uint64_t v : values) put(v);
  };
  const auto head = [&](std::initializer_list<std::int32_t> values) {
    for (const std::int32_t v : values) put(v);
  };
  all({1, 4, 1, 4}), head({2, 1, 0}), all({4, 1, 2, 3, 4});
  for (const double x : {0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.}) put(x);
  file += "\n$EndNodes\n$Elements\n";
  all({2, 2, 1, 2}), head({2, 1, 2}), all({1, 1, 1, 2, 3}), head({2, 1, 3}), all({1, 2, 1, 2, 3, 4});
  return {file + "\n$EndElements\n"};
}

}  // namespace tessera::fuzz
