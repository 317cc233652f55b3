#include "stream/files/spill_file.h"

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/fault.h"
#include "stream/files/system_reason.h"

namespace tessera {
namespace {

[[noreturn]] void fail_spill(const std::filesystem::path& folder, const char* what, int error) {
  std::string advice;
  if (error == ENOSPC || error == EDQUOT) advice = "; free space or name another folder with --temp";
  throw ResourceError("temporary file in " + folder.string() + ": cannot " + what + ": " + os_reason(error) +
                      advice);
}

}  // namespace

SpillFile::~SpillFile() {
  if (fd_ >= 0) ::close(fd_);
}

void SpillFile::open() {
  if (folder_.empty()) folder_ = std::filesystem::temp_directory_path();
  std::string name = (folder_ / "tessera-spill-XXXXXX").string();
  fd_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (fd_ < 0) fail_spill(folder_, "be created", errno);
  ::unlink(name.c_str());
}

std::uint64_t SpillFile::append(const void* data, std::uint64_t bytes) {
  if (fd_ < 0) open();
  fault_point(FaultPoint::kWrite);
  const std::uint64_t offset = size_;
  if (const int error = write_all_at(fd_, data, bytes, offset)) fail_spill(folder_, "be written", error);
  size_ += bytes;
  behind_.written(fd_, size_);
  return offset;
}

void SpillFile::read_at(std::uint64_t offset, void* to, std::uint64_t bytes) const {
  auto* out = static_cast<char*>(to);
  while (bytes > 0) {
    const ssize_t got = ::pread(fd_, out, bytes, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) fail_spill(folder_, "be read", got == 0 ? EIO : errno);
    offset += static_cast<std::uint64_t>(got);
    out += got;
    bytes -= static_cast<std::uint64_t>(got);
  }
}

}  // namespace tessera
