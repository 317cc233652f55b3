/// A job of four small stages behind the real command line frame, for the tests of the runtime.
///
///   make   9 tasks (or more with a smaller tile): a/<k>, numbers hashed from the input
///   mix    7 tasks: b/<k> from all of a/; makes a/ obsolete
///   sum    2 tasks without files, a summary each; finish writes c/all
///   write  2 tasks that write their halves of <output>.part; finish names it
///
///   TESSERA_TOY=sleep:MS   every task takes so long        TESSERA_TOY=fail:STAGE/K   that task throws
///   InputError TESSERA_TOY=fat:BYTES  every task of mix says that it needs so much
#include <fcntl.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <thread>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/runtime/child_process.h"
#include "stream/runtime/job.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/stop.h"
#include "stream/runtime/task_run.h"
#include "tools/frame/cli.h"

using namespace tessera;
namespace fs = std::filesystem;

namespace {

struct ToyOptions {
  double resolution = 0.0;  ///< makes the result
  double radius = 0.0;
  std::vector<Double3> viewpoints;
  std::optional<Double3> up;
  void validate() const {}
};
OptionTable option_table(ToyOptions& o) {
  OptionTable t;
  t.add("resolution", &o.resolution, "");
  t.add("radius", &o.radius, "");
  t.add("viewpoint", &o.viewpoints, "");
  t.add("up", &o.up, "");
  return t;
}

std::string toy(const std::string& key) {
  const char* text = std::getenv("TESSERA_TOY");
  const std::string word = text == nullptr ? "" : text;
  return word.rfind(key + ":", 0) == 0 ? word.substr(key.size() + 1) : "";
}

void write_file(const fs::path& path, const std::string& text) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (fd < 0) throw_write_error(path, errno);
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t wrote = ::write(fd, text.data() + done, text.size() - done);
    if (wrote < 0) {
      const int error = errno;
      ::close(fd);
      throw_write_error(path, error);
    }
    done += static_cast<std::size_t>(wrote);
  }
  ::close(fd);
}

/// 4000 bytes or more that follow from `seed` alone.
std::string noise(const std::string& seed) {
  std::string text;
  for (int i = 0; i < 250; ++i) text += hex64(hash_text(seed + std::to_string(i)));
  return text + "\n";
}

/// What the four have in common.
class ToyStage : public Stage {
 public:
  ToyStage(JobState state, std::string name, std::size_t tasks)
      : state_(std::move(state)), name_(std::move(name)), tasks_(tasks) {}
  std::string name() const override { return name_; }
  std::size_t task_count() const override { return tasks_; }
  std::uint64_t task_bytes(std::size_t) const override { return 100000; }
  std::uint64_t units() const override { return tasks_; }
  std::string unit_name() const override { return "pieces"; }
  std::uint64_t finish_bytes() const override { return 100000; }

  Json run(std::size_t task, TaskContext& context) const override {
    if (toy("fail") == name_ + "/" + std::to_string(task)) throw InputError("toy: task was told to fail");
    const std::string sleep = toy("sleep");
    for (int ms = sleep.empty() ? 0 : std::atoi(sleep.c_str()); ms > 0; ms -= 5) {
      context.check_stop();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    Json summary = work(task, context);
    context.advance(1);
    return summary;
  }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return {{"tasks", summaries.size()}};
  }

 protected:
  virtual Json work(std::size_t task, TaskContext& context) const = 0;
  JobState state_;

 private:
  std::string name_;
  std::size_t tasks_;
};

/// As other stages do, b/ is read by what lies in a/: a foreign file there would change the result.
std::string all_of(const fs::path& folder) {
  std::vector<std::string> parts;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".part") parts.push_back(read_text(entry.path()));
  }
  std::sort(parts.begin(), parts.end());
  std::string text;
  for (const std::string& part : parts) text += part;
  return text;
}

