/// \file log.h
/// The log of a job: one text file, appended to by every run, with the machine and the command on top of
/// each.
#pragma once
#include <filesystem>
#include <memory>
#include <string>

#include <spdlog/logger.h>

#include "stream/files/json.h"

namespace tessera {

/// \param verbosity  2 logs debug lines too
/// \throws ResourceError, InputError when the file cannot be written
std::shared_ptr<spdlog::logger> open_log(const std::filesystem::path& file, int verbosity);

/// Host, system, processor, cores, memory.
Json machine_description();
/// A word as one types it for a shell, quoted where it must be.
std::string shell_word(const std::string& word);
/// The command line of this process, as one would type it.
std::string command_line();
/// "2026-11-20T12:00:00Z"
std::string utc_now();

}  // namespace tessera
