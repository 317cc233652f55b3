/// \file stop.h
/// The user's wish to stop: SIGINT and SIGTERM set a flag that work checks between pieces; nothing is torn
/// down from inside a handler. A signal is the wish of all jobs; a job may have one of its own (job_scope.h).
#pragma once

namespace tessera {

/// From now on SIGINT and SIGTERM only set the flag; one more after two seconds kills as usual.
void catch_stop_signals();

/// The signal received so far by the process, or by the job of this thread alone, 0 if none.
int stop_signal();

/// What a handler does, said from inside the program; 0 takes it back.
void request_stop(int signal);

/// \throws StoppedError once a signal was received
void throw_if_stopped();

}  // namespace tessera
