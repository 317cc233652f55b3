#include "stream/stages/smooth/factor_file.h"

#include <algorithm>

namespace tessera {

FactorFile FactorFile::create(const std::filesystem::path& path, std::uint64_t memory_bytes) {
  FactorFile file(path, memory_bytes);
  file.writer_ = std::make_unique<DirectFile>(path);
  return file;
}

FactorFile FactorFile::open(const std::filesystem::path& path, std::uint64_t memory_bytes) {
  FactorFile file(path, memory_bytes);
  file.reader_.emplace(path);
  file.size_ = file.reader_->size() / sizeof(double);
  file.cached_.resize(std::min(file.size_, file.max_cached_));
  file.reader_->read_at(0, file.cached_.data(), file.cached_.size() * sizeof(double));
  return file;
}

void FactorFile::reserve(std::uint64_t size) {
  max_cached_ = std::min(max_cached_, size);
  cached_.reserve(max_cached_);
}

void FactorFile::append(std::span<const double> values) {
  writer_->write(values.data(), values.size_bytes());
  // A beginning without gaps: what does not fit as a whole ends it.
  if (cached_.size() == size_ && cached_.size() + values.size() <= max_cached_)
    cached_.insert(cached_.end(), values.begin(), values.end());
  size_ += values.size();
}

std::span<const double> FactorFile::read(std::uint64_t first, std::span<double> buffer) {
  if (first + buffer.size() <= cached_.size())
    return std::span<const double>(cached_).subspan(first, buffer.size());
  finish();
  reader_->read_at(first * sizeof(double), buffer.data(), buffer.size_bytes());
  return buffer;
}

std::uint64_t FactorFile::finish() {
  if (writer_) {
    writer_->finish();
    writer_.reset();
    reader_.emplace(path_);
  }
  return size_ * sizeof(double);
}

}  // namespace tessera
