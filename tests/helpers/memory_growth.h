/// \file memory_growth.h
/// What a piece of work takes.
#pragma once
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdint>
#include <fstream>
#include <string>

#include "stream/runtime/memory_budget.h"

namespace tessera::test {

/// Growth of resident memory while `work` runs, in a process of its own.
template <typename Work>
std::uint64_t growth_of(const Work& work) {
  int ends[2];
  REQUIRE(pipe(ends) == 0);
  const pid_t child = fork();
  if (child == 0) {
    // The code that reads files is in any process of a job; which pages of it the child has is not the work's.
    std::string line;
    std::ifstream status("/proc/self/status");
    std::getline(status, line);
    const std::uint64_t before = resident_bytes();
    work();
    const std::uint64_t grown = peak_resident_bytes() - before;
    const bool written = write(ends[1], &grown, sizeof grown) == static_cast<ssize_t>(sizeof grown);
    _exit(written ? 0 : 1);
  }
  std::uint64_t grown = ~std::uint64_t{0};
  const bool heard = read(ends[0], &grown, sizeof grown) == static_cast<ssize_t>(sizeof grown);
  int status = 0;
  waitpid(child, &status, 0);
  close(ends[0]);
  close(ends[1]);
  REQUIRE(heard);
  REQUIRE(status == 0);
  return grown;
}

}  // namespace tessera::test
