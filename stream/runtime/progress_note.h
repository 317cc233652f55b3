/// \file progress_note.h
/// How far a job is, for programs: what a ProgressSink gets in place of text.
#pragma once
#include <cstdint>
#include <functional>
#include <string>

namespace tessera {

struct JobProgress {
  std::string stage;
  std::size_t stage_index = 0, stages = 0;  ///< from 0
  std::string unit;                         ///< of what follows: points, bricks, faces
  std::uint64_t done = 0, total = 0;        ///< total 0: not known
  double seconds = 0.0;                     ///< of this stage in this run
  bool stage_done = false;
};

/// As ProgressSink::write: every line of text is dropped, and `take` is called twenty times a second and at the end of every stage,
/// from a thread of the job, whatever the job's --progress says.
struct ProgressNotes {
  std::function<void(const JobProgress&)> take;
  void operator()(const std::string&) const {}
};

}  // namespace tessera
