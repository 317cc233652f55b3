/// \file makespan.h
/// How long a job would take on so many machines: the steps that `submit` would hand to a queue (queue_steps.h), played
/// through with the times that its stages had on one machine.
///
/// What bounds a step is the longest of three: its elements, in the order of the array, on the nodes; the bytes that it
/// moves, at the rate of the file system that all nodes share; its longest task. What is serial is played as it is.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/queue/queue_steps.h"

namespace tessera {

/// What a stage took, each task on one core.
struct StageCost {
  std::string stage;
  std::uint64_t tasks = 0;
  double task_seconds = 0.0;  ///< of all tasks together
  double longest_task = 0.0;  ///< seconds
  double end_seconds = 0.0;   ///< of its end, which is serial
  double moved_bytes = 0.0;   ///< read and written by tasks and end
};

/// The stages that a job reported, in the order of the run. \param name  of the report, for messages
/// \throws InputError when it is no report of a job
std::vector<StageCost> stage_costs(const Json& report, const std::string& name);

/// The same job on `factor` times as much of the same kind: tasks grow in number, not in size; ends grow with the data.
std::vector<StageCost> scaled(std::vector<StageCost> stages, double factor);

struct Cluster {
  int nodes = 1;
  int threads = 1;             ///< of an element, one a core
  double io_rate = 0.0;        ///< bytes a second of the shared file system; 0 = no bound
  double start_seconds = 0.3;  ///< until an element works: the process, its journals, its part of the plan
  double chain_seconds = 1.0;  ///< until the queue begins a job after the one before it
};

struct StepSpan {
  QueueStep step;
  double seconds = 0.0;
  double moved_bytes = 0.0;
  std::string bound;  ///< what it waits for: "processors", "file system", "longest task", "serial"
};

struct Makespan {
  double seconds = 0.0;
  double work_seconds = 0.0;    ///< of one core that did it all
  double serial_seconds = 0.0;  ///< while one node at most works, queue included
  double efficiency = 0.0;      ///< work by what all cores together could have done
  double busiest_io = 0.0;      ///< bytes a second of the step that moves most
  std::vector<StepSpan> steps;
};

/// \param planning  stages at the beginning that `submit` runs where it is called, before anything is queued
/// \param options  as for queue_steps(); `nodes` is the cluster's
Makespan makespan(const std::vector<StageCost>& stages, std::size_t planning, const Cluster& cluster,
                  QueueOptions options);

}  // namespace tessera
