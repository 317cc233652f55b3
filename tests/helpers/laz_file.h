/// \file laz_file.h
/// A LAZ file and its uncompressed twin, of any point format, item version and chunk size, in memory. The compressed
/// one is made by the product's encoder; real files of other programs are what tells that it follows the format.
#pragma once
#include <algorithm>
#include <array>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "stream/formats/laz/chunk_encoder.h"
#include "stream/formats/laz/chunk_table.h"
#include "stream/formats/laz/schema.h"

namespace tessera::test {

struct LazSample {
  int minor = 2;
  int format = 3;
  std::size_t extra = 0;
  std::size_t points = 300;
  /// laz::Schema::kVariable: chunks of 1, 2, 3, ... points
  std::uint32_t chunk_points = 50;
  std::uint16_t version = 0;  ///< of all items that know it; 0 = the usual one
  bool wild = false;          ///< random records instead of a scan's
  bool chunked = true;        ///< point by point: false = one run, as the first files had
  unsigned seed = 1;
};

/// What is there to be broken: where things lie in the compressed file.
struct LazBytes {
  std::string bytes;
  std::size_t record = 0;  ///< "laszip encoded", without its head
  std::size_t points = 0;  ///< the offset of the table, then the chunks
  std::size_t table = 0;
};

template <class T>
void set_bytes(std::string& bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

/// Of all chunks but perhaps the last.
inline std::size_t chunk_length(const LazSample& s, std::size_t chunk) {
  if (!s.chunked) return s.points;
  return s.chunk_points == laz::Schema::kVariable ? chunk + 1 : s.chunk_points;
}

inline laz::Schema schema_of(const LazSample& s) {
  laz::Schema schema = laz::schema_for(s.format, s.extra, s.chunk_points);
  for (laz::Item& item : schema.items)
    if (s.version > 0 && item.type != laz::ItemType::kWavePacket13) item.version = s.version;
  if (!s.chunked) schema.compressor = laz::Compressor::kPointwise;
  return schema;
}

/// Records of a scan: small steps, returns that go together, times in two sequences, four scanner channels in turn; or
/// of nothing but chance. All leave the withheld flag alone but for a few.
inline std::string las_records(const LazSample& s) {
  const std::size_t bytes = schema_of(s).record_bytes();
  std::mt19937 random(s.seed);
  const auto below = [&](unsigned n) { return static_cast<unsigned>(random() % n); };
  std::string all;
  std::array<std::int32_t, 3> at = {1000, -2000, 300};
  std::array<double, 2> time = {1e5, 3.5e8};
  std::string r(bytes, '\0');
  for (std::size_t i = 0; i < s.points; ++i) {
    if (s.wild || i == 0) {
      for (char& c : r) c = static_cast<char>(random());
    } else {
      for (std::size_t b = 12; b < bytes; ++b)
        if (below(8) == 0) r[b] = static_cast<char>(r[b] + static_cast<int>(below(5)) - 2);
      const unsigned of = 1 + below(3);
      const unsigned number = 1 + below(of);
      r[14] = static_cast<char>(s.format >= 6 ? number | of << 4 : number | of << 3);
      if (s.format >= 6) r[15] = static_cast<char>((r[15] & 0xcb) | static_cast<int>(i / 5 % 4) << 4);
      if (below(2) == 0) time[i / 7 % 2] += below(4) == 0 ? 1e-3 * below(1000) : 1e-5;
      const std::size_t gps = s.format >= 6 ? 22 : 20;
      if (bytes >= gps + 8) set_bytes(r, gps, time[i / 7 % 2]);
      if (s.format == 7 && below(3) == 0) std::memcpy(r.data() + 32, r.data() + 30, 2);
    }
    for (std::size_t a = 0; a < 3; ++a) {
      at[a] += static_cast<std::int32_t>(below(40)) - 19 + (below(50) == 0 ? 100000 : 0);
      if (!s.wild) set_bytes(r, 4 * a, at[a]);
    }
    all += r;
  }
  return all;
}

inline std::string las_header(const LazSample& s, std::size_t record_bytes) {
  const std::size_t head = s.minor >= 4 ? 375 : s.minor == 3 ? 235 : 227;
  std::string f(head, '\0');
  f.replace(0, 4, "LASF");
  f[24] = 1, f[25] = static_cast<char>(s.minor), f[104] = static_cast<char>(s.format);
  set_bytes(f, 94, static_cast<std::uint16_t>(head)), set_bytes(f, 96, static_cast<std::uint32_t>(head));
  set_bytes(f, 105, static_cast<std::uint16_t>(record_bytes));
  set_bytes(f, 107, static_cast<std::uint32_t>(s.points));
  for (std::size_t a = 0; a < 3; ++a) {
    set_bytes(f, 131 + 8 * a, 0.01), set_bytes(f, 155 + 8 * a, 5e5);
    set_bytes(f, 179 + 16 * a, 1e9), set_bytes(f, 187 + 16 * a, -1e9);
  }
  if (s.minor >= 4) set_bytes(f, 247, static_cast<std::uint64_t>(s.points));
  return f;
}

inline std::string las_twin(const LazSample& s, const std::string& records) {
  return las_header(s, schema_of(s).record_bytes()) + records;
}

inline LazBytes laz_file(const LazSample& s, const std::string& records) {
  const laz::Schema schema = schema_of(s);
  const std::vector<char> record = laz::schema_record(schema);
  LazBytes out;
  std::string& f = out.bytes;
  f = las_header(s, schema.record_bytes());
  f[104] = static_cast<char>(f[104] | 0x80);
  set_bytes(f, 100, std::uint32_t{1});
  std::string head(54, '\0');
  head.replace(2, laz::Schema::kUserId.size(), laz::Schema::kUserId);
  set_bytes(head, 18, laz::Schema::kRecordId), set_bytes(head, 20, static_cast<std::uint16_t>(record.size()));
  f += head;
  out.record = f.size();
  f.append(record.begin(), record.end());
  set_bytes(f, 96, static_cast<std::uint32_t>(f.size()));
  out.points = f.size();
  if (s.chunked) f += std::string(8, '\0');
  std::vector<laz::ChunkSize> sizes;
  const std::size_t bytes = schema.record_bytes();
  for (std::size_t done = 0; done < s.points;) {
    const std::size_t n = std::min(chunk_length(s, sizes.size()), s.points - done);
    const std::vector<char> chunk =
        laz::encode_chunk(schema, std::string_view(records).substr(done * bytes, n * bytes));
    f.append(chunk.begin(), chunk.end());
    sizes.push_back({static_cast<std::uint32_t>(n), static_cast<std::uint32_t>(chunk.size())});
    done += n;
  }
  out.table = f.size();
  if (!s.chunked) return out;
  const std::vector<char> table = laz::chunk_table(sizes, s.chunk_points == laz::Schema::kVariable);
  f.append(table.begin(), table.end());
  set_bytes(f, out.points, static_cast<std::uint64_t>(out.table));
  return out;
}

}  // namespace tessera::test
