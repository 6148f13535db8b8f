# tilegrad_library(<folder> SOURCES ... LINK ... [FOREIGN ...]), tilegrad_test(...), tilegrad_bench(...):
# one place for flags, so that a folder's CMakeLists.txt says only what it holds and what it needs.

add_library(tilegrad_flags INTERFACE)
target_compile_features(tilegrad_flags INTERFACE cxx_std_20)
target_include_directories(tilegrad_flags INTERFACE
  $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>)
# -ffp-contract=off: the reference means what it says, and gives the same bits under every compiler.
target_compile_options(tilegrad_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor> -fno-math-errno -ffp-contract=off)
# g++ 12 reports std::string code of its own library as overlapping (GCC bug 105651).
target_compile_options(tilegrad_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
# GCC takes every file but the one on its command line for a header, whose types should not hold types of anonymous namespaces.
if(TILEGRAD_UNITY)
  target_compile_options(tilegrad_flags INTERFACE $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-subobject-linkage>)
endif()
# GCC frees memory while it compiles, whatever the machine has: a tenth of its time for a fifth less memory (0.7 instead of 0.85 GB for the
# largest of our files). In KiB.
target_compile_options(tilegrad_flags INTERFACE $<$<COMPILE_LANG_AND_ID:CXX,GNU>:--param=ggc-min-heapsize=524288>)
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

# TILEGRAD_CALLER_LEVEL: for libraries that leave what takes time to kernels; their files take a quarter less time to compile so.
# TILEGRAD_PROGRAM_LEVEL: for tests, the command line and the Python bindings. With sanitizers they take half the time without optimisation.
set(TILEGRAD_CALLER_LEVEL $<$<CONFIG:Release,RelWithDebInfo>:-O1>)
set(TILEGRAD_PROGRAM_LEVEL ${TILEGRAD_CALLER_LEVEL})
if(TILEGRAD_SANITIZE)
  set(TILEGRAD_CALLER_LEVEL "")
  set(TILEGRAD_PROGRAM_LEVEL -O0)
endif()

include(cmake/Simd.cmake)

# tilegrad_compile_together(<target> <files> <source>...): so many of its files in one go (CMake's unity build), which parses shared headers once.
# Those with Highway's vectors stay by themselves: Highway includes each again for every instruction set. So do files that set up a library
# by macros.
function(tilegrad_compile_together target files)
  foreach(source IN LISTS ARGN)
    tilegrad_set_source_flags(${target} ${source})
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${TILEGRAD_UNITY} UNITY_BUILD_BATCH_SIZE ${files})
endfunction()

