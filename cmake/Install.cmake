# cmake --install: the library, its headers, what find_package and pkg-config look for.
# Each program installs itself.
include(CMakePackageConfigHelpers)
set(TILEGRAD_PACKAGE ${CMAKE_INSTALL_LIBDIR}/cmake/tilegrad)

install(TARGETS tilegrad_api EXPORT tilegradTargets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/tilegrad DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(EXPORT tilegradTargets NAMESPACE tilegrad:: DESTINATION ${TILEGRAD_PACKAGE})

configure_package_config_file(cmake/tilegradConfig.cmake.in ${PROJECT_BINARY_DIR}/tilegradConfig.cmake
  INSTALL_DESTINATION ${TILEGRAD_PACKAGE})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tilegradConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tilegradConfig.cmake ${PROJECT_BINARY_DIR}/tilegradConfigVersion.cmake
  DESTINATION ${TILEGRAD_PACKAGE})

# Wherever the tree is installed or moved to, the file finds it from its own place.
file(RELATIVE_PATH TILEGRAD_PC_TO_PREFIX /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(cmake/tilegrad.pc.in ${PROJECT_BINARY_DIR}/tilegrad.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/tilegrad.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
