/// \file bucket_file.h
/// Records of one size, written in any order of buckets and read back bucket by bucket: one packed file of chunks of
/// one bucket each. Inside a bucket records keep the order they came in.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "stream/files/packed_file.h"

namespace tessera {

/// Records of one bucket that follow one another.
struct BucketRun {
  std::uint32_t bucket = 0, count = 0;
};
/// More records.
inline void add_to_runs(std::vector<BucketRun>& runs, std::size_t bucket, std::uint32_t count = 1) {
  if (runs.empty() || runs.back().bucket != bucket) runs.push_back({static_cast<std::uint32_t>(bucket), 0});
  runs.back().count += count;
}

class BucketFileWriter {
 public:
  /// \param memory_bytes  of all open chunks together; at least 1 KiB a bucket is used
  BucketFileWriter(const std::filesystem::path& path, std::size_t record_bytes, std::size_t buckets,
                   std::uint64_t memory_bytes);
  void add(std::size_t bucket, const void* record) {
    Open& open = open_[bucket];
    if (open.filled + record_bytes_ > chunk_bytes_) flush(bucket);
    if (open.data.empty()) open.data.resize(chunk_bytes_);
    std::copy_n(static_cast<const char*>(record), record_bytes_, open.data.data() + open.filled);
    open.filled += record_bytes_;
  }
  /// As many add() of records that follow one another.
  void add_run(std::size_t bucket, const void* records, std::size_t count);
  /// Writes what is open, closes. Returns bytes written.
  std::uint64_t finish();

  struct Chunk {
    std::uint64_t bucket = 0;
    Section records;
  };

 private:
  struct Open {
    std::vector<char> data;
    std::size_t filled = 0;
  };
  void flush(std::size_t bucket);

  PackedWriter file_;
  std::size_t record_bytes_;
  std::size_t chunk_bytes_;
  std::vector<Open> open_;
  std::vector<Chunk> chunks_;
};

class BucketFile {
 public:
  /// \throws InputError when the file is damaged or holds records of another size
  BucketFile(const std::filesystem::path& path, std::size_t record_bytes);
  std::uint64_t records(std::size_t bucket) const;
  /// All records of a bucket, appended. \throws InputError for a damaged chunk
  template <class Record>
  std::vector<Record> load(std::size_t bucket) const {
    std::vector<Record> out(records(bucket));
    read(bucket, out.data());
    return out;
  }

 private:
  void read(std::size_t bucket, void* to) const;

  PackedFile file_;
  std::size_t record_bytes_;
  std::vector<BucketFileWriter::Chunk> chunks_;  ///< by bucket, then as they came
  std::vector<std::size_t> first_;               ///< chunk index per bucket, one more at the end
};

}  // namespace tessera
