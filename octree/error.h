/// \file error.h
/// The exceptions of Tessera. Each names one documented exit code; only tools/ turns them into one.
/// A message says, in one sentence, what is wrong and where (file, byte offset or line, field, value,
/// limit), and what to do. Expected outcomes are values, our own bugs are asserts.
#pragma once
#include <stdexcept>
#include <string>

namespace tessera {

enum class ExitCode : int {
  kDone = 0,
  kUsage = 2,       ///< options that make no sense
  kInput = 3,       ///< input unreadable or invalid
  kResources = 4,   ///< memory cap or disk cannot suffice
  kEmpty = 5,       ///< nothing to output
  kValidation = 6,  ///< tolerance or validation failed
  kStopped = 7,     ///< stopped before the end, resumable
};

class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

struct UsageError : Error {
  explicit UsageError(const std::string& m) : Error(ExitCode::kUsage, m) {}
};
struct InputError : Error {
  explicit InputError(const std::string& m) : Error(ExitCode::kInput, m) {}
};
struct ResourceError : Error {
  explicit ResourceError(const std::string& m) : Error(ExitCode::kResources, m) {}
};
struct EmptyError : Error {
  explicit EmptyError(const std::string& m) : Error(ExitCode::kEmpty, m) {}
};
struct ValidationError : Error {
  explicit ValidationError(const std::string& m) : Error(ExitCode::kValidation, m) {}
};
struct StoppedError : Error {
  explicit StoppedError(const std::string& m) : Error(ExitCode::kStopped, m) {}
};

}  // namespace tessera
