#include "stream/files/bucket_file.h"

#include <algorithm>
#include <cstring>
#include <string>

namespace tessera {
namespace {

constexpr PackedKind kKind = {"TSBUCKT2", "a bucket file"};
constexpr std::uint64_t kMinChunk = 1024;
constexpr std::uint64_t kMaxChunk = 1u << 18;

struct Info {
  std::uint64_t buckets = 0;
  std::uint64_t record_bytes = 0;
};

}  // namespace

BucketFileWriter::BucketFileWriter(const std::filesystem::path& path, std::size_t record_bytes,
                                   std::size_t buckets, std::uint64_t memory_bytes)
    : file_(path, kKind), record_bytes_(record_bytes), open_(buckets) {
  const std::uint64_t share =
      std::clamp(memory_bytes / std::max<std::uint64_t>(1, buckets), kMinChunk, kMaxChunk);
  chunk_bytes_ = share / record_bytes * record_bytes;
}

void BucketFileWriter::flush(std::size_t bucket) {
  Open& open = open_[bucket];
  if (open.filled == 0) return;
  chunks_.push_back({bucket, file_.append(bytes_of(open.data).first(open.filled))});
  open.filled = 0;
}

void BucketFileWriter::add_run(std::size_t bucket, const void* records, std::size_t count) {
  const auto* from = static_cast<const char*>(records);
  Open& open = open_[bucket];
  while (count > 0) {
    if (open.filled + record_bytes_ > chunk_bytes_) flush(bucket);
    if (open.data.empty()) open.data.resize(chunk_bytes_);
    const std::size_t fit = std::min(count, (chunk_bytes_ - open.filled) / record_bytes_);
    std::copy_n(from, fit * record_bytes_, open.data.data() + open.filled);
    open.filled += fit * record_bytes_;
    from += fit * record_bytes_;
    count -= fit;
  }
}

std::uint64_t BucketFileWriter::finish() {
  for (std::size_t b = 0; b < open_.size(); ++b) {
    flush(b);
    std::vector<char>().swap(open_[b].data);
  }
  std::stable_sort(chunks_.begin(), chunks_.end(),
                   [](const Chunk& a, const Chunk& b) { return a.bucket < b.bucket; });
  const Info info = {open_.size(), record_bytes_};
  return file_.finish(chunks_, std::as_bytes(std::span(&info, 1)));
}

BucketFile::BucketFile(const std::filesystem::path& path, std::size_t record_bytes)
    : file_(path, kKind, sizeof(BucketFileWriter::Chunk), sizeof(Info)), record_bytes_(record_bytes) {
  Info info;
  std::memcpy(&info, file_.info().data(), sizeof info);
  if (info.record_bytes != record_bytes)
    file_.damaged(0, "records of " + std::to_string(info.record_bytes) + " bytes, not of " +
                         std::to_string(record_bytes));
  chunks_ = file_.table<BucketFileWriter::Chunk>();
  first_.assign(info.buckets + 1, 0);
  for (const auto& chunk : chunks_) ++first_.at(chunk.bucket + 1);
  for (std::size_t b = 0; b < info.buckets; ++b) first_[b + 1] += first_[b];
}

std::uint64_t BucketFile::records(std::size_t bucket) const {
  std::uint64_t bytes = 0;
  for (std::size_t c = first_[bucket]; c < first_[bucket + 1]; ++c) bytes += chunks_[c].records.bytes;
  return bytes / record_bytes_;
}

void BucketFile::read(std::size_t bucket, void* to) const {
  auto* at = static_cast<std::byte*>(to);
  for (std::size_t c = first_[bucket]; c < first_[bucket + 1]; ++c) {
    const Section& chunk = chunks_[c].records;
    file_.read(chunk, {std::span(at, chunk.bytes)});
    at += chunk.bytes;
  }
}

}  // namespace tessera
