/// \file las_records.h
/// The point records of a LAS or LAZ file, byte for byte as the uncompressed file has them.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "stream/formats/closed_file.h"
#include "stream/formats/laz/schema.h"
#include "stream/formats/points/las_header.h"
#include "stream/formats/points/laz_chunks.h"

namespace tessera {

/// Consecutive records of a file.
struct LasBatch {
  std::size_t slot = 0;  ///< no other batch on its way has this one
  std::size_t count = 0;
  std::vector<char> records;
};

/// The class of a record. \param wide  it has a byte of its own (LasRecords::wide())
std::uint8_t las_class(const char* record, bool wide);
/// Flags stay. \pre value < 32 unless wide
void set_las_class(char* record, bool wide, std::uint8_t value);

/// A file looked at and closed again.
class LasRecords {
 public:
  /// \throws InputError as LasHeader, for what is neither LAS nor LAZ, and where the file does not hold the points that its
  ///   header declares: a copy would lie as the header does
  explicit LasRecords(const std::filesystem::path& path);

  const LasHeader& header() const { return header_; }
  const ClosedFile& file() const { return input_; }
  std::uint64_t points() const { return header_.info.declared_points; }
  std::size_t record_bytes() const { return header_.layout.stride; }
  /// Whether the class has a byte of its own, behind the flags (formats 6 to 10).
  bool wide() const { return header_.point_format >= 6; }
  /// Most records of a batch.
  std::size_t batch_records() const { return batch_records_; }
  /// Memory of read() with so many slots on so many threads.
  std::uint64_t read_bytes(std::size_t slots, int threads) const;

  /// Hands on all records: make(batch) on any thread, then use(batch) in the order of the file, one at a time; at most
  /// `slots` batches are on their way. \throws InputError for damage, and when the file was written to meanwhile
  void read(std::size_t slots, const std::function<void(LasBatch&)>& make,
            const std::function<void(LasBatch&)>& use) const;

 private:
  void plan_chunks(const ReadFile& file);
  void read_in_order(const ReadFile& file, const std::function<void(LasBatch&)>& make,
                     const std::function<void(LasBatch&)>& use) const;
  void load(const ReadFile& file, std::size_t index, LasBatch& batch) const;
  std::size_t batches() const;

  LasRecords(const ReadFile& file, const std::filesystem::path& path);

  ClosedFile input_;
  LasHeader header_;
  std::optional<laz::Schema> schema_;  ///< of compressed points
  LazChunks chunks_;
  std::vector<std::size_t> runs_;  ///< chunks that batches begin with, and the end
  bool in_order_ = false;          ///< its chunks are too large for a batch, or cannot be told apart
  std::size_t batch_records_ = 0;
};

}  // namespace tessera
