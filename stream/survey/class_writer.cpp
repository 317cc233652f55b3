#include "stream/survey/class_writer.h"

#include <vector>

#include "stream/formats/points/las_copy.h"
#include "stream/formats/points/point_writer.h"
#include "stream/survey/copc_copy.h"

namespace tessera {

/// Records that get a class by the ground, those of one tile together.
void ClassWriter::place(const LasRecords& scan, const LasBatch& batch, std::vector<Placed>& out) const {
  out.clear();
  for_each_taken(scan, batch, all_, [&](std::size_t i, const Double3& p) {
    Placed placed;
    placed.index = static_cast<std::uint32_t>(i);
    if (cells_.height(p[2]) != kNoGround)
      placed.tile = ground_.place(cells_.place(p[0], scan.header()), cells_.place(p[1], scan.header())).tile;
    out.push_back(placed);
  });
  gather_by_tile(out);
}

std::uint8_t ClassWriter::class_of(const LasRecords& scan, const char* record) {
  const Double3 p = record_position(scan, record);
  if (cells_.height(p[2]) == kNoGround) return heights_.ground_only ? kClassUnassigned : kClassNoise;
  const GroundTiles::Below below =
      ground_.below(ground_.place(cells_.place(p[0], scan.header()), cells_.place(p[1], scan.header())));
  return class_by_height(p[2] / cells_.step() - below.ground.height, below.ground.tolerance, below.kind,
                         below.roof, below.water, heights_);
}

ClassifiedScan ClassWriter::write(const LasRecords& scan, const std::filesystem::path& to, std::size_t slots,
                                  int threads) {
  if (is_copc_name(to)) {
    CopcCopy copy(scan, to);
    return write_to(copy, scan, to, slots);
  }
  LasCopy copy(scan, to, threads);
  return write_to(copy, scan, to, slots);
}

template <class Copy>
ClassifiedScan ClassWriter::write_to(Copy& copy, const LasRecords& scan, const std::filesystem::path& to,
                                     std::size_t slots) {
  ClassifiedScan result{scan.file().path(), to, scan.points(), 0, 0, {}};
  std::vector<std::vector<Placed>> placed(slots);
  for (std::vector<Placed>& p : placed) p.reserve(scan.batch_records());
  scan.read(
      slots, [&](LasBatch& batch) { place(scan, batch, placed[batch.slot]); },
      [&](LasBatch& batch) {
        for (const Placed& p : placed[batch.slot]) {
          char* record = batch.records.data() + p.index * scan.record_bytes();
          const std::uint8_t value = class_of(scan, record);
          ++result.classes[value];
          set_las_class(record, scan.wide(), value);
        }
        result.kept += batch.count - placed[batch.slot].size();
        copy.append(batch.records.data(), batch.count);
      });
  result.bytes = copy.finish();
  return result;
}

}  // namespace tessera
