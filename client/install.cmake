# The package that find_package(varimesh-client) finds: libvarimesh-client, its one public header (<varimesh/client.h>), and
# the headers of the proto, which the public header includes. The component `client` is the library itself; the component
# `client-development` is what programs need to compile against it.
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)
include(${PROJECT_SOURCE_DIR}/proto/grpc.cmake)

# A shared library, so that a program does not have to link the libraries inside it. The parts of the core that it contains,
# the writing of files and SHA-256, are hidden. The objects are those of the static libraries.
add_library(varimesh_client_shared SHARED
  $<TARGET_OBJECTS:varimesh_client> $<TARGET_OBJECTS:varimesh_proto> $<TARGET_OBJECTS:varimesh_messages>)
target_link_libraries(varimesh_client_shared
  PUBLIC protobuf::libprotobuf gRPC::grpc++
  PRIVATE $<BUILD_INTERFACE:varimesh> $<BUILD_INTERFACE:varimesh_digest> OpenSSL::Crypto PkgConfig::zstd Threads::Threads)
target_link_options(varimesh_client_shared PRIVATE LINKER:--as-needed LINKER:--exclude-libs,libvarimesh.a:libvarimesh_digest.a)
target_include_directories(varimesh_client_shared INTERFACE $<INSTALL_INTERFACE:include>)
target_compile_features(varimesh_client_shared INTERFACE cxx_std_17)
# Before version 1.0, a new minor version may change the interface.
set_target_properties(varimesh_client_shared PROPERTIES OUTPUT_NAME varimesh-client EXPORT_NAME client
  LINKER_LANGUAGE CXX VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/varimesh-client)
install(TARGETS varimesh_client_shared EXPORT varimesh_client_targets
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT client NAMELINK_COMPONENT client-development)
install(EXPORT varimesh_client_targets NAMESPACE varimesh:: FILE varimesh-clientTargets.cmake
  DESTINATION ${package_folder} COMPONENT client-development)
install(FILES client.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/varimesh COMPONENT client-development)
install(DIRECTORY ${PROJECT_BINARY_DIR}/proto/varimesh/v1 DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/varimesh
  COMPONENT client-development FILES_MATCHING PATTERN *.pb.h)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/varimesh-clientConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
configure_package_config_file(varimesh-clientConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/varimesh-clientConfig.cmake
  INSTALL_DESTINATION ${package_folder})
install(FILES ${PROJECT_SOURCE_DIR}/proto/system_grpc.cmake ${CMAKE_CURRENT_BINARY_DIR}/varimesh-clientConfig.cmake
  ${CMAKE_CURRENT_BINARY_DIR}/varimesh-clientConfigVersion.cmake
  DESTINATION ${package_folder} COMPONENT client-development)
