// The JSON of a GLB: what is asked for stays, nothing else costs memory.
#include "stream/formats/meshes/glb_document.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
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

}  // namespace glb_document_test
