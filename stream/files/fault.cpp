#include "stream/files/fault.h"

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <string>

#include <unistd.h>

namespace tessera {
namespace {

struct Request {
  FaultPoint kind = FaultPoint::kCommit;
  long point = 0;  ///< 0: none
};

Request read_request() {
  const char* text = std::getenv("TESSERA_FAULT");
  const std::string word = text != nullptr ? text : "";
  const std::size_t colon = word.find(':');
  const std::string kind = word.substr(0, colon);
  if (colon == std::string::npos || (kind != "commit" && kind != "write" && kind != "stop")) return {};
  return {kind == "commit"  ? FaultPoint::kCommit
          : kind == "write" ? FaultPoint::kWrite
                            : FaultPoint::kStop,
          std::strtol(word.c_str() + colon + 1, nullptr, 10)};
}

}  // namespace

void fault_point(FaultPoint kind) {
  static const Request request = read_request();
  if (request.point <= 0 || kind != request.kind) return;
  static std::atomic<long> passed{0};
  if (++passed != request.point) return;
  if (kind == FaultPoint::kStop)
    std::raise(SIGTERM);  // on this thread, so that it is noted before this look ends
  else
    ::kill(::getpid(), SIGKILL);
}

}  // namespace tessera
