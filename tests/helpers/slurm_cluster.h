/// \file slurm_cluster.h
/// A real Slurm on this machine, of its own: slurm_local (../shared/tools) starts a controller and node daemons.
#pragma once
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"

namespace tessera::test {

class SlurmCluster {
 public:
  /// Empty where one can be started here, else why not.
  static std::string missing() {
    if (::geteuid() != 0) return "starting Slurm needs root";
    if (!std::filesystem::exists(tool())) return "needs slurm_local in ../shared/tools";
    if (shell("command -v sbatch && PATH=$PATH:/usr/sbin && command -v slurmctld slurmd munged").code != 0)
      return "needs slurm-wlm and munge";
    return "";
  }
  explicit SlurmCluster(int nodes = 2) {
    started_ = shell(call("start") + " " + std::to_string(nodes) + " 1 4000");
    const std::string text = file_bytes(folder_ / "env.sh");
    const std::size_t at = text.find('=');
    if (at != std::string::npos) conf_ = text.substr(at + 1, text.find_last_not_of('\n') - at);
    ::setenv("SLURM_CONF", conf_.c_str(), 1);
  }
  ~SlurmCluster() {
    shell("scancel --user=root");
    shell(call("stop"));
    ::unsetenv("SLURM_CONF");
  }
  SlurmCluster(const SlurmCluster&) = delete;
  SlurmCluster& operator=(const SlurmCluster&) = delete;

  bool runs() const { return started_.code == 0; }
  const std::string& said() const { return started_.said; }
  Outcome kill_node(const std::string& node) const { return shell(call("kill-node") + " " + node); }
  Outcome start_node(const std::string& node) const { return shell(call("start-node") + " " + node); }
  /// Waits until no job waits or runs. \returns false when that takes longer
  bool idle_within(int seconds) const {
    for (int i = 0; i <= 5 * seconds; ++i) {
      const Outcome queue = shell("squeue --noheader");
      if (queue.code == 0 && queue.said.empty()) return true;
      ::usleep(200000);
    }
    return false;
  }

 private:
  static std::string tool() { return (shared_folder() / "tools/slurm_local").string(); }
  std::string call(const std::string& what) const {
    return tool() + " " + what + " " + folder_.path().string();
  }

  TempFolder folder_;
  Outcome started_;
  std::string conf_;
};

}  // namespace tessera::test
