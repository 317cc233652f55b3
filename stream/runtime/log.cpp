#include "stream/runtime/log.h"

#include <cerrno>
#include <ctime>
#include <fstream>

#include <sys/utsname.h>

#include <fmt/format.h>
#include <spdlog/sinks/basic_file_sink.h>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

std::string field(const char* path, const std::string& name) {
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    if (line.rfind(name, 0) != 0) continue;
    const std::size_t colon = line.find(':');
    const std::size_t start = colon == std::string::npos ? colon : line.find_first_not_of(" \t", colon + 1);
    return start == std::string::npos ? "" : line.substr(start);
  }
  return "";
}

}  // namespace

std::shared_ptr<spdlog::logger> open_log(const std::filesystem::path& file, int verbosity) {
  try {
    auto sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(file.string());
    auto log = std::make_shared<spdlog::logger>("tessera", sink);
    log->set_pattern("%Y-%m-%d %H:%M:%S.%e %L %v");
    log->set_level(verbosity >= 2 ? spdlog::level::debug : spdlog::level::info);
    log->flush_on(spdlog::level::info);
    // A log that cannot be written any more must not end a job: the journal tells when the disk is full.
    log->set_error_handler([](const std::string&) {});
    return log;
  } catch (const spdlog::spdlog_ex&) {
    throw_write_error(file, errno);
  }
}

Json machine_description() {
  utsname os = {};
  ::uname(&os);
  const std::string memory = field("/proc/meminfo", "MemTotal");
  return {{"host", os.nodename},
          {"system", fmt::format("{} {}", os.sysname, os.release)},
          {"processor", field("/proc/cpuinfo", "model name")},
          {"cores", core_count()},
          {"memory_bytes", std::strtoull(memory.c_str(), nullptr, 10) * 1024}};
}

std::string shell_word(const std::string& word) {
  const bool plain = !word.empty() && word.find_first_not_of(
                                          "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                          "0123456789_-./=,:@+") == std::string::npos;
  if (plain) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::string command_line() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::string text;
  std::string word;
  while (std::getline(file, word, '\0')) text += (text.empty() ? "" : " ") + shell_word(word);
  return text;
}

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm parts = {};
  ::gmtime_r(&now, &parts);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", parts.tm_year + 1900, parts.tm_mon + 1,
                     parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec);
}

}  // namespace tessera