class Make : public ToyStage {
 public:
  static constexpr std::size_t kPieces = 36;
  explicit Make(const JobState& s) : ToyStage(s, "make", s.run.tile_cells == 64 ? 18 : 9) {}
  Json work(std::size_t task, TaskContext& context) const override {
    // The pieces do not depend on how they are dealt out to tasks.
    const std::size_t each = kPieces / task_count();
    for (std::size_t p = task * each; p < (task + 1) * each; ++p) {
      const std::string seed = read_text(state_.inputs.front()) +
                               std::to_string(from_settings<ToyOptions>(state_.settings).resolution) +
                               std::to_string(p);
      write_file(context.create("a/" + std::to_string(p)), noise(seed));
    }
    context.count_written(each);
    return {{"pieces", each}};
  }
};

class Mix : public ToyStage {
 public:
  explicit Mix(const JobState& s) : ToyStage(s, "mix", 7) {}
  std::uint64_t task_bytes(std::size_t) const override {
    const std::string fat = toy("fat");
    return fat.empty() ? 1000000 : std::stoull(fat);
  }
  Json work(std::size_t task, TaskContext& context) const override {
    const std::string all = all_of(state_.work / "a");
    context.count_read(all.size());
    write_file(context.create("b/" + std::to_string(task)), noise(all + std::to_string(task)));
    return nullptr;
  }
  std::vector<std::string> obsolete() const override { return {"a/"}; }
};

class Sum : public ToyStage {
 public:
  explicit Sum(const JobState& s) : ToyStage(s, "sum", 2) {}
  Json work(std::size_t task, TaskContext&) const override {
    return {{"hash", hex64(hash_text(all_of(state_.work / "b") + std::to_string(task)))}};
  }
  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    std::string text;
    for (const Json& summary : summaries) text += summary.at("hash").get<std::string>();
    write_file(context.create("c/all"), noise(text));
    return {{"sums", summaries.size()}};
  }
};

class Write : public ToyStage {
 public:
  explicit Write(const JobState& s) : ToyStage(s, "write", 2) {}
  Json work(std::size_t task, TaskContext&) const override {
    const std::string text = noise(read_text(state_.work / "c/all") + std::to_string(task));
    const fs::path part = state_.output.string() + ".part";
    const int fd = ::open(part.c_str(), O_WRONLY | O_CREAT, 0644);
    if (fd < 0) throw_write_error(part, errno);
    const ssize_t wrote = ::pwrite(fd, text.data(), text.size(), static_cast<off_t>(task * text.size()));
    const int error = errno;
    ::close(fd);
    if (wrote != static_cast<ssize_t>(text.size())) throw_write_error(part, wrote < 0 ? error : ENOSPC);
    return nullptr;
  }
  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    context.create(kOutputName);
    return nullptr;
  }
};

template <typename T>
std::unique_ptr<Stage> make(const JobState& state) {
  return std::make_unique<T>(state);
}

JobDescription toy_job() {
  return {
      "toy", {{"make", make<Make>}, {"mix", make<Mix>}, {"sum", make<Sum>}, {"write", make<Write>}}, 0, {}};
}

struct TaskArguments {
  fs::path work;
  std::string stage, task, writer;
  int driver = 0;
  double wait_s = 0.0;
  fs::path scratch;
};

JobDescription find_toy(const std::string&, const std::string&) {
  return toy_job();
}

}  // namespace

int main(int argc, char** argv) {
  const cli::Command run =
      cli::job_command<ToyOptions>("run", "Run it.", "output", [](const ToyOptions&, JobState state) {
        cli::require_output(state.output);
        run_job(state, toy_job(), cli::stderr_sink());
      });
  TaskArguments a;
  OptionTable task;
  task.add("workdir", &a.work, "").positional();
  task.add("stage", &a.stage, "").positional();
  task.add("k", &a.task, "").positional();
  task.add("writer", &a.writer, "");
  task.add("driven", &a.driver, "");
  task.add("wait", &a.wait_s, "");
  task.add("scratch", &a.scratch, "");
  const cli::Command one = {"task", "One task.", task, [&a] {
                              if (a.driver != 0) follow_parent(a.driver);
                              run_tasks(a.work, find_toy, a.stage, parse_task_choice(a.task),
                                        {a.writer, a.driver != 0, a.wait_s, a.scratch});
                            }};
  return cli::run("toy_job", "Toy job.", {run, one}, argc, argv);
}
