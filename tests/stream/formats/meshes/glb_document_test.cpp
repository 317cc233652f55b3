// The JSON of a GLB: what is asked for stays, nothing else costs memory.
#include "stream/formats/meshes/glb_document.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "stream/formats/meshes/texture_reader.h"
#include "tests/helpers/glb_file.h"
#include "tests/helpers/temp_folder.h"

namespace glb_document_test {

using namespace tessera;
using namespace tessera::test;

namespace {

Json document(const std::string& text) {
  const TempFolder folder;
  const ReadFile file(folder.write("a.json", text));
  return read_glb_document(ByteWindow(file, 0, file.size(), 4096), "a.glb");
}

std::string repeated(const std::string& word, std::size_t times) {
  std::string text;
  for (std::size_t i = 0; i < times; ++i) text += word;
  return text;
}

}  // namespace

TEST_CASE("glb document: keys that meshes use stay as they are", "[unit]") {
  const Json kept = document(
      R"({"asset":{"generator":"g","extras":{"tessera_shift":[1,2,3]}},"scene":0,"scenes":[{"nodes":[0]}],
          "nodes":[{"mesh":0,"extras":{"mesh":7,"deep":[[{"scene":1}]]},"matrix":[1.5,-2]}],
          "animations":[{"count":3}],"accessors":[{"count":3,"max":[1],"sparse":{"count":1},"type":"VEC3"}],
          "buffers":[{"uri":"data:abc","byteLength":4}]})");
  CHECK(kept == parse_json(
                    R"({"asset":{"generator":"g","extras":{"tessera_shift":[1,2,3]}},"scene":0,
                        "scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"matrix":[1.5,-2]}],
                        "accessors":[{"count":3,"sparse":{"count":1},"type":"VEC3"}],
                        "buffers":[{"uri":null,"byteLength":4}]})"));
}

TEST_CASE("glb document: depth, count and length have an end", "[fault]") {
  CHECK_THROWS_AS(document(R"({"extras":)" + repeated("[", 100) + repeated("]", 100) + "}"), InputError);
  CHECK_THROWS_AS(document(R"({"nodes":[0)" + repeated(",0", 500000) + "]}"), InputError);
  CHECK_THROWS_AS(document(R"({"extras":")" + std::string(5 << 20, 'x') + "\"}"), InputError);
  CHECK_THROWS_AS(document(R"({"extras":[{})" + repeated(",{}", 2000000) + "]}"), InputError);
  CHECK_THROWS_AS(document("[]"), InputError);
  CHECK_THROWS_AS(document(R"({"nodes":)"), InputError);
  CHECK_THROWS_AS(document(""), InputError);
  // what is not asked for may be as much as it likes
  CHECK(document(R"({"extras":[{})" + repeated(",{}", 500000) + R"(],"scene":1})") == Json{{"scene", 1}});
}

TEST_CASE("glb textures: another version, and lists that are none, are refused with a sentence", "[unit]") {
  const TempFolder folder;
  const auto opened = [&](const std::string& bytes) {
    return open_textures(folder.write("a.glb", bytes), 1 << 20) != nullptr;
  };
  GlbFile file;
  const Json primitive = {
      {"attributes",
       {{"POSITION", file.floats({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}})},
        {"TEXCOORD_0",
         file.accessor(file.view(packed_numbers<float>(std::vector<double>(6, 0.5))), 5126, 3, "VEC2")}}},
      {"material", 0}};
  const Json more = {
      {"materials", Json::array({Json{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}})},
      {"textures", Json::array({Json{{"source", 0}}})},
      {"images", Json::array({Json{{"uri", "a.png"}}})}};
  const auto bytes = [&](const Json& changed) {
    Json all = more;
    all.update(changed);
    return file.bytes(Json::array({primitive}), Json::array({Json{{"mesh", 0}}}), all);
  };
  std::string good = bytes(Json::object());
  CHECK(opened(good));
  for (const char* list :
       {"materials", "textures", "images", "nodes", "meshes", "accessors", "bufferViews"}) {
    CAPTURE(list);
    CHECK_THROWS_AS(opened(bytes({{list, {{"index", 1}}}})), InputError);
  }
  CHECK_THROWS_AS(opened(bytes({{"materials", Json::array({1})}})), InputError);
  CHECK_THROWS_AS(opened(bytes({{"meshes", Json::array({Json{{"primitives", 3}}})}})), InputError);
  good[4] = 1;
  CHECK_THROWS_WITH(opened(good), Catch::Contains("glTF version 1 is not read"));
}

}  // namespace glb_document_test
