// Text of points and PLY under gzip and zstd: the same points as without.
#include <algorithm>

#include "stream/runtime/memory_budget.h"
#include "tests/helpers/command.h"
#include "tests/helpers/packed_text.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::packed_points_test {
namespace {

std::string rows(std::size_t count, const std::string& end) {
  test::Random random(11);
  std::string text;
  for (std::size_t i = 0; i < count; ++i) {
    for (int a = 0; a < 3; ++a) text += std::to_string(random.in(-100, 100)) + " ";
    text += "0.5 10 20 " + std::to_string(random.below(256)) + end;
  }
  return text;
}

std::string ptx(std::size_t scans) {
  std::string text;
  for (std::size_t s = 0; s < scans; ++s) {
    text += "100\n30\n" + std::to_string(s) +
            " 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n" + rows(3000, "\n");
  }
  return text;
}

TEST_CASE("packed points: text, PTX and PLY give the same points packed and not, in one slice", "[unit]") {
  const test::TempFolder folder;
  const std::string ply_header =
      "element vertex 5000\nproperty float x\nproperty float y\nproperty float z\nproperty float i\nproperty "
      "uchar red\n"
      "property uchar green\nproperty uchar blue\nend_header\n";
  std::string binary = "ply\nformat binary_little_endian 1.0\n" + ply_header;
  for (int i = 0; i < 5000; ++i) {
    for (int k = 0; k < 4; ++k) test::put(binary, static_cast<float>(i * k));
    binary += "rgb";
  }
  const std::vector<std::pair<std::string, std::string>> files = {
      {"a.xyz", rows(20000, "\n")},
      {"b.pts", "9000\n" + rows(9000, "\r\n")},
      {"c.csv", "x,y,z,i,r,g,b\n" + rows(10, "\n")},
      {"d.txt", rows(3, "\n")},
      {"e.ptx", ptx(5)},
      {"f.ply", "ply\nformat ascii 1.0\n" + ply_header + rows(5000, "\n")},
      {"g.ply", binary}};
  for (auto [name, text] : files) {
    if (name == "c.csv") std::replace(text.begin(), text.end(), ' ', ',');
    CAPTURE(name);
    const auto plain = test::read_points(folder.write(name, text));
    REQUIRE(plain.points.size() > 0);
    for (const std::string end : {".gz", ".zst"}) {
      const auto path = folder.write(name + end, end == ".gz" ? test::gzip_of(text) : test::zstd_of(text));
      const auto packed = test::read_points(path, 1000);
      CHECK(test::same_points(plain.points, packed.points));
      CHECK(packed.info.format.find(plain.info.format + ", unpacked from ") == 0);
      CHECK(packed.info.sensors == plain.info.sensors);
      CHECK(packed.counts.missing == plain.counts.missing);
      CHECK(open_point_file(path, {})->slices(0, 1).size() == 1);
      CHECK(open_point_file(path, {})->slices(0, 1)[0].bytes <= text.size());
    }
  }
  // Folders hold them too; a compressed readme is none.
  folder.write("readme.txt.gz", test::gzip_of("nothing"));
  std::filesystem::create_directory(folder / "sub");
  std::filesystem::rename(folder / "a.xyz.gz", folder / "sub/a.xyz.GZ");
  std::filesystem::rename(folder / "e.ptx.zst", folder / "sub/e.ptx.zst");
  std::filesystem::rename(folder / "readme.txt.gz", folder / "sub/readme.txt.gz");
  CHECK(expand_inputs({(folder / "sub").string()}).size() == 2);
}

TEST_CASE("packed points: cut files, bombs and other content are refused with a sentence and exit code 3",
          "[fault]") {
  const test::TempFolder folder;
  const std::string text = rows(20000, "\n");
  const auto refused = [&](const std::string& name, const std::string& bytes, const std::string& words) {
    // A command begins as a copy of this process, whose size counts as its own peak: what other cases freed must be gone.
    trim_allocator();
    const std::uint64_t limit =
        std::max(std::uint64_t{64} << 20, resident_bytes() + (std::uint64_t{16} << 20));
    const test::CommandResult r = test::tessera_command({"info", folder.write(name, bytes).string()});
    CAPTURE(name, r.errors);
    CHECK(r.code == 3);
    CHECK(r.errors.find(words) != std::string::npos);
    CHECK(r.peak_bytes < limit);
  };
  for (const std::string& packed : {test::gzip_of(text), test::zstd_of(text)}) {
    for (const std::size_t part : {2, 3, 10})
      refused("a.xyz.gz", packed.substr(0, packed.size() - packed.size() / part), "truncated");
  }
  std::vector<std::pair<std::string, std::string>> bombs;
  {
    const std::string zeros(std::size_t{200} << 20,
                            '0');  // gone before a command starts: it would count as its memory
    bombs = {{"b.xyz.gz", test::gzip_of(zeros)},
             {"b.xyz.zst", test::zstd_of(zeros)},
             {"c.xyz.zst", test::zstd_of("1 2 3\n" + zeros)}};
  }
  for (const auto& [name, bytes] : bombs) refused(name, bytes, "not a text file of points");
  refused("b.las.gz", test::gzip_of("LASF" + std::string(400, '\0')), "unpack it first");
  refused("b.ply.gz", test::gzip_of("plyx"), "unpack it first");
  refused("b.xyz.gz", test::gzip_of(""), "unpacks to nothing");
  refused("b.xyz.gz", test::gzip_of("1 2 3\n4 5\n6 7 8\n"), "line 2");
}

}  // namespace
}  // namespace tessera::packed_points_test
