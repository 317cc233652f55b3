/// \file factor_store.h
/// Where the columns of a factor lie: memory, or what the caller has, a file for one.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

/// Numbers that are appended once and then read in runs, forwards and backwards.
class FactorStore {
 public:
  virtual ~FactorStore() = default;
  /// Of all numbers in it.
  [[nodiscard]] virtual std::uint64_t size() const = 0;
  /// So many will be appended, at most.
  virtual void reserve(std::uint64_t size) = 0;
  virtual void append(std::span<const double> values) = 0;
  /// The numbers from `first` on: a view that holds until the next call, in `buffer` where they are not in memory.
  virtual std::span<const double> read(std::uint64_t first, std::span<double> buffer) = 0;
};

class MemoryFactorStore final : public FactorStore {
 public:
  [[nodiscard]] std::uint64_t size() const override { return values_.size(); }
  void reserve(std::uint64_t size) override { values_.reserve(size); }
  void append(std::span<const double> values) override {
    values_.insert(values_.end(), values.begin(), values.end());
  }
  std::span<const double> read(std::uint64_t first, std::span<double> buffer) override {
    return std::span<const double>(values_).subspan(first, buffer.size());
  }

 private:
  std::vector<double> values_;
};

}  // namespace tessera
