# Installs what find_package(varimesh) finds: the library, its public headers and its dependencies. These are the
# component `core`, which can be installed even if the service has not been built:
#   cmake --install build/release --component core
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/varimesh)

install(TARGETS varimesh EXPORT varimesh_targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT core)
install(EXPORT varimesh_targets NAMESPACE varimesh:: FILE varimeshTargets.cmake DESTINATION ${package_folder}
        COMPONENT core)

install(SCRIPT ${CMAKE_CURRENT_LIST_DIR}/install_headers.cmake COMPONENT core)
# A program writes #include <varimesh/varimesh.h>.
install(FILES ${CMAKE_CURRENT_LIST_DIR}/varimesh.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/varimesh COMPONENT core)

# Before 1.0 a new minor version may change anything.
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/varimeshConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/varimeshConfig.cmake.in
                              ${CMAKE_CURRENT_BINARY_DIR}/varimeshConfig.cmake
                              INSTALL_DESTINATION ${package_folder})
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/varimeshConfig.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/varimeshConfigVersion.cmake
        DESTINATION ${package_folder} COMPONENT core)
