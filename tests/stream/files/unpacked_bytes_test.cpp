#include "stream/files/unpacked_bytes.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "tests/helpers/packed_text.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::unpacked_bytes_test {
namespace {

std::string sample(std::size_t bytes) {
  test::Random random(3);
  std::string text;
  while (text.size() < bytes)
    text += std::to_string(random.below(100000)) + (random.below(3) == 0 ? "\n" : " ");
  return text;
}

std::string error_of(const std::filesystem::path& path) {
  try {
    UnpackedBytes(path).size();
  } catch (const InputError& e) {
    return e.what();
  }
  return {};
}

TEST_CASE("unpacked bytes: any place in any order, members and frames joined", "[unit]") {
  const test::TempFolder folder;
  const std::string text = sample(1 << 20);
  const std::string a = text.substr(0, 300000), b = text.substr(300000);
  test::Random random(9);
  for (const std::string& packed :
       {test::gzip_of(text), test::gzip_of(a) + test::gzip_of("") + test::gzip_of(b), test::zstd_of(text),
        test::zstd_of(a) + std::string("\x50\x2a\x4d\x18\3\0\0\0abc", 11) + test::zstd_of(b)}) {
    const auto path = folder.write("a", packed);
    UnpackedBytes bytes(path);
    CHECK(bytes.size() == text.size());
    const ReadFile file = ReadFile::unpacked(path);
    CHECK(file.size() == text.size());
    for (int i = 0; i < 60; ++i) {
      const std::size_t at = random.below(text.size());
      std::string got(std::min<std::size_t>(random.below(200000), text.size() - at), '\0');
      file.read_at(at, got.data(), got.size());
      REQUIRE(got == text.substr(at, got.size()));
    }
    char more[8];
    CHECK(bytes.read_at(text.size() - 3, more, 8) == 3);
    CHECK_THROWS_AS(file.read_at(text.size() - 3, more, 8), InputError);
  }
}

TEST_CASE("unpacked bytes: text in UTF-16 of either order becomes UTF-8", "[unit]") {
  const test::TempFolder folder;
  std::u16string text = u"v 1 2 3\r\n# H\u00f6he \u20ac \U0001f600 ";
  std::string expected = "v 1 2 3\r\n# H\xc3\xb6he \xe2\x82\xac \xf0\x9f\x98\x80 ";
  text += char16_t{0xd83d};  // half of a pair, before what is no other half
  text += u"x";
  text += char16_t{0xde00};
  expected += "\xef\xbf\xbdx\xef\xbf\xbd";
  for (int i = 0; i < 40000; ++i) text += u"\u20ac \n", expected += "\xe2\x82\xac \n";  // across blocks
  for (const bool big : {false, true}) {
    std::string bytes = big ? "\xfe\xff" : "\xff\xfe";
    for (const char16_t c : text) {
      const char high = static_cast<char>(c >> 8), low = static_cast<char>(c & 0xff);
      bytes += big ? high : low;
      bytes += big ? low : high;
    }
    const auto path = folder.write("a.obj", bytes);
    CHECK(packed_format(bytes.substr(0, 4)) == "UTF-16");
    const ReadFile file = ReadFile::unpacked(path);
    REQUIRE(file.size() == expected.size());
    std::string got(expected.size(), '\0');
    file.read_at(0, got.data(), got.size());
    CHECK((got == expected));
    CHECK_THAT(error_of(folder.write("a.obj", bytes + "x")), Catch::Contains("truncated"));
  }
  CHECK(packed_format(std::string_view("\xff\xfe\0\0", 4)).empty());  // UTF-32
}

TEST_CASE("unpacked bytes: cut and damaged files are refused with their byte", "[fault]") {
  const test::TempFolder folder;
  const std::string text = sample(5000);
  for (const std::string& packed : {test::gzip_of(text), test::zstd_of(text)}) {
    for (std::size_t bytes = 4; bytes < packed.size(); bytes += 7) {
      CAPTURE(bytes);
      const auto path = folder.write("a", packed.substr(0, bytes));
      REQUIRE_THAT(error_of(path),
                   Catch::Contains("truncated") && Catch::Contains("byte " + std::to_string(bytes)));
    }
    std::string bad = packed;
    bad[bad.size() / 2] = static_cast<char>(bad[bad.size() / 2] ^ 0x55);
    CHECK_THAT(error_of(folder.write("a", bad)), Catch::Contains("damaged"));
    CHECK_THAT(error_of(folder.write("a", packed + "rest of something")),
               Catch::Contains("byte " + std::to_string(packed.size())));
  }
  CHECK_THAT(error_of(folder.write("a", text)), Catch::Contains("neither"));
  CHECK(error_of(folder.write("a", test::zstd_of(sample(9 << 20), 23))).empty());
  CHECK_THAT(error_of(folder.write("a", test::zstd_of(sample(17 << 20), 24))), Catch::Contains("8 MiB"));
}

}  // namespace
}  // namespace tessera::unpacked_bytes_test
