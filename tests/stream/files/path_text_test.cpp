// Names in JSON: whatever bytes they hold comes back.
#include "stream/files/path_text.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>

#include "tests/helpers/random.h"

namespace path_text_test {

using namespace tessera;

TEST_CASE("path text: any bytes are valid JSON and come back", "[property]") {
  for (const char* plain : {"", "scan.las", "Gel\xc3\xa4nde.ply", "\xf0\x9f\x8f\x94"})
    CHECK(json_text(std::string(plain)) == plain);
  test::Random random(3);
  std::size_t changed = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    std::string name;
    for (std::uint64_t i = random.below(12); i > 0; --i) {
      const std::uint64_t kind = random.below(4);
      if (kind == 0) name += static_cast<char>(1 + random.below(255));
      if (kind == 1) name += "\xe2\x82\xac";
      if (kind == 2) name += json_text(std::string("\xff"));  // what stands for a byte, in a name itself
      if (kind == 3) name += 'x';
    }
    const std::string text = json_text(name);
    changed += text != name;
    CHECK_NOTHROW(dump_json(Json(text)));
    CHECK(bytes_of_json_text(text) == name);
  }
  CHECK(changed > 1000);
}

}  // namespace path_text_test