# tilegrad_library(base SOURCES a.cc b.cc LINK tilegrad::x FOREIGN fmt::fmt [CALLER]). CALLER: all but its kernels at TILEGRAD_CALLER_LEVEL.
function(tilegrad_library name)
  cmake_parse_arguments(ARG "CALLER" "" "SOURCES;LINK;FOREIGN" ${ARGN})
  add_library(tilegrad_${name} STATIC ${ARG_SOURCES})
  tilegrad_compile_together(tilegrad_${name} 10 ${ARG_SOURCES})
  add_library(tilegrad::${name} ALIAS tilegrad_${name})
  set_target_properties(tilegrad_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_link_libraries(tilegrad_${name} PUBLIC tilegrad_flags ${ARG_LINK} PRIVATE ${ARG_FOREIGN})
  if(ARG_CALLER)
    target_compile_options(tilegrad_${name} PRIVATE ${TILEGRAD_CALLER_LEVEL})
  endif()
endfunction()

# tilegrad_test(raster_project project_test.cc LINK tilegrad::raster [LONG] [ALONE]): a test of this name, which runs the suites of these
# files. The tests of a folder of tests/ are one program, <folder>_test: linking is what many would cost. ALONE: a program <name>_test of its
# own, for files that replace what a whole program uses. Suites or cases whose name contains "Long" run only in `./run test --long`; a test that
# has some says LONG.
function(tilegrad_test name)
  cmake_parse_arguments(ARG "LONG;ALONE" "" "LINK" ${ARGN})
  set(program ${name}_test)
  if(NOT ARG_ALONE)
    file(RELATIVE_PATH program ${PROJECT_SOURCE_DIR}/tests ${CMAKE_CURRENT_SOURCE_DIR})
    string(REGEX REPLACE "/.*" "_test" program "${program}/")
  endif()
  list(TRANSFORM ARG_UNPARSED_ARGUMENTS PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/ REGEX "^[^/$]")
  if(TARGET ${program})
    target_sources(${program} PRIVATE ${ARG_UNPARSED_ARGUMENTS})
  else()
    add_executable(${program} ${ARG_UNPARSED_ARGUMENTS})
    target_link_libraries(${program} PRIVATE tilegrad_flags GTest::gtest GTest::gtest_main)
    # At -O1 g++ 12 reports a test's own operator new and delete as a mismatch.
    target_compile_options(${program} PRIVATE ${TILEGRAD_PROGRAM_LEVEL} $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-mismatched-new-delete>)
    target_include_directories(${program} PRIVATE ${PROJECT_SOURCE_DIR}/tests ${PROJECT_BINARY_DIR}/tests/include)
    set_target_properties(${program} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  endif()
  target_link_libraries(${program} PRIVATE ${ARG_LINK})
  tilegrad_compile_together(${program} 6 ${ARG_UNPARSED_ARGUMENTS})
  tilegrad_suites(short long ${ARG_UNPARSED_ARGUMENTS})
  if(long_cases AND NOT ARG_LONG)
    message(FATAL_ERROR "${name} has a case that no label runs: ${long_cases}\nAdd LONG, or give it a name without \"Long\".")
  endif()
  add_test(NAME ${name} COMMAND ${program} --gtest_filter=${short}:-*Long* --gtest_brief=1)
  set(seconds 600)
  if(TILEGRAD_SANITIZE)
    set(seconds 7200)  # the longest, fit_poses, takes 23 minutes by itself under the thread sanitizer
  endif()
  set_tests_properties(${name} PROPERTIES LABELS short TIMEOUT ${seconds})
  if(ARG_LONG)
    add_test(NAME ${name}_long COMMAND ${program} --gtest_filter=${long} --gtest_brief=1)
    set_tests_properties(${name}_long PROPERTIES LABELS long TIMEOUT 3000)
  endif()
endfunction()

# tilegrad_suites(<short> <long> <source>...): gtest's filters of the suites in these files: of everything, and of what is
# called Long; sets long_cases to the lines of the latter.
function(tilegrad_suites short long)
  set(all "")
  set(only_long "")
  set(long_cases "")
  foreach(source IN LISTS ARGN)
    if(NOT source MATCHES "\\.cc$")
      continue()
    endif()
    file(STRINGS ${source} lines REGEX "^(TEST|TEST_F|TEST_P|TYPED_TEST)\\([A-Za-z0-9_]+,")
    file(STRINGS ${source} long_lines REGEX "^(TEST|TEST_F|TEST_P|TYPED_TEST)\\([A-Za-z0-9_, ]*Long")
    list(APPEND long_cases ${long_lines})
    foreach(line IN LISTS lines)
      string(REGEX REPLACE "^[A-Z_]+\\(([A-Za-z0-9_]+),.*" "\\1" suite "${line}")
      set(cases Long)
      if(suite MATCHES "Long")
        set(cases "")
      endif()
      list(APPEND all ${suite}.* */${suite}.* ${suite}/*)
      list(APPEND only_long ${suite}.*${cases}* */${suite}.*${cases}* ${suite}/*${cases}*)
    endforeach()
  endforeach()
  list(REMOVE_DUPLICATES all)
  list(REMOVE_DUPLICATES only_long)
  list(JOIN all ":" all)
  list(JOIN only_long ":" only_long)
  set(long_cases "${long_cases}" PARENT_SCOPE)
  set(${short} "${all}" PARENT_SCOPE)
  set(${long} "${only_long}" PARENT_SCOPE)
endfunction()

# tilegrad_bench(raster raster_bench.cc LINK tilegrad::render): Google Benchmark binary <name>_bench.
function(tilegrad_bench name)
  cmake_parse_arguments(ARG "" "" "LINK" ${ARGN})
  add_executable(${name}_bench ${ARG_UNPARSED_ARGUMENTS})
  tilegrad_compile_together(${name}_bench 6 ${ARG_UNPARSED_ARGUMENTS})
  target_link_libraries(${name}_bench PRIVATE ${ARG_LINK} tilegrad_bench_main)
  if(TILEGRAD_SANITIZE)
    target_compile_options(${name}_bench PRIVATE -O0)
  endif()
endfunction()
