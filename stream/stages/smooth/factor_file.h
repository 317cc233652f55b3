/// \file factor_file.h
/// The factor of a coarse system in a file, its beginning in memory too as far as there is room: what fits decides how
/// fast it is read, and nothing else.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "solvers/factor_store.h"
#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"

namespace tessera {

class FactorFile final : public FactorStore {
 public:
  /// A new file, to be appended to, or one that is there.
  /// \param memory_bytes  for its beginning, beside the buffer of the writer
  /// \throws InputError, ResourceError  of the file, here and below
  static FactorFile create(const std::filesystem::path& path, std::uint64_t memory_bytes);
  static FactorFile open(const std::filesystem::path& path, std::uint64_t memory_bytes);

  std::uint64_t size() const override { return size_; }
  void reserve(std::uint64_t size) override;
  /// \pre nothing was read yet
  void append(std::span<const double> values) override;
  std::span<const double> read(std::uint64_t first, std::span<double> buffer) override;
  /// Ends writing. Returns the bytes of the file.
  std::uint64_t finish();

 private:
  FactorFile(const std::filesystem::path& path, std::uint64_t memory_bytes)
      : path_(path), max_cached_(memory_bytes / sizeof(double)) {}

  std::filesystem::path path_;
  std::uint64_t max_cached_, size_ = 0;
  std::vector<double> cached_;
  std::unique_ptr<DirectFile> writer_;
  std::optional<ReadFile> reader_;
};

}  // namespace tessera
