#include "stream/formats/copc/copc_body.h"

#include <cstring>
#include <vector>

#include "stream/formats/laz/chunk_encoder.h"
#include "stream/formats/laz/chunk_table.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::size_t kExtendedHead = 60;

template <class T>
void put_copc(char* at, T value) {
  std::memcpy(at, &value, sizeof value);
}

}  // namespace

CopcBody append_copc_body(OutputFile& file, const laz::Schema& schema, const CopcNodes& all,
                          std::uint64_t begin, const std::array<double, 2>& times) {
  std::vector<CopcChunkAt> chunks;
  std::vector<laz::ChunkSize> table;
  const std::vector<CopcNode>& nodes = all.nodes();
  for (std::size_t first = 0; first < nodes.size();) {
    std::size_t end = first, bytes = 0;
    for (; end < nodes.size() && (end == first || bytes < kCopcGroupBytes); ++end)
      bytes += static_cast<std::size_t>(nodes[end].points) * schema.record_bytes();
    std::vector<std::vector<char>> coded(end - first);
    parallel_for(coded.size(), [&](std::size_t i) {
      throw_if_stopped();
      coded[i] = laz::encode_chunk(schema, all.records(nodes[first + i]));
    });
    for (std::size_t i = 0; i < coded.size(); ++i) {
      const auto size = static_cast<std::uint32_t>(coded[i].size());
      chunks.push_back({file.size(), static_cast<std::int32_t>(size)});
      table.push_back({static_cast<std::uint32_t>(nodes[first + i].points), size});
      file.append(coded[i].data(), coded[i].size());
    }
    first = end;
  }
  const std::uint64_t table_at = file.size();
  const std::vector<char> coded_table = laz::chunk_table(table, true);
  file.append(coded_table.data(), coded_table.size());
  file.patch(begin, &table_at, sizeof table_at);

  CopcBody body;
  body.hierarchy_at = file.size();
  const CopcPages pages = copc_pages(nodes, chunks, body.hierarchy_at + kExtendedHead);
  std::array<char, kExtendedHead> head{};
  std::memcpy(&head[2], "copc", 4);
  put_copc(&head[18], std::uint16_t{1000});
  put_copc(&head[20], static_cast<std::uint64_t>(pages.bytes.size()));
  file.append(head.data(), head.size());
  file.append(pages.bytes);
  const CopcCube& cube = all.cube();
  for (std::size_t a = 0; a < 3; ++a) put_copc(&body.info[8 * a], cube.min[a] + cube.edge / 2);
  put_copc(&body.info[24], cube.edge / 2);
  put_copc(&body.info[32], cube.edge / (1 << CopcNodes::kCellLevels));
  put_copc(&body.info[40], body.hierarchy_at + kExtendedHead);
  put_copc(&body.info[48], pages.root_bytes);
  put_copc(&body.info[56], times[0]), put_copc(&body.info[64], times[1]);
  return body;
}

}  // namespace tessera
