/// \file toy.h
/// The toy job (toy_job.cpp) as a test runs it: a folder with an input and an output.
#pragma once
#include <string>

#include "stream/files/durable_file.h"
#include "tests/helpers/shell.h"

namespace tessera::test {

class Toy {
 public:
  explicit Toy(std::filesystem::path folder) : folder_(std::move(folder)) {
    spill(folder_ / "in.txt", "seed");
  }

  /// Arguments as typed; `environment` like "TESSERA_FAULT=commit:3". No progress unless asked for.
  Outcome run(const std::string& arguments = "", const std::string& environment = "") const {
    return shell(command(arguments, environment));
  }
  std::string command(const std::string& arguments = "", const std::string& environment = "") const {
    std::string line = environment + " " TESSERA_TOY_JOB " run " + (folder_ / "in.txt").string() + " -o " +
                       output().string() + " --resolution 1 " + arguments;
    for (const std::string option : {"--progress none", "-t 2", "--memory 512M"}) {
      if (line.find(option.substr(0, option.find(' ') + 1)) == std::string::npos) line += " " + option;
    }
    return line;
  }
  Outcome task(const std::string& stage, const std::string& k, const std::string& environment = "") const {
    return shell(environment + " " TESSERA_TOY_JOB " task " + work().string() + " " + stage + " " + k);
  }
  /// The same beside a shell command that begins once this one has done a task; $first is its process.
  Outcome run_alongside(const std::string& arguments, const std::string& environment,
                        const std::string& then) const {
    return shell("exec env " + command(arguments, environment) +
                 " & first=$!; for i in $(seq 3000); do [ -n \"$(ls " + (work() / "journal").string() +
                 " 2>/dev/null)\" ] && break; sleep 0.01; done; " + then);
  }
  std::filesystem::path output() const { return folder_ / "out.txt"; }
  std::filesystem::path work() const { return folder_ / "out.txt.tessera"; }
  std::filesystem::path report() const { return folder_ / "out.txt.report.json"; }
  /// Size and hash of the output.
  std::string result() const {
    const std::string text = file_bytes(output());
    return std::to_string(text.size()) + " bytes, " + hex64(hash_text(text));
  }
  /// Nothing but what a finished job leaves.
  bool tidy() const {
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      const std::string name = entry.path().filename().string();
      if (name != "in.txt" && name != "out.txt" && name != "out.txt.report.json") return false;
    }
    return true;
  }

 private:
  std::filesystem::path folder_;
};

/// What an undisturbed run gives.
inline const std::string& toy_truth() {
  static const std::string truth = [] {
    const TempFolder scratch;
    const Toy toy(scratch.path());
    toy.run();
    return toy.result();
  }();
  return truth;
}

}  // namespace tessera::test
