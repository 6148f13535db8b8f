# tilegrad_library(<folder> SOURCES ... LINK ... [FOREIGN ...]), tilegrad_test(...), tilegrad_bench(...):
# one place for flags, so that a folder's CMakeLists.txt says only what it holds and what it needs.

add_library(tilegrad_flags INTERFACE)
target_compile_features(tilegrad_flags INTERFACE cxx_std_20)
target_include_directories(tilegrad_flags INTERFACE
  $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>)
# -ffp-contract=off: the reference means what it says, and gives the same bits under every compiler.
# -pthread: some libraries ask for it, and precompiled headers serve only files with the same flags.
target_compile_options(tilegrad_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor> -fno-math-errno -ffp-contract=off -pthread)
# g++ 12 reports std::string code of its own library as overlapping (GCC bug 105651).
target_compile_options(tilegrad_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
if(TILEGRAD_WERROR)
  target_compile_options(tilegrad_flags INTERFACE -Werror)
endif()
if(TILEGRAD_SANITIZE)
  target_compile_options(tilegrad_flags INTERFACE
    -fsanitize=${TILEGRAD_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(tilegrad_flags INTERFACE -fsanitize=${TILEGRAD_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID MATCHES Clang)
    set(IGNORED ${PROJECT_SOURCE_DIR}/cmake/sanitizers.txt)
    target_compile_options(tilegrad_flags INTERFACE -fsanitize-ignorelist=${IGNORED})
    # Neither ninja nor ccache looks into that file: what changes with it is compiled again because its hash is a flag.
    file(SHA1 ${IGNORED} IGNORED_HASH)
    set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${IGNORED})
    target_compile_definitions(tilegrad_flags INTERFACE TILEGRAD_IGNORED=${IGNORED_HASH})
  endif()
endif()

# Highway: every kernel is compiled for each attainable target and EMU128, chosen at run time. Left out: targets between two
# kept ones that would only cost compile time; and targets whose vectors have no size at compile time (SVE, RVV): records here hold
# vectors. NEON serves machines with SVE.
add_library(tilegrad_simd INTERFACE)
target_link_libraries(tilegrad_simd INTERFACE PkgConfig::LIBHWY)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64|riscv")
  set(TILEGRAD_DISABLED_TARGETS "HWY_SVE|HWY_SVE2|HWY_SVE_256|HWY_SVE2_128|HWY_RVV")
  # Highway's NEON target includes AES. GCC inlines it into constructors that it makes itself only if all code may use that,
  # precompiled headers included.
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
    target_compile_options(tilegrad_flags INTERFACE -march=armv8-a+crypto)
  endif()
elseif(TILEGRAD_SIMD STREQUAL "all")
  set(TILEGRAD_DISABLED_TARGETS 0)
elseif(TILEGRAD_SIMD MATCHES "^(few|native)$")
  set(TILEGRAD_DISABLED_TARGETS "HWY_SSSE3|HWY_SSE4|HWY_AVX3|HWY_AVX3_DL")
else()
  set(TILEGRAD_DISABLED_TARGETS "HWY_SSSE3|HWY_AVX3_DL")
endif()
if(TILEGRAD_SIMD STREQUAL "scalar")
  target_compile_definitions(tilegrad_simd INTERFACE HWY_COMPILE_ONLY_EMU128)
elseif(TILEGRAD_SIMD STREQUAL "native")
  target_compile_options(tilegrad_flags INTERFACE -march=native)
  target_compile_definitions(tilegrad_simd INTERFACE HWY_COMPILE_ONLY_STATIC "HWY_DISABLED_TARGETS=(${TILEGRAD_DISABLED_TARGETS})")
else()
  target_compile_definitions(tilegrad_simd INTERFACE
    HWY_COMPILE_ALL_ATTAINABLE "HWY_DISABLED_TARGETS=(${TILEGRAD_DISABLED_TARGETS})")
endif()
# Highway falls back from EMU128 to its one-lane target for GCC before 12.3; Debian 12 has 12.2. The tests hold EMU128 to the
# reference with that very compiler, so the block is lifted: vectors of four lanes everywhere, one code path less.
target_compile_definitions(tilegrad_simd INTERFACE HWY_BROKEN_EMU128=0)

# tilegrad_library(base SOURCES a.cc b.cc LINK tilegrad::x FOREIGN fmt::fmt)
function(tilegrad_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK;FOREIGN" ${ARGN})
  add_library(tilegrad_${name} STATIC ${ARG_SOURCES})
  add_library(tilegrad::${name} ALIAS tilegrad_${name})
  set_target_properties(tilegrad_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_link_libraries(tilegrad_${name} PUBLIC tilegrad_flags ${ARG_LINK} PRIVATE ${ARG_FOREIGN})
  tilegrad_precompiled(tilegrad_${name} shared)
endfunction()

# tilegrad_test(raster_project project_test.cc LINK tilegrad::raster [LONG]): gtest binary <name>_test.
# Suites or cases whose name contains "Long" run only in `./run test --long`; a test that has some says LONG.
function(tilegrad_test name)
  cmake_parse_arguments(ARG "LONG" "" "LINK" ${ARGN})
  add_executable(${name}_test ${ARG_UNPARSED_ARGUMENTS})
  target_link_libraries(${name}_test PRIVATE ${ARG_LINK} tilegrad_flags GTest::gtest GTest::gtest_main)
  target_compile_options(${name}_test PRIVATE ${TILEGRAD_TEST_LEVEL})
  tilegrad_precompiled(${name}_test test)
  target_include_directories(${name}_test PRIVATE ${PROJECT_SOURCE_DIR}/tests ${PROJECT_BINARY_DIR}/tests/include)
  add_test(NAME ${name} COMMAND ${name}_test --gtest_filter=-*Long* --gtest_brief=1)
  set(seconds 600)
  if(TILEGRAD_SANITIZE)
    set(seconds 7200)  # the longest, fit_poses, takes 23 minutes by itself under the thread sanitizer
  endif()
  set_tests_properties(${name} PROPERTIES LABELS short TIMEOUT ${seconds})
  if(ARG_LONG)
    add_test(NAME ${name}_long COMMAND ${name}_test --gtest_filter=*Long* --gtest_brief=1)
    set_tests_properties(${name}_long PROPERTIES LABELS long TIMEOUT 3000)
  endif()
endfunction()

# tilegrad_bench(raster raster_bench.cc LINK tilegrad::render): Google Benchmark binary <name>_bench.
function(tilegrad_bench name)
  cmake_parse_arguments(ARG "" "" "LINK" ${ARGN})
  add_executable(${name}_bench ${ARG_UNPARSED_ARGUMENTS})
  target_link_libraries(${name}_bench PRIVATE ${ARG_LINK} tilegrad_bench_main)
  target_compile_options(${name}_bench PRIVATE ${TILEGRAD_PROGRAM_LEVEL})
  tilegrad_precompiled(${name}_bench program)
endfunction()
