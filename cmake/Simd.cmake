# Which instruction sets kernels are compiled for (TILEGRAD_SIMD), by Highway.
#
#   dynamic  SSE4, AVX2 and AVX-512; the best one is chosen at run time. For what travels: wheels, installed trees
#   native   the best one of the machine that builds; its programs say so on a lesser one. For who builds where it runs
#   avx2     AVX2 alone, as native: for sanitizers and valgrind
#   few      AVX2 and EMU128, chosen at run time
#   all      those of dynamic and EMU128
#   scalar   EMU128 alone, Highway's emulation of vectors
add_library(tilegrad_simd INTERFACE)
target_link_libraries(tilegrad_simd INTERFACE PkgConfig::LIBHWY)

# TILEGRAD_LEVEL: the level of x86-64 that files of kernels are compiled for; empty: any. Highway's least target above emulation, which
# 1.0.3 has for any x86-64, is that of x86-64-v2.
set(TILEGRAD_LEVEL "")
if(TILEGRAD_SIMD STREQUAL "dynamic" AND CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  set(TILEGRAD_LEVEL x86-64-v2)
elseif(TILEGRAD_SIMD STREQUAL "avx2")
  set(TILEGRAD_LEVEL x86-64-v3)
elseif(TILEGRAD_SIMD STREQUAL "native" AND CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  execute_process(COMMAND ${CMAKE_CXX_COMPILER} -march=native -dM -E -x c++ /dev/null OUTPUT_VARIABLE MACROS ERROR_QUIET)
  if(MACROS MATCHES "__AVX512BW__" AND MACROS MATCHES "__AVX512DQ__" AND MACROS MATCHES "__AVX512VL__" AND MACROS MATCHES "__AVX512CD__")
    set(TILEGRAD_LEVEL x86-64-v4)
  elseif(MACROS MATCHES "__AVX2__" AND MACROS MATCHES "__FMA__" AND MACROS MATCHES "__BMI2__" AND MACROS MATCHES "__F16C__")
    set(TILEGRAD_LEVEL x86-64-v3)
  elseif(MACROS MATCHES "__SSE4_2__")
    set(TILEGRAD_LEVEL x86-64-v2)
  endif()
endif()

if(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64|riscv")
  # Vectors without a size at compile time cannot be members of records, which hold them here. NEON serves machines with SVE.
  set(TILEGRAD_DISABLED_TARGETS "HWY_SVE|HWY_SVE2|HWY_SVE_256|HWY_SVE2_128|HWY_RVV")
  # Highway's NEON target includes AES. GCC inlines it into constructors that it makes itself only if all code may use that.
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
    target_compile_options(tilegrad_flags INTERFACE -march=armv8-a+crypto)
  endif()
elseif(NOT TILEGRAD_LEVEL AND NOT TILEGRAD_SIMD STREQUAL "few")  # but SSSE3 and AVX3_DL, which lie between others and would only cost compile time
  set(TILEGRAD_DISABLED_TARGETS "HWY_SSSE3|HWY_AVX3_DL")
elseif(TILEGRAD_SIMD STREQUAL "few")
  set(TILEGRAD_DISABLED_TARGETS "HWY_SSSE3|HWY_SSE4|HWY_AVX3|HWY_AVX3_DL")
else()
  # Emulation serves tests alone.
  set(TILEGRAD_DISABLED_TARGETS "HWY_SSSE3|HWY_AVX3_DL|HWY_EMU128")
endif()

if(TILEGRAD_SIMD STREQUAL "scalar")
  target_compile_definitions(tilegrad_simd INTERFACE HWY_COMPILE_ONLY_EMU128)
elseif(TILEGRAD_SIMD MATCHES "^(native|avx2)$")
  target_compile_definitions(tilegrad_simd INTERFACE HWY_COMPILE_ONLY_STATIC "HWY_DISABLED_TARGETS=(${TILEGRAD_DISABLED_TARGETS})")
else()
  target_compile_definitions(tilegrad_simd INTERFACE
    HWY_COMPILE_ALL_ATTAINABLE "HWY_DISABLED_TARGETS=(${TILEGRAD_DISABLED_TARGETS})")
endif()
if(TILEGRAD_LEVEL)
  target_compile_definitions(tilegrad_simd INTERFACE HWY_DISABLE_PCLMUL_AES)  # which Highway takes for a part of SSE4, and no level has
endif()
# Highway falls back from EMU128 to its one-lane target for GCC before 12.3; Debian 12 has 12.2. The tests hold EMU128 to the
# reference with that very compiler, so the block is lifted: vectors of four lanes everywhere, one code path less.
target_compile_definitions(tilegrad_simd INTERFACE HWY_BROKEN_EMU128=0)

# tilegrad_set_source_flags(<target> <source>): files with Highway's vectors, and those that set up a library by macros, are compiled by themselves; the
# former for TILEGRAD_LEVEL. All others are compiled for any x86-64, so that a program starts, and can say what it lacks, everywhere.
function(tilegrad_set_source_flags target source)
  get_filename_component(file ${source} ABSOLUTE)
  if(NOT source MATCHES "\\.c+$" OR NOT EXISTS ${file})
    return()
  endif()
  file(STRINGS ${file} vectors REGEX "^#include [<\"](hwy/|.*-inl\\.h\")")
  file(STRINGS ${file} macros REGEX "^#define [A-Z_]+_IMPLEMENTATION|^#include <(tiny_gltf|stb_[a-z_]+)\\.h>")
  if(vectors OR macros OR source MATCHES "\\.c$")
    set_source_files_properties(${source} TARGET_DIRECTORY ${target} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  endif()
  if(vectors)
    set(flags $<$<CONFIG:Release>:-O3>)
    if(TILEGRAD_LEVEL)
      list(APPEND flags -march=${TILEGRAD_LEVEL})
    endif()
    set_source_files_properties(${source} TARGET_DIRECTORY ${target} PROPERTIES COMPILE_OPTIONS "${flags}")
  endif()
endfunction()
