/// \file killed_command.h
/// What every job must survive. Kills are at points of the work (stream/files/fault.h), so that they meet the same places on every
/// machine.
#pragma once
#include <catch2/catch.hpp>

#include <functional>
#include <string>
#include <vector>

#include "tests/helpers/command.h"

namespace tessera::test {

/// How the command ends that was killed before, again and again: in turn at commits and at writes, each time after more of them
/// than the time before.
/// \param after_kill  called after each kill; may be empty
/// \pre the job has enough of both for three kills at least
inline CommandResult resumed_after_kills(const std::vector<std::string>& words,
                                         const std::function<void()>& after_kill = {}) {
  constexpr int kMaxRounds = 200;
  int kills = 0;
  for (int round = 0; round < kMaxRounds; ++round) {
    // Steps of five meet all four points of a commit.
    const std::string point = round % 2 == 0 ? "commit:" + std::to_string(2 + 5 * (round / 2))
                                             : "write:" + std::to_string(2 + 3 * (round / 2));
    const CommandResult r = tessera_command(words, 0, "TESSERA_FAULT=" + point);
    if (r.code != 128 + SIGKILL) {
      CHECK(kills >= 3);
      return r;
    }
    ++kills;
    if (after_kill) after_kill();
  }
  FAIL("killed " << kMaxRounds << " times and still not at its end");
  return {};
}

}  // namespace tessera::test
