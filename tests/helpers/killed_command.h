/// \file killed_command.h
/// What every job must survive.
#pragma once
#include <catch2/catch.hpp>

#include <initializer_list>
#include <string>
#include <vector>

#include "tests/helpers/command.h"

namespace tessera::test {

/// How the command ends that was killed at each of these moments (milliseconds after its start) before.
/// \pre one kill at least meets it at work
inline CommandResult resumed_after_kills(const std::vector<std::string>& words,
                                         std::initializer_list<unsigned> moments) {
  int kills = 0;
  for (const unsigned ms : moments) kills += tessera_command(words, ms).code == 128 + SIGKILL;
  CHECK(kills > 0);
  return tessera_command(words);
}

}  // namespace tessera::test
