/// \file file_lock.h
/// Locks between processes of one machine: a courtesy that tells the user of a second run. What several machines do to one
/// folder never rests on them.
#pragma once
#include <sys/file.h>

#include <cerrno>

namespace tessera {

/// flock() without waiting. \param mode  LOCK_EX or LOCK_SH
/// \returns 0 when it is held, or when the file system knows no locks; EWOULDBLOCK when another process has it; else errno
inline int try_file_lock(int fd, int mode) {
  if (::flock(fd, mode | LOCK_NB) == 0) return 0;
  return errno == ENOLCK || errno == ENOSYS || errno == EOPNOTSUPP ? 0 : errno;
}

}  // namespace tessera
