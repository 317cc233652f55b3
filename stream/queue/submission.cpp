#include "stream/queue/submission.h"

#include <chrono>

#include <unistd.h>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/runtime/log.h"
#include "stream/runtime/work_dir.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;
void write_mark(const SlurmJob& job, const std::vector<std::string>& numbers) {
  const Json mark = {{"token", job.token}, {"jobs", numbers}, {"submitted", utc_now()}};
  write_durably(job.work / kQueueMark, dump_json(mark, 1) + "\n");
}

void remove_mark(const fs::path& work) {
  fs::remove(work / kQueueMark);
  sync_folder(work / kQueueFolder);
}

}  // namespace

std::vector<std::string> queued_jobs(const fs::path& work) {
  if (!fs::exists(work / kQueueMark)) return {};
  const Json mark = try_parse_json(read_text(work / kQueueMark));
  std::vector<std::string> numbers;
  if (mark.is_object())
    for (const Json& number : mark.value("jobs", Json::array()))
      if (number.is_string()) numbers.push_back(number.get<std::string>());
  return numbers;
}

void forget_ended_submission(const fs::path& work) {
  if (!fs::exists(work / kQueueMark)) return;
  const std::vector<std::string> active = slurm_active(queued_jobs(work));
  if (!active.empty())
    throw UsageError(
        fmt::format("{}: the queue has this job already, {} of its jobs wait or run: tessera status tells "
                    "how far it is, tessera "
                    "cancel takes it out",
                    work.string(), active.size()));
  remove_mark(work);
}

std::string submission_token() {
  const auto now = std::chrono::system_clock::now().time_since_epoch().count();
  return hex64(
      hash_text(fmt::format("{} {} {}", now, ::getpid(), dump_json(machine_description().at("host")))));
}

std::vector<std::string> submission_scripts(const SlurmJob& job, const std::vector<QueueStep>& steps,
                                            const QueueOptions& options) {
  std::vector<std::string> scripts;
  for (std::size_t i = 0; i < steps.size(); ++i)
    scripts.push_back(slurm_script(job, steps[i], options, static_cast<int>(i) + 1, i + 1 == steps.size()));
  return scripts;
}

std::vector<std::string> submit(const SlurmJob& job, const std::vector<QueueStep>& steps,
                                const QueueOptions& options) {
  const fs::path folder = job.work / kQueueFolder;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw_write_error(folder, error.value());
  const std::vector<std::string> scripts = submission_scripts(job, steps, options);
  std::vector<std::string> numbers;
  write_mark(job, numbers);
  try {
    for (std::size_t i = 0; i < scripts.size(); ++i) {
      const fs::path script = folder / fmt::format("{:02}-{}.sh", i + 1, steps[i].name);
      write_durably(script, scripts[i]);
      numbers.push_back(slurm_submit(script, numbers.empty() ? "" : numbers.back()));
      write_mark(job, numbers);
    }
  } catch (...) {
    try {
      slurm_cancel(numbers);
    } catch (const Error&) {  // the first refusal is what the user must hear of
    }
    remove_mark(job.work);
    throw;
  }
  return numbers;
}

std::size_t cancel_submission(const fs::path& work) {
  if (!fs::exists(work / kQueueMark))
    throw UsageError(fmt::format("{}: no batch queue has this job", work.string()));
  const std::vector<std::string> active = slurm_active(queued_jobs(work));
  // First the mark: what ends now must not put itself into the queue again.
  const std::vector<std::string> all = queued_jobs(work);
  remove_mark(work);
  slurm_cancel(all);
  return active.size();
}

}  // namespace tessera
