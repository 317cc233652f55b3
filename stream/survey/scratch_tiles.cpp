#include "stream/survey/scratch_tiles.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <utility>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/fault.h"
#include "stream/files/system_reason.h"

namespace tessera {

ScratchTiles::ScratchTiles(std::filesystem::path path, std::size_t tile_bytes)
    : path_(std::move(path)),
      bytes_(tile_bytes),
      fd_(::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600)) {
  if (fd_ < 0) throw_write_error(path_, errno);
}

ScratchTiles::~ScratchTiles() {
  ::close(fd_);
}

void ScratchTiles::write(const Frame& frame) {
  put(frame.key, frame.bytes.get());
}

void ScratchTiles::put(TileKey key, const char* from) {
  std::size_t slot = 0;
  {
    const std::lock_guard lock(mutex_);
    slot = slots_.emplace(key, slots_.size()).first->second;
  }
  fault_point(FaultPoint::kWrite);
  if (const int error = write_all_at(fd_, from, bytes_, slot * bytes_)) throw_write_error(path_, error);
}

void ScratchTiles::read_slot(std::size_t slot, char* to) const {
  for (std::size_t done = 0; done < bytes_;) {
    const ssize_t n = ::pread(fd_, to + done, bytes_ - done, static_cast<off_t>(slot * bytes_ + done));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0)
      throw ResourceError(path_.string() +
                          ": scratch file cannot be read: " + (n < 0 ? os_reason(errno) : "it was cut off"));
    done += static_cast<std::size_t>(n);
  }
}

bool ScratchTiles::read(TileKey key, char* to) const {
  const auto at = slots_.find(key);
  if (at == slots_.end()) return false;
  read_slot(at->second, to);
  return true;
}

ScratchTiles::Frame& ScratchTiles::frame_for(TileKey key) {
  if (frames_.size() < most_) {
    frames_.push_back({});
    frames_.back().bytes = std::make_unique<char[]>(bytes_);
    held_.emplace(key, frames_.size() - 1);
    return frames_.back();
  }
  Frame& oldest = *std::min_element(frames_.begin(), frames_.end(),
                                    [](const Frame& a, const Frame& b) { return a.used < b.used; });
  if (oldest.changed) write(oldest);
  held_.erase(oldest.key);
  held_.emplace(key, static_cast<std::size_t>(&oldest - frames_.data()));
  oldest.changed = false;
  return oldest;
}

char* ScratchTiles::change(TileKey key, const std::function<void(char*)>& blank) {
  if (const char* there = find(key)) {
    frames_[held_.at(key)].changed = true;
    return const_cast<char*>(there);
  }
  Frame& frame = frame_for(key);
  frame.key = key, frame.used = ++clock_, frame.changed = true;
  blank(frame.bytes.get());
  return frame.bytes.get();
}

const char* ScratchTiles::find(TileKey key) {
  if (const auto at = held_.find(key); at != held_.end()) {
    Frame& frame = frames_[at->second];
    frame.used = ++clock_;
    return frame.bytes.get();
  }
  const auto slot = slots_.find(key);
  if (slot == slots_.end()) return nullptr;
  Frame& frame = frame_for(key);
  frame.key = key, frame.used = ++clock_;
  read_slot(slot->second, frame.bytes.get());
  return frame.bytes.get();
}

void ScratchTiles::flush() {
  for (const Frame& frame : frames_)
    if (frame.changed) write(frame);
  frames_.clear();
  frames_.shrink_to_fit();
  held_.clear();
}

std::vector<TileKey> ScratchTiles::keys() const {
  std::vector<TileKey> keys;
  keys.reserve(slots_.size());
  for (const auto& [key, slot] : slots_) keys.push_back(key);
  std::sort(keys.begin(), keys.end());
  return keys;
}

}  // namespace tessera
