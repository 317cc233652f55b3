#include "stream/files/scratch_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>
#include <vector>

#include "stream/files/durable_file.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRandom = "XXXXXX";

/// \returns a descriptor that holds the folder, -1 when somebody else does or it is none of ours
int hold(const fs::path& folder) {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) return -1;
  struct stat opened = {}, there = {};
  if (::fstat(fd, &opened) == 0 && opened.st_uid == ::geteuid() && ::flock(fd, LOCK_EX | LOCK_NB) == 0 &&
      ::lstat(folder.c_str(), &there) == 0 && opened.st_ino == there.st_ino)
    return fd;
  ::close(fd);
  return -1;
}

void remove_leftovers(const fs::path& parent, const std::string& prefix) {
  std::error_code ignored;
  std::vector<fs::path> found;
  for (fs::directory_iterator i(parent, ignored), end; !ignored && i != end; i.increment(ignored)) {
    const std::string name = i->path().filename().string();
    if (name.size() == prefix.size() + std::string(kRandom).size() && name.rfind(prefix, 0) == 0)
      found.push_back(i->path());
  }
  for (const fs::path& folder : found) {
    const int opened = hold(folder);
    if (opened < 0) continue;
    fs::remove_all(folder, ignored);
    ::close(opened);
  }
}

}  // namespace

ScratchFolder::ScratchFolder(const fs::path& parent, const std::string& word) {
  const std::string prefix = "tessera-" + word + "-";
  remove_leftovers(parent, prefix);
  while (lock_ < 0) {  // between creation and lock another command may take it for a leftover
    std::string name = (parent / (prefix + kRandom)).string();
    if (::mkdtemp(name.data()) == nullptr) throw_write_error(name, errno);
    path_ = name;
    lock_ = hold(path_);
    if (lock_ < 0 && fs::exists(path_)) return;  // a file system without locks
  }
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
  if (lock_ >= 0) ::close(lock_);
}

}  // namespace tessera
