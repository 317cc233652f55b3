/// \file copc_file.h
/// COPC files for tests: an octree of three levels over random points, its hierarchy in two pages, and what is there to be
/// broken. Chunks are made by the product's encoder.
#pragma once
#include <array>
#include <random>
#include <string>
#include <vector>

#include "tests/helpers/laz_file.h"

namespace tessera::test {

struct CopcTestNode {
  std::array<std::int32_t, 4> key{};  ///< level, x, y, z
  std::string records;
};

struct CopcFile {
  std::string bytes;
  std::string twin;            ///< uncompressed
  std::size_t info = 0;        ///< of the "copc" record, without its head
  std::size_t root = 0;        ///< first entry of the root page
  std::size_t root_bytes = 0;  ///< of it
  std::size_t second = 0;      ///< the other page
  std::size_t points = 0;
  std::array<std::size_t, 3> of_level{};  ///< points
};

/// Cube of edge 200 around (500000, 500000, 500000) in steps of 0.01, spacing 8. Levels 0 to 2, 40 points a node; the node
/// 1-0-0-0 and what is below it stand in a page of their own.
inline CopcFile copc_file(bool stray = false, int format = 7) {
  constexpr std::size_t kNodePoints = 40;
  LazSample s{.minor = 4, .format = format, .points = 0, .chunk_points = laz::Schema::kVariable};
  const laz::Schema schema = schema_of(s);
  const std::size_t stride = schema.record_bytes();
  std::mt19937 random(5);
  std::vector<CopcTestNode> nodes;
  for (std::int32_t level = 0; level < 3; ++level)
    for (std::int32_t k = 0; k < 1 << (3 * level); ++k) {
      const std::int32_t mask = (1 << level) - 1;
      CopcTestNode node{{level, k & mask, k >> level & mask, k >> (2 * level) & mask}, {}};
      const std::int32_t edge = 20000 >> level;
      LazSample some = s;
      some.points = kNodePoints;
      some.seed = static_cast<unsigned>(level * 100 + k + 1);
      node.records = las_records(some);
      for (std::size_t i = 0; i < kNodePoints; ++i) {
        node.records[i * stride + 15] = 0;  // none is withheld
        for (std::size_t a = 0; a < 3; ++a) {
          const auto within = static_cast<std::int32_t>(random() % static_cast<unsigned>(edge));
          set_bytes(node.records, i * stride + 4 * a, node.key[a + 1] * edge - 10000 + within);
        }
      }
      nodes.push_back(node);
    }
  if (stray) set_bytes(nodes[70].records, 0, std::int32_t{-9999}), set_bytes(nodes[70].records, 4, 9999);

  CopcFile out;
  std::string all;
  for (const CopcTestNode& n : nodes) {
    all += n.records;
    out.of_level[static_cast<std::size_t>(n.key[0])] += kNodePoints;
  }
  s.points = out.points = nodes.size() * kNodePoints;
  out.twin = las_twin(s, all);
  std::string& f = out.bytes;
  f = las_header(s, stride);
  f[104] = static_cast<char>(f[104] | 0x80);
  set_bytes(f, 100, std::uint32_t{2});
  const auto record = [&f](std::string_view user, std::uint16_t id, const std::string& data) {
    std::string head(54, '\0');
    head.replace(2, user.size(), user);
    set_bytes(head, 18, id), set_bytes(head, 20, static_cast<std::uint16_t>(data.size()));
    f += head + data;
  };
  std::string info(160, '\0');
  for (std::size_t a = 0; a < 3; ++a) set_bytes(info, 8 * a, 5e5);
  set_bytes(info, 24, 100.0), set_bytes(info, 32, 8.0);
  record("copc", 1, info);
  out.info = f.size() - info.size();
  const std::vector<char> laszip = laz::schema_record(schema);
  record(laz::Schema::kUserId, laz::Schema::kRecordId, std::string(laszip.begin(), laszip.end()));
  set_bytes(f, 96, static_cast<std::uint32_t>(f.size()));
  const std::size_t begin = f.size();
  f += std::string(8, '\0');
  std::vector<laz::ChunkSize> sizes;
  std::array<std::string, 2> pages;
  for (const CopcTestNode& n : nodes) {
    const std::vector<char> chunk = laz::encode_chunk(schema, n.records);
    std::string entry(32, '\0');
    std::memcpy(entry.data(), n.key.data(), 16);
    set_bytes(entry, 16, static_cast<std::uint64_t>(f.size()));
    set_bytes(entry, 24, static_cast<std::int32_t>(chunk.size()));
    set_bytes(entry, 28, static_cast<std::int32_t>(kNodePoints));
    const int shift = n.key[0] - 1;
    const bool apart = shift >= 0 && (n.key[1] >> shift) + (n.key[2] >> shift) + (n.key[3] >> shift) == 0;
    pages[apart ? 1 : 0] += entry;
    f.append(chunk.begin(), chunk.end());
    sizes.push_back({static_cast<std::uint32_t>(kNodePoints), static_cast<std::uint32_t>(chunk.size())});
  }
  set_bytes(f, begin, static_cast<std::uint64_t>(f.size()));
  const std::vector<char> table = laz::chunk_table(sizes, true);
  f.append(table.begin(), table.end());

  set_bytes(f, 235, static_cast<std::uint64_t>(f.size())), set_bytes(f, 243, std::uint32_t{1});
  std::string link(32, '\0');
  set_bytes(link, 0, std::int32_t{1}), set_bytes(link, 28, std::int32_t{-1});
  std::string head(60, '\0');
  head.replace(2, 4, "copc");
  set_bytes(head, 18, std::uint16_t{1000});
  out.root = f.size() + head.size();
  out.root_bytes = pages[0].size() + link.size();
  out.second = out.root + out.root_bytes;
  set_bytes(link, 16, static_cast<std::uint64_t>(out.second));
  set_bytes(link, 24, static_cast<std::int32_t>(pages[1].size()));
  set_bytes(head, 20, static_cast<std::uint64_t>(out.root_bytes + pages[1].size()));
  f += head + pages[0] + link + pages[1];
  set_bytes(f, out.info + 40, static_cast<std::uint64_t>(out.root));
  set_bytes(f, out.info + 48, static_cast<std::uint64_t>(out.root_bytes));
  return out;
}

}  // namespace tessera::test
