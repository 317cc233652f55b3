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

/// Runs a command that is killed at one of its commits each time, until it ends with 0: in turn at the first, and one and two
/// steps later.
/// \param run         runs it with TESSERA_FAULT in its environment
/// \param after_kill  called after each kill; may be empty
/// \returns how often it was killed
inline int killed_at_commits(int first, int step, const std::function<CommandResult(const std::string&)>& run,
                             const std::function<void()>& after_kill = {}) {
  constexpr int kMaxRounds = 200;
  for (int kills = 0; kills < kMaxRounds; ++kills) {
    const CommandResult r = run("TESSERA_FAULT=commit:" + std::to_string(first + step * (kills % 3)));
    if (r.code == 0) return kills;
    INFO(r.errors);
    REQUIRE(r.code == 128 + SIGKILL);
    if (after_kill) after_kill();
  }
  FAIL("killed " << kMaxRounds << " times and still not at its end");
  return 0;
}

}  // namespace tessera::test
