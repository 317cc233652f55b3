// Damaged files, a few thousand per reader, always the same ones: what a fuzz target finds, in every test
// run.
#include <catch2/catch.hpp>

#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "stream/formats/points/e57_points.h"
#include "stream/formats/points/las_points.h"
#include "stream/formats/points/pcd_points.h"
#include "stream/formats/points/ply_points.h"
#include "stream/formats/points/ptx_points.h"
#include "stream/formats/points/text_points.h"
#include "tests/fuzz/point_reader_check.h"
#include "tests/fuzz/point_samples.h"
#include "tests/helpers/e57_writer.h"

namespace tessera::reader_mutation_test {
namespace {

constexpr int kMutations = 6000;

/// One to three kinds of damage, more of it in the second half: a broken header ends the reading early.
std::string damaged(std::string bytes, std::mt19937_64& random) {
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  for (std::size_t n = 1 + below(3); n > 0 && !bytes.empty(); --n) {
    const std::size_t half = random() % 4 == 0 ? 0 : bytes.size() / 2;
    const std::size_t at = half + below(bytes.size() - half);
    const std::size_t length = 1 + below(std::min<std::size_t>(16, bytes.size() - at));
    switch (below(9)) {
      case 0:
        bytes[at] = static_cast<char>(random());
        break;
      case 1:
        bytes[at] = static_cast<char>(bytes[at] ^ 1 << below(8));
        break;
      case 2:
        bytes.erase(at, length);
        break;
      case 3:
        bytes.insert(at, bytes.substr(below(bytes.size()), length));
        break;
      case 4:
        bytes.resize(at);
        break;
      case 5:
        std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), length,
                    random() % 2 == 0 ? '\0' : '\xff');
        break;
      case 6:
        bytes.insert(at, "18446744073709551615");
        break;
      case 7:
        bytes.insert(at, 1, "\n\r \t,;\"#-.e0"[below(12)]);
        break;
      default:
        bytes.insert(at, random() % 2 == 0 ? "nan" : "-1e999");
        break;
    }
  }
  return bytes;
}

std::string as_it_is(std::string bytes) {
  return bytes;
}

/// \param finish  what makes damage get past the outermost check
void check_damaged(fuzz::OpenPoints open, const std::vector<std::string>& files,
                   std::string (*finish)(std::string) = as_it_is) {
  std::mt19937_64 random(20240601);  // the standard fixes its numbers
  for (const std::string& file : files) REQUIRE_NOTHROW(fuzz::check_reader(open, file));
  int read = 0;
  for (int i = 0; i < kMutations; ++i) {
    const std::string bytes = finish(damaged(files[static_cast<std::size_t>(i) % files.size()], random));
    if (bytes.empty()) continue;
    CAPTURE(i, bytes);
    REQUIRE_NOTHROW(read += fuzz::check_reader(open, bytes) ? 1 : 0);
  }
  // Both ways were taken often, else the rest proves nothing.
  CHECK(read > kMutations / 10);
  CHECK(read < kMutations - kMutations / 10);
}

TEST_CASE("mutations: damaged PLY files give points or a sentence", "[fault]") {
  check_damaged(open_ply_points, fuzz::ply_files());
}
TEST_CASE("mutations: damaged LAS files give points or a sentence", "[fault]") {
  check_damaged(open_las_points, fuzz::las_files());
}
TEST_CASE("mutations: damaged E57 files with sound checksums give points or a sentence", "[fault]") {
  check_damaged(open_e57_points, fuzz::e57_files(), test::e57_sealed);
}
TEST_CASE("mutations: damaged PCD files give points or a sentence", "[fault]") {
  check_damaged(open_pcd_points, fuzz::pcd_files());
}
TEST_CASE("mutations: damaged text files give points or a sentence", "[fault]") {
  check_damaged(open_text_points, fuzz::text_files());
}
TEST_CASE("mutations: damaged PTX files give points or a sentence", "[fault]") {
  check_damaged(open_ptx_points, fuzz::ptx_files());
}

}  // namespace
}  // namespace tessera::reader_mutation_test
