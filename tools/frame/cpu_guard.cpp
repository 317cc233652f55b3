// Says so where the processor lacks what the program is compiled for, instead of dying of an illegal instruction.
// Compiled for any x86-64 and called before the first constructor: nothing of C++ or of the standard library is there yet,
// and nothing inline may be shared with files that are compiled for more.
#include <unistd.h>

#if !defined(TESSERA_PORTABLE) && defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
namespace {

constexpr char kMessage[] =
    "tessera: error: this processor lacks AVX2, FMA or BMI2 (x86-64-v3), which the program is compiled for: "
    "run it on one "
    "from 2015 or later, or on a virtual machine that passes the processor of its host on\n";
constexpr int kResourcesExit = 4;

void require_instructions(int, char**, char**) {
  __builtin_cpu_init();
  // Of what x86-64-v3 asks for the three that nothing with all of them lacks the rest of; Clang 14 has no name for the level.
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2"))
    return;
  const auto written = ::write(2, kMessage, sizeof kMessage - 1);
  static_cast<void>(written);
  ::_exit(kResourcesExit);
}

__attribute__((section(".preinit_array"), used)) void (*const at_start)(int, char**,
                                                                        char**) = require_instructions;

}  // namespace
#endif
