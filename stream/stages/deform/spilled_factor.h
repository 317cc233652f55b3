/// \file spilled_factor.h
/// A factor in memory as far as there is room, beyond that in a file without a name: what fits decides how fast it is read,
/// and nothing else.
#pragma once
#include <algorithm>
#include <filesystem>
#include <vector>

#include "solvers/factor_store.h"
#include "stream/files/spill_file.h"

namespace tessera {

class SpilledFactor final : public FactorStore {
 public:
  /// \param folder        for the file, which is made only where memory does not do
  /// \param memory_bytes  for its beginning
  SpilledFactor(std::filesystem::path folder, std::uint64_t memory_bytes)
      : file_(std::move(folder)), max_held_(memory_bytes / sizeof(double)) {}

  [[nodiscard]] std::uint64_t size() const override { return size_; }
  void reserve(std::uint64_t size) override { held_.reserve(std::min(max_held_, size)); }
  /// \throws ResourceError  of the file, here and below
  void append(std::span<const double> values) override {
    // A beginning without gaps: what does not fit as a whole ends it.
    if (held_.size() == size_ && held_.size() + values.size() <= max_held_)
      held_.insert(held_.end(), values.begin(), values.end());
    else
      file_.append(values.data(), values.size_bytes());
    size_ += values.size();
  }
  std::span<const double> read(std::uint64_t first, std::span<double> buffer) override {
    if (first + buffer.size() <= held_.size())
      return std::span<const double>(held_).subspan(first, buffer.size());
    const std::uint64_t held = first < held_.size() ? held_.size() - first : 0;
    std::copy_n(held_.begin() + static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(first, held_.size())),
                held, buffer.begin());
    const std::span<double> rest = buffer.subspan(held);
    file_.read_at((first + held - held_.size()) * sizeof(double), rest.data(), rest.size_bytes());
    return buffer;
  }
  /// Bytes that did not fit.
  [[nodiscard]] std::uint64_t spilled_bytes() const { return file_.size(); }

 private:
  SpillFile file_;
  std::uint64_t max_held_, size_ = 0;
  std::vector<double> held_;
};

}  // namespace tessera
