/// \file long_call.h
/// Work in memory that cannot be asked to stop: the factorisation of a library.
#pragma once
#include <functional>

namespace tessera {

/// Runs `work` on a thread of its own and returns when it is done, or throws what it throws. Once the user wishes to stop it is
/// waited for half a second more, then left behind: so it may hold on to nothing but what it owns.
/// \throws StoppedError
void long_call(std::function<void()> work);

/// Whether such work still runs: then the process may only end by std::_Exit, which destroys nothing under its feet.
bool work_left_behind();

}  // namespace tessera
