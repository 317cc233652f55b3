/// \file point_reading.h
/// Reads a point file whole or slice by slice, and compares the two.
#pragma once
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "octree/error.h"
#include "stream/formats/points/point_source.h"

namespace tessera::test {

struct ReadResult {
  PointFileInfo info;
  PointChunk points;
  ReadCounts counts;
};

inline void append(PointChunk& to, const PointChunk& from) {
  const auto add = [](auto& a, const auto& b) { a.insert(a.end(), b.begin(), b.end()); };
  add(to.x, from.x), add(to.y, from.y), add(to.z, from.z);
  add(to.nx, from.nx), add(to.ny, from.ny), add(to.nz, from.nz);
  add(to.rgba, from.rgba), add(to.sensor, from.sensor), add(to.echo, from.echo);
  add(to.intensity, from.intensity);
}

inline ReadResult read_points(const std::filesystem::path& path,
                              std::uint64_t slice_bytes = ~std::uint64_t{0},
                              const ReadOptions& options = {}) {
  const auto file = open_point_file(path, options);
  ReadResult result;
  result.info = file->info();
  for (const InputSlice& slice : file->slices(0, slice_bytes)) {
    std::uint64_t handed = 0;
    const ReadCounts counts = file->read(slice, [&](const PointChunk& chunk) {
      REQUIRE(chunk.size() > 0);
      REQUIRE(chunk.size() <= options.chunk_points);
      REQUIRE(chunk.y.size() == chunk.size());
      REQUIRE(chunk.z.size() == chunk.size());
      for (const std::size_t n : {chunk.nx.size(), chunk.ny.size(), chunk.nz.size()}) {
        REQUIRE(n == (result.info.attributes.normals ? chunk.size() : 0));
      }
      REQUIRE(chunk.rgba.size() == (result.info.attributes.colour ? chunk.size() : 0));
      REQUIRE(chunk.sensor.size() == (result.info.attributes.sensor ? chunk.size() : 0));
      REQUIRE(chunk.echo.size() == (result.info.attributes.echo ? chunk.size() : 0));
      append(result.points, chunk);
      handed += chunk.size();
    });
    REQUIRE(counts.points == handed);
    result.counts.points += counts.points;
    result.counts.withheld += counts.withheld;
    result.counts.empty += counts.empty;
    result.counts.missing += counts.missing;
    result.counts.surplus += counts.surplus;
    for (const auto& w : counts.warnings) result.counts.warnings.push_back(w);
  }
  return result;
}

/// Bit for bit, so that NaN equals itself.
template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}
inline bool same_points(const PointChunk& a, const PointChunk& b) {
  return same_bits(a.x, b.x) && same_bits(a.y, b.y) && same_bits(a.z, b.z) && same_bits(a.nx, b.nx) &&
         same_bits(a.ny, b.ny) && same_bits(a.nz, b.nz) && same_bits(a.rgba, b.rgba) &&
         same_bits(a.sensor, b.sensor) && a.echo == b.echo;
}

/// All slice sizes give the points of one read, in the same order, whatever the chunk size.
inline void require_slices_agree(const std::filesystem::path& path, const ReadOptions& options = {},
                                 const std::vector<std::uint64_t>& sizes = {1, 7, 64, 100, 1000}) {
  const ReadResult whole = read_points(path, ~std::uint64_t{0}, options);
  for (const std::uint64_t bytes : sizes) {
    ReadOptions other = options;
    other.chunk_points = bytes;
    const ReadResult parts = read_points(path, bytes, other);
    CAPTURE(path, bytes);
    REQUIRE(same_points(whole.points, parts.points));
    REQUIRE(parts.counts.withheld == whole.counts.withheld);
    REQUIRE(parts.counts.empty == whole.counts.empty);
    REQUIRE(parts.counts.missing == whole.counts.missing);
    REQUIRE(parts.counts.surplus == whole.counts.surplus);
    REQUIRE(parts.counts.warnings == whole.counts.warnings);
  }
}

/// Message of the InputError that reading the file ends with; "" if it reads.
inline std::string reading_error(const std::filesystem::path& path, const ReadOptions& options = {}) {
  try {
    read_points(path, ~std::uint64_t{0}, options);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

/// Bytes of values, little endian or reversed.
template <class T>
void put(std::string& to, T value, bool big_endian = false) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  if (big_endian) {
    for (std::size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(bytes[i], bytes[sizeof(T) - 1 - i]);
  }
  to.append(bytes, sizeof(T));
}

}  // namespace tessera::test
