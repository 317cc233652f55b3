#include "stream/files/written_hash.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>

#include <catch2/catch.hpp>

#include "stream/files/direct_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/output_file.h"
#include "tests/helpers/temp_folder.h"

namespace written_hash_test {

using namespace tessera;
using namespace tessera::test;

namespace {

std::string hash_bytes_made(std::size_t bytes) {
  std::string text(bytes, '\0');
  for (std::size_t i = 0; i < bytes; ++i) text[i] = static_cast<char>(i * 7 + i / 251);
  return text;
}

}  // namespace

TEST_CASE("written hash: that of a file past the page cache, whatever its size and pieces", "[unit]") {
  const TempFolder folder;
  constexpr std::size_t kBuffer = 8192;
  for (const std::size_t bytes : {0u, 1u, 8191u, 8192u, 8193u, 100000u}) {
    const auto path = folder.path() / ("direct" + std::to_string(bytes));
    const std::string text = hash_bytes_made(bytes);
    DirectFile file(path, kBuffer);
    for (std::size_t at = 0; at < bytes; at += 777)
      file.write(text.data() + at, std::min<std::size_t>(777, bytes - at));
    file.finish();
    CHECK(hash_written_file(path) == hash_text(text));
    CHECK(hash_file(path) == hash_text(text));
  }
}

TEST_CASE("written hash: that of an output under its final name, patched or not", "[unit]") {
  const TempFolder folder;
  for (const bool patched : {false, true}) {
    const auto path = folder.path() / (patched ? "patched" : "whole");
    OutputFile file(path);
    file.append(hash_bytes_made(50000));
    if (patched) file.patch(100, "other bytes", 11);
    file.append(hash_bytes_made(70));
    file.finish();
    CHECK(hash_written_file(path) == hash_file(path));
    CHECK(hash_written_file(path) == hash_file(path));
  }
}

TEST_CASE("written hash: what passes the buffer counts where it stands", "[unit]") {
  const TempFolder folder;
  const auto path = folder.path() / "mesh";
  const std::string parts[] = {hash_bytes_made(30000), hash_bytes_made(9), hash_bytes_made(20000)};
  OutputFile file(path);
  file.append("header");
  for (const std::string& part : parts) file.append_direct(part.data(), part.size());
  for (const std::string& part : parts) file.digest(part.data(), part.size());
  file.append("footer");
  file.finish();
  const std::string text = "header" + parts[0] + parts[1] + parts[2] + "footer";
  CHECK(hash_written_file(path) == hash_text(text));
  CHECK(hash_file(path) == hash_text(text));
}

TEST_CASE("written hash: a file that was written to since is read again", "[unit]") {
  const TempFolder folder;
  const auto path = folder.path() / "file";
  DirectFile file(path);
  file.write("0123456789", 10);
  file.finish();
  const std::uint64_t before = hash_written_file(path);
  SECTION("longer") {
    std::ofstream(path, std::ios::app) << "more";
  }
  SECTION("as long, another time") {
    std::ofstream(path) << "9876543210";
    std::filesystem::last_write_time(path, std::filesystem::last_write_time(path) + std::chrono::seconds(5));
  }
  SECTION("another file of that name") {
    std::ofstream(folder.path() / "new") << "9876543210";
    std::filesystem::rename(folder.path() / "new", path);
  }
  CHECK(hash_written_file(path) != before);
  CHECK(hash_written_file(path) == hash_file(path));
}

}  // namespace written_hash_test
