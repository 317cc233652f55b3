// Where the processor lacks what the program is compiled for: runs the portable build in its place, if it stands beside it as
// NAME-portable, else says so instead of dying of an illegal instruction.
// Compiled for any x86-64 and called before the first constructor: nothing of C++ or of the standard library is there yet,
// and nothing inline may be shared with files that are compiled for more.
#include <unistd.h>

#if !defined(TESSERA_PORTABLE) && defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
namespace {

constexpr char kMessage[] =
    "tessera: error: this processor lacks AVX2, FMA or BMI2 (x86-64-v3), which the program is compiled for: "
    "run it on one from 2015 or later or on a virtual machine that passes the processor of its host on, or "
    "put "
    "the portable build, which is many times slower, beside it as tessera-portable (tools/build portable)\n";
constexpr char kSuffix[] = "-portable";
constexpr int kResourcesExit = 4;

/// Comes back where there is none.
void run_portable(char** argv, char** environment) {
  char path[4096];
  const ssize_t length = ::readlink("/proc/self/exe", path, sizeof path - sizeof kSuffix);
  if (length <= 0) return;
  for (unsigned i = 0; i < sizeof kSuffix; ++i) path[length + i] = kSuffix[i];
  ::execve(path, argv, environment);
}

void require_instructions(int, char** argv, char** environment) {
  __builtin_cpu_init();
  // Of what x86-64-v3 asks for the three that nothing with all of them lacks the rest of; Clang 14 has no name for the level.
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2"))
    return;
  run_portable(argv, environment);
  const auto written = ::write(2, kMessage, sizeof kMessage - 1);
  static_cast<void>(written);
  ::_exit(kResourcesExit);
}

__attribute__((section(".preinit_array"), used)) void (*const at_start)(int, char**,
                                                                        char**) = require_instructions;

}  // namespace
#endif
