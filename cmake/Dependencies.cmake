# Every dependency is a Debian package, found here and nowhere else. Nothing is vendored or downloaded.
find_package(TBB REQUIRED)                # libtbb-dev
find_package(glm REQUIRED)                # libglm-dev
find_package(fmt REQUIRED)                # libfmt-dev
find_package(nlohmann_json REQUIRED)      # nlohmann-json3-dev
find_package(PkgConfig REQUIRED)
pkg_check_modules(LIBHWY REQUIRED IMPORTED_TARGET libhwy)    # libhwy-dev
if(TILEGRAD_PROGRAM)
  find_package(assimp REQUIRED)             # libassimp-dev
  find_package(Eigen3 REQUIRED NO_MODULE)   # libeigen3-dev
  find_package(CLI11 REQUIRED)              # libcli11-dev
  find_package(tomlplusplus REQUIRED)       # libtomlplusplus-dev
  pkg_check_modules(LIBZIP REQUIRED IMPORTED_TARGET libzip)    # libzip-dev
  pkg_check_modules(LIBDEFLATE REQUIRED IMPORTED_TARGET libdeflate)    # libdeflate-dev
  pkg_check_modules(STB REQUIRED IMPORTED_TARGET stb)          # libstb-dev
  find_package(ZLIB REQUIRED)               # zlib1g-dev, by libzip-dev; for tests
  pkg_check_modules(MATIO REQUIRED IMPORTED_TARGET matio)        # libmatio-dev
  pkg_check_modules(OPENEXR REQUIRED IMPORTED_TARGET OpenEXR)    # libopenexr-dev
  pkg_check_modules(WEBP REQUIRED IMPORTED_TARGET libwebpmux libwebp)    # libwebp-dev
  pkg_check_modules(WEBPDEMUX REQUIRED IMPORTED_TARGET libwebpdemux)    # likewise; for tests
  find_package(TinyGLTF REQUIRED)           # libtinygltf-dev
  # libopenmpi-dev or libmpich-dev; without it processes train alone.
  find_package(MPI COMPONENTS C)
endif()
if(TILEGRAD_TESTS)
  find_package(GTest REQUIRED)            # libgtest-dev
endif()
if(TILEGRAD_BENCH AND TILEGRAD_PROGRAM)
  find_package(benchmark REQUIRED)        # libbenchmark-dev
endif()
