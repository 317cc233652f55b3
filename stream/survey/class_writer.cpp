#include "stream/survey/class_writer.h"

#include <algorithm>
#include <vector>

#include "stream/formats/points/las_copy.h"

namespace tessera {

namespace {

constexpr std::size_t kClassByte = 15, kClassByteWide = 16;
constexpr unsigned kClassBits = 31;  ///< of formats 0 to 5; flags lie above
/// With more runs than this in a batch its points are sorted by tile.
constexpr std::size_t kMaxTileRuns = 8;

void set_class(char* record, bool wide, std::uint8_t value) {
  if (wide) {
    record[kClassByteWide] = static_cast<char>(value);
    return;
  }
  const unsigned flags = static_cast<std::uint8_t>(record[kClassByte]) & ~kClassBits;
  record[kClassByte] = static_cast<char>(flags | value);
}

}  // namespace

/// Records that get a class by the ground, those of one tile together.
void ClassWriter::place(const LasRecords& scan, const LasBatch& batch, std::vector<Placed>& out) const {
  out.clear();
  std::size_t runs = 0;
  for (std::size_t i = 0; i < batch.count; ++i) {
    const char* record = batch.records.data() + i * scan.record_bytes();
    if (!all_ && is_set_aside(record, scan.wide())) continue;
    const Double3 p = record_position(scan, record);
    Placed placed;
    placed.index = static_cast<std::uint32_t>(i);
    if (cells_.height(p[2]) != kNoGround)
      placed.tile = ground_.place(cells_.place(p[0], scan.header()), cells_.place(p[1], scan.header())).tile;
    if (out.empty() || !(out.back().tile == placed.tile)) ++runs;
    out.push_back(placed);
  }
  if (runs <= kMaxTileRuns) return;
  std::sort(out.begin(), out.end(), [](const Placed& a, const Placed& b) {
    return a.tile == b.tile ? a.index < b.index : a.tile < b.tile;
  });
}

std::uint8_t ClassWriter::class_of(const LasRecords& scan, const char* record) {
  const Double3 p = record_position(scan, record);
  if (cells_.height(p[2]) == kNoGround) return heights_.ground_only ? kClassUnassigned : kClassNoise;
  const GroundTiles::Below below =
      ground_.below(ground_.place(cells_.place(p[0], scan.header()), cells_.place(p[1], scan.header())));
  return class_by_height(p[2] / cells_.step() - below.ground.height, below.ground.tolerance, below.kind,
                         below.roof, heights_);
}

ClassifiedScan ClassWriter::write(const LasRecords& scan, const std::filesystem::path& to, std::size_t slots,
                                  int threads) {
  ClassifiedScan result{scan.file().path(), to, scan.points(), 0, 0, {}};
  LasCopy copy(scan, to, threads);
  std::vector<std::vector<Placed>> placed(slots);
  for (std::vector<Placed>& p : placed) p.reserve(scan.batch_records());
  scan.read(
      slots, [&](LasBatch& batch) { place(scan, batch, placed[batch.slot]); },
      [&](LasBatch& batch) {
        for (const Placed& p : placed[batch.slot]) {
          char* record = batch.records.data() + p.index * scan.record_bytes();
          const std::uint8_t value = class_of(scan, record);
          ++result.classes[value];
          set_class(record, scan.wide(), value);
        }
        result.kept += batch.count - placed[batch.slot].size();
        copy.append(batch.records.data(), batch.count);
      });
  result.bytes = copy.finish();
  return result;
}

}  // namespace tessera
