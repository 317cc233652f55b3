#include "stream/formats/byte_window.h"

#include <algorithm>
#include <cstring>
#include <new>

namespace tessera {

namespace {
constexpr std::size_t kPage = 4096;

/// Whole pages, at least one.
std::size_t pages(std::uint64_t bytes) {
  return (std::max<std::size_t>(static_cast<std::size_t>(bytes), 1) + kPage - 1) / kPage * kPage;
}
}  // namespace

ByteWindow::ByteWindow(const ReadFile& file, std::uint64_t begin, std::uint64_t end, std::size_t capacity,
                       bool release)
    : file_(&file),
      end_(end),
      capacity_(pages(std::min<std::uint64_t>(capacity, end - begin))),
      release_(release),
      window_(begin),
      buffer_(static_cast<char*>(std::aligned_alloc(kPage, capacity_))) {
  if (!buffer_) throw std::bad_alloc();
}

void ByteWindow::refill() {
  const std::size_t kept = filled_ - pos_;
  if (kept > 0) std::memmove(buffer_.get(), buffer_.get() + pos_, kept);
  if (release_ && pos_ > 0) file_->release(window_, pos_);
  window_ += pos_;
  pos_ = 0;
  filled_ = kept;
  const std::uint64_t want = std::min<std::uint64_t>(capacity_ - kept, end_ - window_ - kept);
  file_->read_at(window_ + kept, buffer_.get() + kept, want);
  filled_ += static_cast<std::size_t>(want);
  if (window_ + filled_ == end_) file_->require_unchanged();
}

void ByteWindow::skip(std::uint64_t bytes) {
  bytes = std::min(bytes, remaining());
  const std::size_t buffered = filled_ - pos_;
  if (bytes <= buffered) {
    pos_ += static_cast<std::size_t>(bytes);
    return;
  }
  window_ += pos_ + bytes;
  pos_ = filled_ = 0;
}

}  // namespace tessera
