/// \file fault.h
/// A hook for the fault tests. TESSERA_FAULT=commit:N makes the process kill itself (SIGKILL) at the N-th
/// commit point that it passes, counted from 1. Every commit has four: before its files are synced, before
/// they get their names, after that and before its journal line, after its journal line. Not set: nothing
/// happens.
#pragma once

namespace tessera {

void fault_point();

}  // namespace tessera
