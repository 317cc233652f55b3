#include "stream/points/run_file.h"

#include <algorithm>
#include <fstream>
#include <string>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "octree/error.h"

namespace tessera {
namespace {

constexpr std::uint64_t kRunMagic = 0x31304e5552534554ULL;     // "TESRUN01", little endian
constexpr std::uint64_t kExtentMagic = 0x3130545845534554ULL;  // "TESEXT01"
constexpr std::uint64_t kHeaderBytes = 64;

struct RunHeader {
  std::uint64_t magic = kRunMagic;
  std::uint64_t reserved[7] = {};
};
static_assert(sizeof(RunHeader) == kHeaderBytes);

/// Ends a run file and begins an extent file.
struct TableMark {
  std::uint64_t magic = 0;
  std::uint64_t extents = 0;
  std::uint64_t checksum = 0;  ///< XXH3 of the extents
  std::uint64_t reserved = 0;
};

TableMark mark_of(std::uint64_t magic, const std::vector<Extent>& extents) {
  return {magic, extents.size(), XXH3_64bits(extents.data(), extents.size() * sizeof(Extent)), 0};
}

[[noreturn]] void damaged(const std::filesystem::path& path, const std::string& what) {
  throw InputError(path.string() + ": " + what + "; the work directory is damaged, run again with --force");
}

std::vector<Extent> checked_extents(const ReadFile& in, const TableMark& mark, std::uint64_t magic,
                                    std::uint64_t offset, std::uint64_t room) {
  if (mark.magic != magic || mark.extents > room / sizeof(Extent))
    damaged(in.path(), "not a table of this version");
  std::vector<Extent> extents(mark.extents);
  in.read_at(offset, extents.data(), extents.size() * sizeof(Extent));
  if (XXH3_64bits(extents.data(), extents.size() * sizeof(Extent)) != mark.checksum)
    damaged(in.path(), "byte " + std::to_string(offset) + ": damaged table (checksum)");
  return extents;
}

}  // namespace

RunWriter::RunWriter(const std::filesystem::path& path, std::uint32_t file, std::size_t buckets,
                     std::size_t run_points)
    : out_(path), file_(file), run_points_(run_points), first_(buckets) {
  points_.reserve(run_points);  // reserved, not touched: a small task takes little
  grouped_.reserve(run_points);
  buckets_.reserve(run_points);
  const RunHeader header;
  out_.write(&header, sizeof header);
}

void RunWriter::flush() {
  const std::size_t n = points_.size();
  if (n == 0) return;
  std::fill(first_.begin(), first_.end(), 0);
  for (std::size_t i = 0; i < n; ++i) ++first_[buckets_[i]];
  std::uint64_t sum = 0;
  for (std::size_t b = 0; b < first_.size(); ++b) {
    const std::uint64_t count = first_[b];
    if (count > 0)
      extents_.push_back(
          {static_cast<std::uint32_t>(b), file_, out_.offset() + sum * sizeof(PointRecord), count, 0});
    first_[b] = sum;
    sum += count;
  }
  grouped_.resize(n);
  for (std::size_t i = 0; i < n; ++i) grouped_[first_[buckets_[i]]++] = points_[i];
  for (auto e = extents_.rbegin(); e != extents_.rend() && e->offset >= out_.offset(); ++e)
    e->checksum = XXH3_64bits(grouped_.data() + (e->offset - out_.offset()) / sizeof(PointRecord),
                              e->points * sizeof(PointRecord));
  out_.write(grouped_.data(), n * sizeof(PointRecord));
  points_.clear();
  buckets_.clear();
}

std::uint64_t RunWriter::finish() {
  flush();
  const TableMark mark = mark_of(kRunMagic, extents_);
  out_.write(extents_.data(), extents_.size() * sizeof(Extent));
  out_.write(&mark, sizeof mark);
  return out_.finish();
}

std::vector<Extent> read_extents(const std::filesystem::path& run_file) {
  const ReadFile in(run_file);
  TableMark mark;
  if (in.size() < kHeaderBytes + sizeof mark) damaged(run_file, "too short for a run file");
  const std::uint64_t end = in.size() - sizeof mark;
  in.read_at(end, &mark, sizeof mark);
  const std::uint64_t room = end - kHeaderBytes;
  return checked_extents(in, mark, kRunMagic, end - std::min(room, mark.extents * sizeof(Extent)), room);
}

void save_extents(const std::filesystem::path& path, std::vector<Extent> extents) {
  std::sort(extents.begin(), extents.end(), [](const Extent& a, const Extent& b) {
    return std::tie(a.bucket, a.file, a.offset) < std::tie(b.bucket, b.file, b.offset);
  });
  const TableMark mark = mark_of(kExtentMagic, extents);
  DirectFile out(path, std::size_t{1} << 20);
  out.write(&mark, sizeof mark);
  out.write(extents.data(), extents.size() * sizeof(Extent));
  out.finish();
}

std::vector<Extent> load_extents(const std::filesystem::path& path) {
  const ReadFile in(path);
  TableMark mark;
  if (in.size() < sizeof mark) damaged(path, "too short for a table of extents");
  in.read_at(0, &mark, sizeof mark);
  return checked_extents(in, mark, kExtentMagic, sizeof mark, in.size() - sizeof mark);
}

std::vector<Extent> load_extents(const std::filesystem::path& path, std::uint64_t first,
                                 std::uint64_t count) {
  std::vector<Extent> extents(count);
  ReadFile(path).read_at(sizeof(TableMark) + first * sizeof(Extent), extents.data(), count * sizeof(Extent));
  return extents;
}

ExtentCheck::ExtentCheck() : state_(XXH3_createState()) {
  XXH3_64bits_reset(static_cast<XXH3_state_t*>(state_));
}
ExtentCheck::~ExtentCheck() {
  XXH3_freeState(static_cast<XXH3_state_t*>(state_));
}
void ExtentCheck::add(const void* data, std::size_t bytes) {
  XXH3_64bits_update(static_cast<XXH3_state_t*>(state_), data, bytes);
}
void ExtentCheck::verify(const ReadFile& file, const Extent& extent) const {
  if (XXH3_64bits_digest(static_cast<XXH3_state_t*>(state_)) == extent.checksum) return;
  damaged(file.path(), "byte " + std::to_string(extent.offset) + ": damaged points (checksum)");
}

}  // namespace tessera
