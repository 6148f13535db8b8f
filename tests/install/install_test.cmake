# cmake -P: installs the build BUILD under WORK, then builds and runs programs that find it there, by find_package and by
# pkg-config; the program, if it was built, checks itself. Nothing of the source tree but the examples' own files is visible to them.
set(PREFIX ${WORK}/prefix)

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    string(REPLACE ";" " " command "${ARGN}")
    message(FATAL_ERROR "${command}\n${output}\nended with ${result}")
  endif()
endfunction()

function(build_consumer source)
  get_filename_component(name ${source} NAME)
  run(${CMAKE_COMMAND} -S ${source} -B ${WORK}/${name} -G Ninja -DCMAKE_PREFIX_PATH=${PREFIX} -DTILEGRAD_EXAMPLES=${SOURCE}/examples
      -DCMAKE_C_COMPILER=${CC} -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_C_FLAGS=${FLAGS} -DCMAKE_CXX_FLAGS=${FLAGS}
      -DCMAKE_EXE_LINKER_FLAGS=${LINK_FLAGS} -DCMAKE_BUILD_TYPE=Release)
  run(${CMAKE_COMMAND} --build ${WORK}/${name})
endfunction()

file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${PREFIX})

if(EXISTS ${PREFIX}/bin/tilegrad)
  run(${PREFIX}/bin/tilegrad selftest)
endif()

build_consumer(${SOURCE}/tests/install)
run(${WORK}/install/hello_triangle)
run(${WORK}/install/hello_c)
build_consumer(${SOURCE}/examples/embed)
run(${WORK}/embed/embed)

# Around the sources: not built, which would take minutes.
set(AROUND ${WORK}/around)
run(${CMAKE_COMMAND} -S ${SOURCE}/tests/install/around -B ${AROUND} -G Ninja -DTILEGRAD_SOURCE=${SOURCE}
    -DCMAKE_C_COMPILER=${CC} -DCMAKE_CXX_COMPILER=${CXX})
execute_process(COMMAND ${CMAKE_COMMAND} --build ${AROUND} -- -n -v OUTPUT_VARIABLE steps COMMAND_ERROR_IS_FATAL ANY)
if(steps MATCHES "src/compat")
  message(FATAL_ERROR "what Python alone needs is built with the library:\n${steps}")
endif()
if(NOT steps MATCHES "-DNDEBUG[^\n]*renderer.cc")
  message(FATAL_ERROR "without a build type the library is not optimised:\n${steps}")
endif()

file(GLOB_RECURSE pc ${PREFIX}/tilegrad.pc)
get_filename_component(pc_folder ${pc} DIRECTORY)
set(ENV{PKG_CONFIG_PATH} ${pc_folder})
execute_process(COMMAND pkg-config --cflags --libs tilegrad OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE
                COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags)
file(GLOB_RECURSE library ${PREFIX}/libtilegrad.so)
run(${WORK}/install/unload ${library})
get_filename_component(library_folder ${library} DIRECTORY)
separate_arguments(FLAGS)
run(${CXX} -std=c++20 ${FLAGS} ${SOURCE}/examples/hello_triangle.cc -o ${WORK}/by_pkg_config ${flags} -Wl,-rpath,${library_folder})
run(${WORK}/by_pkg_config)
execute_process(COMMAND ${CXX} -std=c++17 -fsyntax-only ${SOURCE}/examples/hello_triangle.cc ${flags} ERROR_VARIABLE why)
if(NOT why MATCHES "needs C..20")
  message(FATAL_ERROR "an older C++ is not told what is missing:\n${why}")
endif()
