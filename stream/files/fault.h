/// \file fault.h
/// A hook for the fault tests: TESSERA_FAULT=KIND:N makes the process end itself at the N-th point of a kind that it passes,
/// counted from 1, so that tests need no clock. Not set: nothing happens.
///   commit:N  SIGKILL. Every commit has four points: before its files are synced, before they get their names, after that
///             and before its journal line, after its journal line.
///   write:N   SIGKILL before part of a temporary or output file goes to disk.
///   stop:N    SIGTERM where work looks whether it is to stop.
#pragma once

namespace tessera {

enum class FaultPoint { kCommit, kWrite, kStop };

void fault_point(FaultPoint kind);

}  // namespace tessera
