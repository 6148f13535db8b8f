// SPDX-License-Identifier: Apache-2.0
// Kernels that are compiled for a level of x86-64 (cmake/Simd.cmake) end a program on a processor
// below it. This ends it first, with a sentence: before main, and before anything of
// C++ whose code may be theirs. Compiled for any x86-64.
#include <string.h>
#include <unistd.h>

#if TILEGRAD_X86_LEVEL == 4
#define TILEGRAD_MISSING                                                         \
  (!__builtin_cpu_supports("avx512f") || !__builtin_cpu_supports("avx512bw") ||  \
   !__builtin_cpu_supports("avx512dq") || !__builtin_cpu_supports("avx512vl") || \
   !__builtin_cpu_supports("avx512cd"))
#define TILEGRAD_SET "AVX-512"
#define TILEGRAD_REMEDY "build on this machine, or anywhere with -DTILEGRAD_SIMD=dynamic"
#elif TILEGRAD_X86_LEVEL == 3
#define TILEGRAD_MISSING                                                \
  (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") || \
   !__builtin_cpu_supports("bmi2"))
#define TILEGRAD_SET "AVX2"
#define TILEGRAD_REMEDY "build on this machine, or anywhere with -DTILEGRAD_SIMD=dynamic"
#else
#define TILEGRAD_MISSING (!__builtin_cpu_supports("sse4.2"))
#define TILEGRAD_SET "SSE4.2"
#define TILEGRAD_REMEDY "build with -DTILEGRAD_SIMD=scalar"
#endif

// The linker is told to look for it (cmake/Simd.cmake), or it would leave this file out.
__attribute__((constructor(101))) void check_processor_for_tilegrad(void);
void check_processor_for_tilegrad(void) {
  __builtin_cpu_init();
  if (!TILEGRAD_MISSING) return;
  static const char kText[] = "tilegrad: this build is for processors with " TILEGRAD_SET
                              ", which this one lacks; " TILEGRAD_REMEDY "\n";
  const ssize_t written = write(STDERR_FILENO, kText, strlen(kText));
  (void)written;
  _exit(1);
}
