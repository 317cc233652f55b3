#include "stream/files/system_reason.h"

#include <sys/resource.h>

#include <cerrno>
#include <cstring>

namespace tessera {
namespace {

std::string limit_text(int which) {
  rlimit limit = {};
  if (::getrlimit(static_cast<decltype(RLIMIT_FSIZE)>(which), &limit) != 0) return "?";
  return std::to_string(limit.rlim_cur);
}

}  // namespace

std::string os_reason(int error) {
  std::string text = std::strerror(error);
  if (error == EMFILE)
    text +=
        " (ulimit -n allows " + limit_text(RLIMIT_NOFILE) + "): raise that limit, 64 do for every command";
  if (error == EFBIG)
    text += " (ulimit -f allows " + limit_text(RLIMIT_FSIZE) +
            " bytes a file): raise that limit and run the same command again";
  return text;
}

bool is_limit(int error) {
  for (const int limit : {ENOSPC, EDQUOT, EFBIG, EMFILE, ENFILE})
    if (error == limit) return true;
  return false;
}

}  // namespace tessera
