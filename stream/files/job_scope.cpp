#include "stream/files/job_scope.h"

#include <utility>

namespace tessera {
namespace {

thread_local std::shared_ptr<const JobContext> job_of_thread;

}  // namespace

JobScope::JobScope(std::shared_ptr<const JobContext> job)
    : before_(std::exchange(job_of_thread, std::move(job))) {}

JobScope::~JobScope() {
  job_of_thread = std::move(before_);
}

std::shared_ptr<const JobContext> current_job() {
  return job_of_thread;
}

bool is_given(const std::filesystem::path& input) {
  return job_of_thread != nullptr && job_of_thread->given.contains(input);
}

}  // namespace tessera
