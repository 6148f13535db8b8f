# tilegrad_precompiled(target kind): compiles the standard library's headers that most files include once for all targets of a kind,
# whose flags are the same: `shared` (position-independent), `program`, `test` (with GoogleTest). A file takes 15 to 25 % less time to compile.
# Builds by clang do without, and so say whether every file includes what it uses.

# Tests take a quarter less time to compile so; what they test keeps its own level. At this level g++ 12 reports a test's own operator new
# and delete as a mismatch. So do the command line and the Python bindings (GLUE), which only call what takes time. With sanitizers, tests, command line and benchmarks take half the time without optimisation.
if(TILEGRAD_SANITIZE)
  set(TILEGRAD_TEST_LEVEL -O0)
  set(TILEGRAD_PROGRAM_LEVEL -O0)
  set(TILEGRAD_GLUE_LEVEL -O0)
  set(TILEGRAD_CALLER_LEVEL)
else()
  set(TILEGRAD_TEST_LEVEL $<$<CONFIG:Release,RelWithDebInfo>:-O1>)
  set(TILEGRAD_PROGRAM_LEVEL)
  set(TILEGRAD_GLUE_LEVEL $<$<CONFIG:Release,RelWithDebInfo>:-O1>)
  set(TILEGRAD_CALLER_LEVEL $<$<CONFIG:Release>:-O2>)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  list(APPEND TILEGRAD_TEST_LEVEL $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CONFIG:Release,RelWithDebInfo>>:-Wno-mismatched-new-delete>)
endif()

function(tilegrad_precompile kind)
  set(owner tilegrad_precompiled_${kind})
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/precompiled/${kind}.cc CONTENT "")
  add_library(${owner} OBJECT EXCLUDE_FROM_ALL ${PROJECT_BINARY_DIR}/precompiled/${kind}.cc)
  target_link_libraries(${owner} PRIVATE tilegrad_flags)
  target_precompile_headers(${owner} PRIVATE ${PROJECT_SOURCE_DIR}/cmake/precompiled.h)
endfunction()

if(TILEGRAD_PRECOMPILED)
  # g++ 12 then reports std::string code of its own library. Builds without (`./run check werror scalar`) have these warnings.
  target_compile_options(tilegrad_flags INTERFACE -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread)
  if(CMAKE_CXX_COMPILER_LAUNCHER MATCHES "(^|/)ccache$")  # which keeps nothing of such files otherwise
    set(CMAKE_CXX_COMPILER_LAUNCHER env CCACHE_SLOPPINESS=pch_defines,time_macros ${CMAKE_CXX_COMPILER_LAUNCHER})
  endif()
  tilegrad_precompile(shared)
  set_target_properties(tilegrad_precompiled_shared PROPERTIES POSITION_INDEPENDENT_CODE ON)
  tilegrad_precompile(caller)
  set_target_properties(tilegrad_precompiled_caller PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_compile_options(tilegrad_precompiled_caller PRIVATE ${TILEGRAD_CALLER_LEVEL})
  tilegrad_precompile(program)
  target_compile_options(tilegrad_precompiled_program PRIVATE ${TILEGRAD_PROGRAM_LEVEL})
  tilegrad_precompile(glue)
  target_compile_options(tilegrad_precompiled_glue PRIVATE ${TILEGRAD_GLUE_LEVEL})
  if(TILEGRAD_TESTS)
    tilegrad_precompile(test)
    target_compile_options(tilegrad_precompiled_test PRIVATE ${TILEGRAD_TEST_LEVEL})
    target_link_libraries(tilegrad_precompiled_test PRIVATE GTest::gtest)
    target_precompile_headers(tilegrad_precompiled_test PRIVATE ${PROJECT_SOURCE_DIR}/cmake/precompiled_test.h)
  endif()
endif()

function(tilegrad_precompiled target kind)
  if(TILEGRAD_PRECOMPILED)
    target_precompile_headers(${target} REUSE_FROM tilegrad_precompiled_${kind})
  endif()
endfunction()
