#include "stream/files/bucket_file.h"

#include <algorithm>
#include <string>

#include <xxhash.h>

#include "octree/error.h"

namespace tessera {
namespace {

constexpr char kMagic[8] = {'T', 'S', 'B', 'U', 'C', 'K', 'T', '1'};
constexpr std::uint64_t kLeastChunk = 1024;
constexpr std::uint64_t kMostChunk = 1u << 18;

struct Footer {
  std::uint64_t chunks = 0;
  std::uint64_t buckets = 0;
  std::uint64_t record_bytes = 0;
  std::uint64_t table_hash = 0;
  char magic[8] = {};
};

}  // namespace

BucketFileWriter::BucketFileWriter(const std::filesystem::path& path, std::size_t record_bytes,
                                   std::size_t buckets, std::uint64_t memory_bytes)
    : file_(path), record_bytes_(record_bytes), open_(buckets) {
  const std::uint64_t share =
      std::clamp(memory_bytes / std::max<std::uint64_t>(1, buckets), kLeastChunk, kMostChunk);
  chunk_bytes_ = share / record_bytes * record_bytes;
}

void BucketFileWriter::flush(std::size_t bucket) {
  Open& open = open_[bucket];
  if (open.filled == 0) return;
  chunks_.push_back({bucket, file_.offset(), open.filled, XXH3_64bits(open.data.data(), open.filled)});
  file_.write(open.data.data(), open.filled);
  open.filled = 0;
}

std::uint64_t BucketFileWriter::finish() {
  for (std::size_t b = 0; b < open_.size(); ++b) {
    flush(b);
    std::vector<char>().swap(open_[b].data);
  }
  std::stable_sort(chunks_.begin(), chunks_.end(),
                   [](const Chunk& a, const Chunk& b) { return a.bucket < b.bucket; });
  Footer footer;
  footer.chunks = chunks_.size();
  footer.buckets = open_.size();
  footer.record_bytes = record_bytes_;
  footer.table_hash = XXH3_64bits(chunks_.data(), chunks_.size() * sizeof(Chunk));
  std::copy(std::begin(kMagic), std::end(kMagic), footer.magic);
  file_.write(chunks_.data(), chunks_.size() * sizeof(Chunk));
  file_.write(&footer, sizeof footer);
  return file_.finish();
}

BucketFile::BucketFile(const std::filesystem::path& path, std::size_t record_bytes)
    : file_(path), record_bytes_(record_bytes) {
  const auto damaged = [&](const char* what) {
    return InputError(path.string() + ": " + what + ", the file is damaged; run again with --force");
  };
  Footer footer;
  if (file_.size() < sizeof footer) throw damaged("too short for a bucket file");
  file_.read_at(file_.size() - sizeof footer, &footer, sizeof footer);
  if (!std::equal(std::begin(kMagic), std::end(kMagic), footer.magic) || footer.record_bytes != record_bytes)
    throw damaged("no footer of a bucket file");
  const std::uint64_t bytes = footer.chunks * sizeof(BucketFileWriter::Chunk);
  if (footer.chunks > file_.size() || bytes + sizeof footer > file_.size())
    throw damaged("chunk table does not fit");
  chunks_.resize(footer.chunks);
  if (bytes > 0) file_.read_at(file_.size() - sizeof footer - bytes, chunks_.data(), bytes);
  if (XXH3_64bits(chunks_.data(), bytes) != footer.table_hash)
    throw damaged("checksum of the chunk table differs");
  first_.assign(footer.buckets + 1, 0);
  for (const auto& chunk : chunks_) ++first_[chunk.bucket + 1];
  for (std::size_t b = 0; b < footer.buckets; ++b) first_[b + 1] += first_[b];
}

std::uint64_t BucketFile::records(std::size_t bucket) const {
  std::uint64_t bytes = 0;
  for (std::size_t c = first_[bucket]; c < first_[bucket + 1]; ++c) bytes += chunks_[c].bytes;
  return bytes / record_bytes_;
}

void BucketFile::read(std::size_t bucket, void* to) const {
  auto* at = static_cast<char*>(to);
  for (std::size_t c = first_[bucket]; c < first_[bucket + 1]; ++c) {
    const auto& chunk = chunks_[c];
    file_.read_at(chunk.offset, at, chunk.bytes);
    if (XXH3_64bits(at, chunk.bytes) != chunk.hash)
      throw InputError(file_.path().string() + ": byte " + std::to_string(chunk.offset) +
                       ": checksum of a chunk differs, the file is damaged; run again with --force");
    at += chunk.bytes;
  }
}

}  // namespace tessera
