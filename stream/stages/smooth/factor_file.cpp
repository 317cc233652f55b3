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
  file.held_.resize(std::min(file.size_, file.max_held_));
  file.reader_->read_at(0, file.held_.data(), file.held_.size() * sizeof(double));
  return file;
}

void FactorFile::reserve(std::uint64_t size) {
  max_held_ = std::min(max_held_, size);
  held_.reserve(max_held_);
}

void FactorFile::append(std::span<const double> values) {
  writer_->write(values.data(), values.size_bytes());
  // A beginning without gaps: what does not fit as a whole ends it.
  if (held_.size() == size_ && held_.size() + values.size() <= max_held_)
    held_.insert(held_.end(), values.begin(), values.end());
  size_ += values.size();
}

std::span<const double> FactorFile::read(std::uint64_t first, std::span<double> room) {
  if (first + room.size() <= held_.size()) return std::span<const double>(held_).subspan(first, room.size());
  finish();
  reader_->read_at(first * sizeof(double), room.data(), room.size_bytes());
  return room;
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
