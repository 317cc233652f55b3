#include "stream/formats/points/las_records.h"

#include <algorithm>
#include <string>

#include "octree/error.h"
#include "stream/formats/points/laz_records.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {

namespace {

constexpr std::size_t kRecordBatchBytes = std::size_t{1} << 20;
/// Larger chunks are read in pieces, one after the other.
constexpr std::uint64_t kMaxChunkBytes = std::uint64_t{4} << 20;
/// Models of a chunk, and a window for every layer.
constexpr std::uint64_t kDecoderBytes = std::uint64_t{5} << 20;

ReadFile open_las(const std::filesystem::path& path) {
  ReadFile file(path);
  char magic[4] = {};
  if (file.size() >= sizeof magic) file.read_at(0, magic, sizeof magic);
  if (std::string(magic, sizeof magic) != "LASF")
    throw InputError(path.string() + ": is neither LAS nor LAZ, and only their points have classes");
  return file;
}

constexpr unsigned kNarrowClassBits = 31;  ///< of formats 0 to 5; flags lie above

}  // namespace

std::uint8_t las_class(const char* record, bool wide) {
  if (wide) return static_cast<std::uint8_t>(record[LasRecordField::kWideClass]);
  return static_cast<std::uint8_t>(static_cast<std::uint8_t>(record[LasRecordField::kFlags]) &
                                   kNarrowClassBits);
}

void set_las_class(char* record, bool wide, std::uint8_t value) {
  if (wide) {
    record[LasRecordField::kWideClass] = static_cast<char>(value);
    return;
  }
  const unsigned flags = static_cast<std::uint8_t>(record[LasRecordField::kFlags]) & ~kNarrowClassBits;
  record[LasRecordField::kFlags] = static_cast<char>(flags | value);
}

LasRecords::LasRecords(const std::filesystem::path& path) : LasRecords(open_las(path), path) {}

LasRecords::LasRecords(const ReadFile& file, const std::filesystem::path& path)
    : input_(file), header_(file) {
  header_.check_bounds(points() > 0);
  const auto require_all = [&](std::uint64_t there) {
    if (there != points())
      throw InputError(path.string() + ": the header declares " + std::to_string(points()) +
                       " points, the file holds " + std::to_string(there) +
                       "; write it anew first: tessera convert IN -o OUT.las");
  };
  if (header_.compressed) {
    plan_chunks(file);
    require_all(chunks_.points());
    return;
  }
  batch_records_ = std::max<std::size_t>(1, kRecordBatchBytes / record_bytes());
  const std::uint64_t room = (header_.end - header_.begin) / record_bytes();
  if (room < points() || points() == 0) require_all(room);
}

void LasRecords::plan_chunks(const ReadFile& file) {
  schema_ = find_laz_schema(file, header_);
  chunks_ = find_laz_chunks(file, header_, *schema_);
  const std::uint64_t most = kMaxChunkBytes / record_bytes();
  in_order_ = chunks_.in_order || chunks_.cut_off;
  std::uint64_t target = kRecordBatchBytes / record_bytes();
  for (std::size_t i = 0; i < chunks_.size(); ++i) {
    target = std::max(target, chunks_.points_of(i));
    in_order_ = in_order_ || chunks_.points_of(i) > most;
  }
  batch_records_ = in_order_ ? std::max<std::size_t>(1, kRecordBatchBytes / record_bytes())
                             : static_cast<std::size_t>(target);
  if (in_order_) return;
  std::uint64_t held = 0;
  for (std::size_t i = 0; i < chunks_.size(); ++i) {
    if (i == 0 || held + chunks_.points_of(i) > target) runs_.push_back(i), held = 0;
    held += chunks_.points_of(i);
  }
  runs_.push_back(chunks_.size());
}

std::uint64_t LasRecords::read_bytes(std::size_t slots, int threads) const {
  const std::uint64_t batch = batch_records_ * record_bytes();
  const std::uint64_t chunks = (chunks_.edges.size() + runs_.size()) * 16;
  if (in_order_) return batch + kDecoderBytes + chunks;
  return slots * batch + (header_.compressed ? static_cast<std::uint64_t>(threads) * kDecoderBytes : 0) +
         chunks;
}

std::size_t LasRecords::batches() const {
  if (header_.compressed) return runs_.empty() ? 0 : runs_.size() - 1;
  return static_cast<std::size_t>((points() + batch_records_ - 1) / batch_records_);
}

void LasRecords::load(const ReadFile& file, std::size_t index, LasBatch& batch) const {
  if (!header_.compressed) {
    const std::uint64_t first = index * batch_records_;
    batch.count = static_cast<std::size_t>(std::min<std::uint64_t>(batch_records_, points() - first));
    file.read_at(header_.begin + first * record_bytes(), batch.records.data(), batch.count * record_bytes());
    return;
  }
  const std::size_t end = runs_[index + 1];
  const std::uint64_t count = chunks_.edges[end].first_point - chunks_.edges[runs_[index]].first_point;
  LazRecords stream(file, *schema_, chunks_, laz::Layers::kAll, false);
  stream.seek(runs_[index]);
  batch.count = 0;
  while (batch.count < count)
    batch.count += stream.read(batch.records.data() + batch.count * record_bytes(),
                               static_cast<std::size_t>(count) - batch.count);
}

void LasRecords::read_in_order(const ReadFile& file, const std::function<void(LasBatch&)>& make,
                               const std::function<void(LasBatch&)>& use) const {
  LasBatch batch;
  batch.records.resize(batch_records_ * record_bytes());
  LazRecords stream(file, *schema_, chunks_, laz::Layers::kAll, false);
  stream.seek(0);
  for (std::uint64_t left = points(); left > 0; left -= batch.count) {
    throw_if_stopped();
    batch.count = 0;
    const auto wanted = static_cast<std::size_t>(std::min<std::uint64_t>(left, batch_records_));
    while (batch.count < wanted) {
      const std::size_t n =
          stream.read(batch.records.data() + batch.count * record_bytes(), wanted - batch.count);
      if (n == 0)
        throw InputError(file.path().string() + ": the file ends " + std::to_string(left - batch.count) +
                         " points before its header says; get the file anew");
      batch.count += n;
    }
    make(batch);
    use(batch);
  }
}

void LasRecords::read(std::size_t slots, const std::function<void(LasBatch&)>& make,
                      const std::function<void(LasBatch&)>& use) const {
  if (points() == 0) return;
  const ReadFile file = input_.open();
  if (in_order_) {
    read_in_order(file, make, use);
  } else {
    std::vector<LasBatch> ring(std::min(slots, batches()));
    for (std::size_t i = 0; i < ring.size(); ++i) {
      ring[i].slot = i;
      ring[i].records.resize(batch_records_ * record_bytes());
    }
    parallel_in_order(
        batches(), ring.size(),
        [&](std::size_t i) {
          load(file, i, ring[i % ring.size()]);
          make(ring[i % ring.size()]);
        },
        [&](std::size_t i) { use(ring[i % ring.size()]); });
  }
  file.require_unchanged();
}

}  // namespace tessera
