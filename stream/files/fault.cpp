#include "stream/files/fault.h"

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <string>

#include <unistd.h>

namespace tessera {
namespace {

long requested_point() {
  const char* text = std::getenv("TESSERA_FAULT");
  const std::string prefix = "commit:";
  if (text == nullptr || std::string(text).rfind(prefix, 0) != 0) return 0;
  return std::strtol(text + prefix.size(), nullptr, 10);
}

}  // namespace

void fault_point() {
  static const long target = requested_point();
  static std::atomic<long> passed{0};
  if (target > 0 && ++passed == target) ::kill(::getpid(), SIGKILL);
}

}  // namespace tessera
