# Finds gRPC and Protocol Buffers: by default those of the system, as Debian 12 and Debian 13 have them. With VARIMESH_LATER_GRPC those of
# gRPC 1.65 or later, by the CMake packages that they install (CMAKE_PREFIX_PATH says where); the protocol buffers that belong
# to such a gRPC link Abseil, which only these packages know.
#
# Afterwards there are the targets PkgConfig::grpcpp and protobuf::libprotobuf, and the variables Protobuf_PROTOC_EXECUTABLE,
# GRPC_CPP_PLUGIN and VARIMESH_GRPC_REFLECTION.
if(VARIMESH_LATER_GRPC)
  find_package(gRPC 1.65 CONFIG REQUIRED)
  find_package(Protobuf CONFIG REQUIRED)
  if(NOT TARGET PkgConfig::grpcpp)
    add_library(PkgConfig::grpcpp ALIAS gRPC::grpc++)
  endif()
  set(Protobuf_PROTOC_EXECUTABLE $<TARGET_FILE:protobuf::protoc>)
  set(GRPC_CPP_PLUGIN $<TARGET_FILE:gRPC::grpc_cpp_plugin>)
  set(VARIMESH_GRPC_REFLECTION gRPC::grpc++_reflection)
else()
  find_package(Protobuf REQUIRED)
  find_package(PkgConfig REQUIRED)
  pkg_check_modules(grpcpp REQUIRED IMPORTED_TARGET grpc++)
  find_program(GRPC_CPP_PLUGIN grpc_cpp_plugin REQUIRED)
  set(VARIMESH_GRPC_REFLECTION grpc++_reflection)
endif()
