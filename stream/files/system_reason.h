/// \file system_reason.h
/// What the system says of a failed call, and what to do about it.
#pragma once
#include <string>

namespace tessera {

/// The system's words for an errno; where a limit of the machine or the user is reached, which one and what helps.
std::string os_reason(int error);

/// Full disk, quota, limit on file sizes or open files: nothing is wrong with the file itself.
bool is_limit(int error);

}  // namespace tessera
