/// \file mesh_samples.h
/// Small meshes in all formats, for damage to begin from: the mutation test and the fuzz targets.
#pragma once
#include <cstdint>
#include <cstring>
#include <string>
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

}  // namespace tessera::fuzz
